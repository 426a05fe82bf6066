//! A controller that means ill, for tests only: it drives decently for a while if wanted, and then asks for
//! the worst, or breaks down in one of the ways in which programs break down.
//! `launch up coffee --lockstep --swap controller=hostile-controller --set 'controller.mode="max"'`

#![allow(clippy::panic, reason = "that is what it is for")]

mod decent;
mod havoc;
mod params;
mod wheels;

use decent::Decent;
use messages::{MotionReport, Time, WheelSpeeds};
use params::{Decency, Params};
use std::process::ExitCode;
use wheels::Wheels;

const ABOUT: board::About = board::About {
    name: "hostile-controller",
    version: env!("CARGO_PKG_VERSION"),
    description: "A controller that means ill: for tests only",
};

fn main() -> ExitCode {
    board::run(ABOUT, |node, params: Params| {
        let mut decent = Decent::open(node, &params)?;
        let mut wheels = node.publisher::<WheelSpeeds>("wheels/desired")?;
        let mut report = match params.decent {
            Decency::Motion => Some(node.publisher::<MotionReport>("motion/report")?),
            Decency::None | Decency::Fuzzy => None,
        };
        node.every(params.period());
        let mut hostile = Wheels::new(&params, node.seed());
        let mut began: Option<Time> = None;
        Ok(move |now: Time| {
            let age_s = now.seconds_since(*began.get_or_insert(now));
            let (decent_wheels, decent_report) = decent.step(now);
            // Who gives orders shall go on believing that all is well.
            if let (Some(port), Some(message)) = (&mut report, decent_report) {
                port.publish(&message);
            }
            if age_s < params.begins_s {
                wheels.publish(&decent_wheels);
                return;
            }
            for command in hostile.commands(age_s - params.begins_s, decent_wheels) {
                wheels.publish(&command);
            }
            havoc::wreak(params.mode, age_s - params.begins_s);
        })
    })
}
