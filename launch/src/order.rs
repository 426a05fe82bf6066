//! `launch order`: something is wanted of the robot, and whether it will do it.

use crate::console::harmless;
use board::clock;
use board::place::Place;
use board::tap::{Tap, TapReader};
use messages::{Order, OrderReport, OrderStateName, View};
use std::hash::{BuildHasher as _, RandomState};
use std::time::Duration;

const ORDERS: &str = "mission/orders";
const REPORTS: &str = "mission/reports";
/// For so long the robot may take to say whether it takes the order.
const ANSWER_WITHIN: Duration = Duration::from_secs(3);
/// Numbers that customers may give; the navigator's own lie above.
const NUMBERS: u64 = 0xffff_ffff;

/// Gives an order on a board and waits for what becomes of it: in words when it is taken.
///
/// # Errors
/// When it is refused, or nobody answers.
pub(crate) fn order(place: Place, room: &str) -> Result<String, String> {
    let mut tap = Tap::join(place, "order").map_err(|error| error.to_string())?;
    let Some((_, topic)) = tap.manifest().topic(ORDERS) else {
        return Err(format!("this graph takes no orders: it has no topic `{ORDERS}`"));
    };
    // Known again by its number, among those that others give.
    let order_id =
        (RandomState::new().hash_one((std::process::id(), clock::monotonic().as_nanos())) & NUMBERS).max(1);
    let order = serde_json::json!({"room": room, "order_id": order_id});
    let bytes = topic.message.from_json(&order).map_err(|error| {
        if room.len() > size_of::<Order>() - size_of::<u64>() {
            format!("there is no room `{}`: no room has so long a name", harmless(room))
        } else {
            error.to_string()
        }
    })?;
    let mut reports = match tap.manifest().topic(REPORTS) {
        Some(_) => Some(tap.reader(REPORTS).map_err(|error| error.to_string())?),
        None => None,
    };
    let publisher = tap.publisher(ORDERS).map_err(|error| error.to_string())?;
    let deadline = clock::monotonic().after(ANSWER_WITHIN);
    publisher.publish(&bytes).map_err(|error| error.to_string())?;
    while clock::monotonic() < deadline {
        let heard = tap.bell();
        if let Some(report) = reports.as_mut().and_then(|reports| report_of(reports, order_id)) {
            return judge(&report, room);
        }
        // The message lives as long as its publisher, and its readers look when they wake.
        tap.wait(heard, Duration::from_millis(50).min(deadline.since(clock::monotonic())));
    }
    match reports {
        Some(_) => Err(format!(
            "nobody says whether `{}` is served: who takes the orders is down, or logical time stands still",
            harmless(room)
        )),
        // A robot that takes orders without a word.
        None => Ok(format!("ordered: {room}")),
    }
}

fn report_of(reports: &mut TapReader, order_id: u64) -> Option<OrderReport> {
    while let Some((_, bytes)) = reports.next() {
        if let Ok(report) = View::<OrderReport>::parse(bytes)
            && report.message.order_id == order_id
        {
            return Some(*report.message);
        }
    }
    None
}

fn judge(report: &OrderReport, room: &str) -> Result<String, String> {
    match report.state.get() {
        Ok(OrderStateName::Refused) => Err(harmless(report.remark.as_str())),
        Ok(_) if report.before == 0 => Ok(format!("ordered: {room}")),
        Ok(_) => Ok(format!("ordered: {room}, after {} that wait", report.before)),
        Err(error) => Err(error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::FixedText;

    #[test]
    fn what_is_refused_is_an_error_with_the_reason() {
        let mut report = OrderReport { state: OrderStateName::Refused.into(), ..OrderReport::default() };
        report.remark = FixedText::truncated("there is no room `999`");
        assert_eq!(judge(&report, "999"), Err("there is no room `999`".to_owned()));
        report.state = OrderStateName::Accepted.into();
        assert_eq!(judge(&report, "207"), Ok("ordered: 207".to_owned()));
        report.before = 2;
        assert_eq!(judge(&report, "207"), Ok("ordered: 207, after 2 that wait".to_owned()));
    }
}
