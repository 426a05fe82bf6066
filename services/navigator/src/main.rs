//! The process around `navigator`. What a delivery needs to go on is kept before anything is said, so that a
//! successor goes on with it.
use board::News;
use messages::{
    AppliedWheels, Clearance, DoorSighting, DriveCommand, ElevatorCall, ElevatorState, MissionStatus, Order,
    OrderReport, Path, PlanRequest, PoseEstimate, Stamped, Time,
};
use navigator::{Inputs, Navigator, Params, Snapshot};
use std::process::ExitCode;

fn main() -> ExitCode {
    board::run(board::about!(), |node, params: Params| {
        let mut orders = node.optional_queue::<Order>("mission/orders")?;
        let mut pose = node.latest::<PoseEstimate>("location/pose")?;
        let mut path = node.reference::<Path>("plan/path")?;
        let mut sighting = node.reference::<DoorSighting>("door/sighting")?;
        let mut clearance = node.latest::<Clearance>("safety/clearance")?;
        let mut elevator = node.optional_reference::<ElevatorState>("elevator/state")?;
        let mut wheels = node.optional_reference::<AppliedWheels>("wheels/applied")?;
        let mut status = node.publisher::<MissionStatus>("mission/status")?;
        let mut reports = node.publisher::<OrderReport>("mission/reports")?;
        let mut request = node.publisher::<PlanRequest>("plan/request")?;
        let mut command = node.publisher::<DriveCommand>("drive/command")?;
        let mut call = node.publisher::<ElevatorCall>("elevator/call")?;
        node.wake_on(&path);
        node.wake_on(&sighting);
        node.every(params.period());
        let mut kept = node.kept::<Snapshot>();
        let mut navigator = Navigator::new(params)?;
        if let Some(snapshot) = kept.restore() {
            navigator.restore(&snapshot);
        }
        let mut news = News::new();
        Ok(move |now| {
            let mut arrived: Vec<(Time, u64, Order)> = Vec::new();
            while let Some(order) = orders.next() {
                arrived.push((order.stamp, order.sequence, *order));
            }
            let arrived: Vec<_> = arrived
                .iter()
                .map(|(stamp, sequence, order)| Stamped {
                    sequence: *sequence,
                    ..Stamped::new(*stamp, order)
                })
                .collect();
            let outputs = navigator.step(
                now,
                Inputs {
                    orders: &arrived,
                    pose: pose.read(),
                    path: path.read(),
                    sighting: sighting.read(),
                    clearance: clearance.read(),
                    elevator: elevator.read(),
                    wheels: wheels.read(),
                },
            );
            kept.save(&navigator.snapshot());
            for report in &outputs.reports {
                tracing::info!(
                    "order {} to `{}`: {:?} {}",
                    report.order_id,
                    report.room,
                    report.state,
                    report.remark
                );
                reports.publish(report);
            }
            if let Some(message) = &outputs.status {
                if news.is_news(now, (message.status, message.remark)) {
                    tracing::info!("{:?} {}", message.status, message.remark);
                }
                status.publish(message);
            }
            outputs.request.inspect(|message| request.publish(message));
            outputs.call.inspect(|message| call.publish(message));
            command.publish(&outputs.command);
        })
    })
}
