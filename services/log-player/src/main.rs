//! The process around `log_player`.
use log_player::{Due, LogPlayer, Params, check_files, load, located};
use messages::{Odometry, PoseEstimate, RangeScan, TagRanges, TruePose};
use std::process::ExitCode;

fn main() -> ExitCode {
    board::run(board::about!(), |node, params: Params| {
        params.check_log()?;
        let mut odometry = node.publisher::<Odometry>("wheels/odometry")?;
        let mut tag = node.publisher::<TagRanges>("tag/ranges")?;
        let mut scan = node.publisher::<RangeScan>("laser/scan")?;
        let mut truth = node.publisher::<TruePose>("truth/pose")?;
        let mut location = match params.truth_as_location {
            true => Some(node.publisher::<PoseEstimate>("location/pose")?),
            false => None,
        };
        node.every(params.tick());
        check_files(&params)?;
        node.declared()?;
        let mut player = LogPlayer::new(&params, load(&params)?)?;
        for remark in player.remarks() {
            match remark.is_doubtful() {
                true => tracing::warn!(file = params.file, "{remark}"),
                false => tracing::info!(file = params.file, "{remark}"),
            }
        }
        for problem in player.problems() {
            tracing::warn!(file = params.file, "{problem}");
        }
        let untold = player.problem_count().saturating_sub(player.problems().len());
        if untold > 0 {
            tracing::warn!(file = params.file, "and {untold} more of the kind");
        }
        Ok(move |now| {
            for due in player.step(now) {
                match due {
                    Due::Odometry(message) => odometry.publish(message),
                    Due::Tag(message) => tag.publish(message),
                    Due::Scan(header, ranges_m) => scan.publish_with(header, ranges_m),
                    Due::Truth(message) => {
                        truth.publish(message);
                        if let Some(location) = &mut location {
                            location.publish(&located(message));
                        }
                    }
                }
            }
        })
    })
}
