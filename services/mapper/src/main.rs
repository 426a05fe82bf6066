//! The process around `mapper`.
use geometry::{MapImage, MapMode};
use mapper::{Inputs, Mapper, Params};
use messages::{OccupancyMap, PoseEstimate, RangeScan};
use std::process::ExitCode;

/// Saves the map when the process ends.
struct Saver {
    mapper: Mapper,
    file: String,
}

impl Saver {
    fn save(&self) {
        let result = self.mapper.map().to_trinary_grid().save(&self.file, MapMode::Trinary, MapImage::Pgm);
        match result {
            Ok(()) => tracing::info!(file = self.file, "map saved"),
            Err(error) => tracing::error!(%error, "the map is not saved"),
        }
    }
}

impl Drop for Saver {
    fn drop(&mut self) {
        // Without a scan there is nothing that was not known before.
        if !self.file.is_empty() && self.mapper.header().scans > 0 {
            self.save();
        }
    }
}

fn main() -> ExitCode {
    board::run(board::about!(), |node, params: Params| {
        let mut poses = node.queue::<PoseEstimate>("location/pose")?;
        let mut scans = node.queue::<RangeScan>("laser/scan")?;
        let mut maps = node.publisher::<OccupancyMap>("map/occupancy")?;
        node.wake_on(&poses);
        node.wake_on(&scans);
        node.every(params.period());
        let mut saver = Saver { file: params.save.clone(), mapper: Mapper::new(params)? };
        Ok(move |now| {
            let mut due = mapper::Outputs::default();
            loop {
                let inputs = Inputs { pose: poses.next(), scan: scans.next() };
                let is_last = inputs.pose.is_none() && inputs.scan.is_none();
                let outputs = saver.mapper.step(now, inputs);
                due.publish |= outputs.publish;
                due.save |= outputs.save;
                if is_last {
                    break;
                }
            }
            let header = saver.mapper.header();
            if due.publish
                && let Some(mut loan) = maps.loan(saver.mapper.map().thousandths().len())
            {
                let (place, cells) = loan.parts();
                *place = header;
                saver.mapper.map().write_percents(cells);
                loan.send();
            }
            if due.save {
                saver.save();
            }
        })
    })
}
