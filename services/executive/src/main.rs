//! The process around `executive`.
use board::News;
use executive::{Executive, Inputs, Params};
use messages::{
    JourneyStatus, MotionCommand, MotionReport, ParticleCloud, Path, PlanRequest, PoseEstimate, RangeScan,
    SonarCommand, WallSurvey,
};
use std::process::ExitCode;

fn main() -> ExitCode {
    board::run(board::about!(), |node, params: Params| {
        let mut raw = node.reference::<RangeScan>("sonar/raw")?;
        let mut survey = node.reference::<WallSurvey>("sonar/survey")?;
        let mut report = node.latest::<MotionReport>("motion/report")?;
        let mut pose = node.latest::<PoseEstimate>("location/pose")?;
        let mut cloud = node.reference::<ParticleCloud>("location/particles")?;
        let mut path = node.reference::<Path>("plan/path")?;
        let mut sonar = node.publisher::<SonarCommand>("sonar/command")?;
        let mut motion = node.publisher::<MotionCommand>("motion/command")?;
        let mut request = node.publisher::<PlanRequest>("plan/request")?;
        let mut status = node.publisher::<JourneyStatus>("journey/status")?;
        node.wake_on(&survey);
        node.wake_on(&path);
        node.every(params.period());
        let mut executive = Executive::new(params, node.seed())?;
        let mut news = News::new();
        Ok(move |now| {
            let inputs = Inputs {
                raw: raw.read(),
                survey: survey.read(),
                report: report.read(),
                pose: pose.read(),
                cloud: cloud.read(),
                path: path.read(),
            };
            let outputs = executive.step(now, inputs);
            sonar.publish(&outputs.sonar);
            motion.publish(&outputs.motion);
            request.publish(&outputs.request);
            let said = &outputs.status;
            if news.is_news(now, (said.stage, said.retreats, said.plans, said.remark)) {
                tracing::info!(
                    "{:?}, {} places alike, {} paths, {} retreats {}",
                    said.stage,
                    said.places,
                    said.plans,
                    said.retreats,
                    said.remark
                );
            }
            status.publish(said);
        })
    })
}
