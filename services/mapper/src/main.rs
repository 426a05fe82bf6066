//! The process around `mapper`.
use geometry::{MapError, MapMode, OccupancyGrid};
use mapper::{Beyond, Inputs, Mapper, Params, SAVED_AS};
use messages::{OccupancyMap, PoseEstimate, RangeScan};
use std::cell::RefCell;
use std::io::Write as _;
use std::process::ExitCode;
use std::rc::Rc;
use std::thread::JoinHandle;

/// Saves the map now and then, beside the loop, so that no disk makes a step late; and when the process ends.
struct Saver {
    mapper: Mapper,
    file: String,
    writing: Option<JoinHandle<Result<(), MapError>>>,
    /// Whether it was told that the map reaches not far enough.
    is_told: bool,
    /// Why the map of this run is lost, for when all is over.
    lost: Rc<RefCell<Option<String>>>,
}

impl Saver {
    fn save_beside(&mut self) {
        if self.writing.as_ref().is_some_and(|writing| !writing.is_finished()) {
            return;
        }
        self.await_writing();
        let (grid, file) = (self.mapper.map().to_trinary_grid(), self.file.clone());
        let writer = std::thread::Builder::new().spawn(move || save(&grid, &file));
        self.writing = writer.inspect_err(|error| tracing::warn!(%error, "the map is not saved now")).ok();
    }

    fn await_writing(&mut self) {
        if let Some(Ok(Err(error))) = self.writing.take().map(JoinHandle::join) {
            tracing::error!(%error, "the map is not saved now");
        }
    }

    fn tell_beyond(&mut self, Beyond { readings, least, most }: Beyond) {
        let (frame, [x, y]) = (self.mapper.map().frame(), [least.x, least.y]);
        tracing::warn!(
            "{readings} readings ended beyond the map of {} x {} m, from ({x:.1}, {y:.1}) to ({:.1}, {:.1}): they are \
             lost; set min_x_m, min_y_m, width_m and height_m",
            f64::from(frame.width()) * frame.resolution_m(),
            f64::from(frame.height()) * frame.resolution_m(),
            most.x,
            most.y,
        );
        self.is_told = true;
    }
}

fn save(grid: &OccupancyGrid, file: &str) -> Result<(), MapError> {
    grid.save(file, MapMode::Trinary, SAVED_AS)
}

impl Drop for Saver {
    fn drop(&mut self) {
        if let Some(beyond) = self.mapper.map().beyond() {
            self.tell_beyond(beyond);
        }
        self.await_writing();
        if self.file.is_empty() {
            return;
        }
        // Without a scan there is nothing that was not known before.
        if self.mapper.header().scans == 0 {
            tracing::warn!(file = self.file, "no map is saved: not one scan could be used");
            return;
        }
        match save(&self.mapper.map().to_trinary_grid(), &self.file) {
            Ok(()) => tracing::info!(file = self.file, "map saved"),
            Err(error) => *self.lost.borrow_mut() = Some(format!("the map is not saved: {error}")),
        }
    }
}

fn main() -> ExitCode {
    let lost = Rc::new(RefCell::new(None));
    let code = board::run(board::about!(), |node, params: Params| {
        let mut poses = node.queue::<PoseEstimate>("location/pose")?;
        let mut scans = node.queue::<RangeScan>("laser/scan")?;
        let mut maps = node.publisher::<OccupancyMap>("map/occupancy")?;
        node.wake_on(&poses);
        node.wake_on(&scans);
        node.every(params.period());
        params.check_files()?;
        node.declared()?;
        let (file, lost) = (params.save.clone(), Rc::clone(&lost));
        let mut saver = Saver { mapper: Mapper::new(params)?, file, writing: None, is_told: false, lost };
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
                saver.save_beside();
            }
            if let Some(beyond) = saver.mapper.map().beyond().filter(|_| !saver.is_told) {
                saver.tell_beyond(beyond);
            }
        })
    });
    match lost.take() {
        Some(why) => {
            let _ = writeln!(std::io::stderr(), "error: {why}");
            ExitCode::FAILURE
        }
        None => code,
    }
}
