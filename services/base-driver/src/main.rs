//! The process around `base_driver`.
use base_driver::{BaseDevice, BaseDriver, Device, Inputs, Params, Room, Snapshot};
use board::{Kept, Latest, News, Publisher};
use messages::{
    AppliedWheels, Clearance, DriveReason, MotionCommand, Odometry, Time, WheelSpeeds, WorldTruth,
};
use std::process::ExitCode;

/// What has to come to rest, whichever way the process leaves.
struct Base {
    driver: BaseDriver,
    device: Box<dyn BaseDevice>,
    applied: Publisher<AppliedWheels>,
    kept: Kept<Option<Snapshot>>,
    has_stepped: bool,
    news: News<DriveReason>,
}

impl Base {
    fn step(&mut self, now: Time, ports: &mut Ports) {
        self.device.see(ports.truth.as_mut().and_then(Latest::read));
        let inputs = Inputs {
            clearance: ports.clearance.read(),
            desired: ports.desired.read(),
            order: ports.order.as_mut().and_then(Latest::read),
            encoders: self.device.encoders(now).ok(),
        };
        let outputs = self.driver.step(now, inputs);
        // A controller that does not answer shows in its encoders with the next step.
        let _ = self.device.drive(outputs.applied.left_mps, outputs.applied.right_mps);
        if self.news.is_news(now, outputs.applied.reason) {
            tracing::info!("{:?}", outputs.applied.reason);
        }
        self.applied.publish(&outputs.applied);
        if let Some(odometry) = outputs.odometry {
            ports.odometry.publish(&odometry);
        }
        self.kept.save_now_and_then(now, || self.driver.snapshot());
        self.has_stepped = true;
    }
}

impl Drop for Base {
    fn drop(&mut self) {
        if self.has_stepped {
            let _ = self.device.drive(0.0, 0.0);
            self.applied.publish(&self.driver.leave());
        }
    }
}

struct Ports {
    clearance: Latest<Clearance>,
    desired: Latest<WheelSpeeds>,
    order: Option<Latest<MotionCommand>>,
    truth: Option<Latest<WorldTruth>>,
    odometry: Publisher<Odometry>,
}

fn main() -> ExitCode {
    board::run(board::about!(), |node, params: Params| {
        let mut ports = Ports {
            clearance: node.latest("safety/clearance")?,
            desired: node.latest("wheels/desired")?,
            order: match params.room {
                Room::Ordered => Some(node.reference("motion/command")?),
                Room::Seen | Room::Unchecked => None,
            },
            truth: match params.device {
                Device::Simulated => Some(node.reference("world/truth")?),
            },
            odometry: node.sensor_publisher("wheels/odometry")?,
        };
        let applied = node.publisher("wheels/applied")?;
        node.wake_on(&ports.clearance);
        node.wake_on(&ports.desired);
        node.every(params.period());
        let device = params.open_device();
        let mut driver = BaseDriver::new(params)?;
        let kept = node.kept();
        if let Some(snapshot) = kept.restore().flatten() {
            driver.restore(&snapshot);
        }
        let mut base = Base { driver, device, applied, kept, has_stepped: false, news: News::new() };
        Ok(move |now| base.step(now, &mut ports))
    })
}
