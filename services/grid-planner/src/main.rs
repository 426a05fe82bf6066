//! The process around `grid_planner`.
use board::News;
use grid_planner::{GridPlanner, Inputs, Params};
use messages::{Path, PlanRequest, PoseEstimate, TofRanges};
use std::process::ExitCode;

fn main() -> ExitCode {
    board::run(board::about!(), |node, params: Params| {
        let mut request = node.reference::<PlanRequest>("plan/request")?;
        let mut pose = node.latest::<PoseEstimate>("location/pose")?;
        let mut ranges = node.optional::<TofRanges>("tof/ranges")?;
        let mut path = node.publisher::<Path>("plan/path")?;
        node.wake_on(&request);
        node.every(params.period());
        GridPlanner::check(&params)?;
        node.declared()?;
        let mut planner = GridPlanner::new(params)?;
        let mut news = News::new();
        Ok(move |now| {
            let inputs = Inputs { request: request.read(), pose: pose.read(), ranges: ranges.read() };
            if let Some((header, waypoints)) = planner.step(now, inputs).path {
                if news.is_news(now, (header.request_id, header.revision, header.state)) {
                    tracing::info!(
                        length_m = header.length_m,
                        "path {}.{}: {:?}",
                        header.request_id,
                        header.revision,
                        header.state
                    );
                }
                path.publish_with(&header, waypoints);
            }
        })
    })
}
