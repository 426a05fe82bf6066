//! A machine that has too little of something: a sentence with what lacks, how much, and the remedy; never a
//! signal.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on shall stop")]

use std::process::{Command, Output};
use std::sync::atomic::{AtomicU32, Ordering};
use tests::{build, launcher};

/// What the shell says in a place of its own, where shared memory has this size; `None` where that is not
/// permitted.
fn with_shared_memory(options: &str, script: &str) -> Option<Output> {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let board = format!("t-m-{}-{}", std::process::id(), NUMBER.fetch_add(1, Ordering::Relaxed));
    let mount = format!("mount -t tmpfs -o {options} tmpfs /dev/shm || exit 77\n{script}");
    let output = Command::new("unshare")
        .args(["-m", "sh", "-c", &mount, "sh"])
        .env("launch", launcher())
        .env("tool", build().join("board"))
        .env("BOARD", board)
        .output();
    match output {
        Ok(output) if output.status.code() != Some(77) && !words(&output).contains("unshare failed") => {
            Some(output)
        }
        _ => {
            println!("skipped: no file system can be mounted here");
            None
        }
    }
}

fn words(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

/// The coffee, as fast as it can be had.
const COFFEE: &str = "exec \"$launch\" up coffee --no-build --lockstep --board \"$BOARD\"";

#[track_caller]
fn refused(options: &str, script: &str, lack: &str, remedy: &str) {
    let Some(output) = with_shared_memory(options, script) else { return };
    let words = words(&output);
    assert_eq!(output.status.code(), Some(1), "{options}: {words}");
    assert!(words.contains(lack) && words.contains(remedy), "{options}: {words}");
}

#[test]
fn too_little_shared_memory_is_refused_with_numbers() {
    for size in 1..=3 {
        let has = format!("of {size}.00 MiB");
        refused(&format!("size={size}m"), COFFEE, &has, "mount -o remount,size=16M /dev/shm");
    }
    refused("size=24m,nr_inodes=40", COFFEE, "/dev/shm holds 40 files", "nr_inodes=");
    refused("size=24m,ro", COFFEE, "read-only", "");
}

#[test]
fn eight_mebibytes_are_enough_for_a_coffee() {
    for size in [8, 24] {
        let Some(output) = with_shared_memory(&format!("size={size}m"), COFFEE) else { return };
        assert!(output.status.success() && words(&output).contains("PASSED"), "{}", words(&output));
    }
}

#[test]
fn shared_memory_that_fills_up_ends_nobody() {
    // In host time, since nobody else gets to act in logical time.
    const FILLED: &str = "\
        \"$launch\" up coffee --no-build --plain --board \"$BOARD\" --set navigator.default_order= > /tmp/$BOARD.out 2>&1 &\n\
        while ! grep -q 'services are ready' /tmp/$BOARD.out; do kill -0 $! || { cat /tmp/$BOARD.out; exit 1; }; sleep 0.1; done\n\
        dd if=/dev/zero of=/dev/shm/everything bs=64k 2>/dev/null; dd if=/dev/zero of=/dev/shm/rest bs=1 2>/dev/null\n\
        \"$launch\" order 211 --board \"$BOARD\" || true\n\
        sleep 3\n\
        \"$launch\" ps --json --board \"$BOARD\"\n\
        rm /dev/shm/everything /dev/shm/rest\n\
        \"$launch\" stop --board \"$BOARD\"; wait; cat /tmp/$BOARD.out; rm /tmp/$BOARD.out";
    let Some(output) = with_shared_memory("size=8m", FILLED) else { return };
    let words = words(&output);
    assert!(words.contains("\"restarts\": 0"), "{words}");
    for sign in ["\"restarts\": 1", "signal", "starting it again", "panicked"] {
        assert!(!words.contains(sign), "{sign}: {words}");
    }
}

#[test]
fn too_few_files_are_named() {
    for limit in [16, 32, 64, 128] {
        let script = format!("ulimit -n {limit} || exit 77\n{COFFEE}");
        let output = Command::new("sh")
            .args(["-c", &script])
            .env("launch", launcher())
            .env("BOARD", format!("t-m-{}-f{limit}", std::process::id()))
            .output()
            .unwrap();
        let words = words(&output);
        assert!(output.status.code() == Some(1) && words.contains("ulimit -n 1024"), "{limit}: {words}");
        assert!(!words.contains("panicked"), "{limit}: {words}");
    }
}
