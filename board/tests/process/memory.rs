//! Shared memory that has no room left while services run.

use crate::robot::{Robot, await_message, itself};
use crate::services::{Count, Seen};
use messages::Health;
use messages::health_topic;
use std::process::{Command, ExitCode};
use zerocopy::IntoBytes as _;

/// In a shared memory of 6 MiB: pictures that there is no room for, beside messages that there is.
pub(crate) fn cramped_process() -> ExitCode {
    let mut robot =
        Robot::new(&[("picture", "painter"), ("seen", "collector"), (&health_topic("painter"), "painter")]);
    robot.start("collector");
    robot.start("painter");
    let mut tap = robot.tap();
    let count = tap.publisher("count").unwrap();
    let mut seen = tap.reader("seen").unwrap();
    let mut pictures = tap.reader("picture").unwrap();
    let mut health = tap.reader(&health_topic("painter")).unwrap();
    for number in 1..=20_u64 {
        count.publish(Count { number, twice: 2 * number }.as_bytes()).unwrap();
        await_message::<Seen>(&tap, &mut seen, |_, seen| seen.number == number);
    }
    // Each picture was tried, found no room, and was counted; nobody died.
    let lost = await_message::<Health>(&tap, &mut health, |_, health| health.lost_messages > 0);
    assert!(lost.lost_messages <= 20 && pictures.next().is_none());
    drop((count, seen, pictures, health, tap));
    robot.take_down();
    ExitCode::SUCCESS
}

pub(crate) fn a_message_without_room_is_lost_and_said() {
    let script = "mount -t tmpfs -o size=6m tmpfs /dev/shm || exit 77; exec \"$0\"";
    let program = itself("cramped");
    let output = Command::new("unshare")
        .args(["-m", "sh", "-c", script])
        .arg(program.get_program())
        .envs(program.get_envs().filter_map(|(name, value)| Some((name, value?))))
        .output();
    let Ok(output) = output else {
        println!("skipped: there is no unshare");
        return;
    };
    let words = String::from_utf8_lossy(&output.stderr);
    if output.status.code() == Some(77) || words.contains("unshare failed") {
        println!("skipped: no file system can be mounted here");
        return;
    }
    assert!(output.status.success(), "{words}");
    let said = "no room for messages of";
    assert!(words.contains(said) && words.contains("of shared memory are needed"), "{words}");
    assert!(words.matches(said).count() <= 20, "said for each message: {words}");
}
