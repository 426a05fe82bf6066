//! The tool when things go wrong: wrong arguments, closed pipes, boards that go, hostile texts.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

mod support;

use board::host::Host;
use board::manifest::Topic;
use board::place::Place;
use board::switchboard::SlotState;
use board::tap::Tap;
use messages::WheelSpeeds;
use recording::Recording;
use std::process::{Command, Stdio};
use std::sync::atomic::Ordering;
use std::time::Duration;
use support::{begun, command, host, said, succeeds, tool, wait_for};

fn name(of: &str) -> String {
    format!("t-{of}-{}", std::process::id())
}

/// A process, this one, that plays a role and takes steps.
fn plays(host: &Host, role: &str) {
    let slot = host.prepare(role, true).unwrap();
    let slot = host.switchboard().slot(slot).unwrap();
    slot.pid.store(std::process::id(), Ordering::Release);
    slot.set_state(SlotState::Running);
}

#[test]
fn whoever_would_be_obeyed_says_force() {
    let name = name("force");
    let host = host(&name);
    const BYTES: &str = "00000000000000000000000000000000";
    let check = |arguments: &[&str], refused: Option<&str>| {
        let arguments = [&["publish"], arguments].concat();
        let (code, stdout, stderr) = said(&name, &arguments);
        match refused {
            Some(why) => {
                assert!(code == Some(1) && stderr.contains(why) && stderr.contains("--force"), "{stderr}")
            }
            None => assert!(code == Some(0) && stdout.contains("published 1 message on"), "{stdout}{stderr}"),
        }
    };
    // Nobody is there.
    check(&["wheels/desired", "{}"], None);
    plays(&host, "listener");
    check(&["wheels/desired", "{}"], Some("`listener` obeys `wheels/desired`"));
    check(&["wheels/desired", "--raw", BYTES], Some("`listener` obeys `wheels/desired`"));
    check(&["plan/path", "{}"], None);
    plays(&host, "somebody");
    check(&["plan/path", "{}"], Some("`somebody` publishes `plan/path`"));
    check(&["plan/path", "--raw", BYTES], Some("`somebody` publishes `plan/path`"));
    check(&["wheels/desired", "--raw", "random", "--force"], None);
    // From outside.
    check(&["mission/order", "{}"], None);
    host.take_down().unwrap();
}

#[test]
fn waiting_is_said_and_has_an_end() {
    let name = name("wait");
    let host = host(&name);
    let check = |arguments: &[&str]| {
        let (code, _, stderr) = said(&name, arguments);
        assert_eq!(code, Some(3), "{arguments:?}: {stderr}");
        assert!(
            stderr.contains("waiting for a message on `plan/path` (`somebody` is not there)"),
            "{stderr}"
        );
    };
    check(&["echo", "plan/path", "-n", "1", "--timeout", "1.3"]);
    check(&["delay", "plan/path", "-n", "1", "--timeout", "1.3"]);
    // One of two is not enough.
    let mut tap = Tap::join(host.place().clone(), "test").unwrap();
    let publisher = tap.publisher("wheels/desired").unwrap();
    publisher.publish(&[0; 16]).unwrap();
    let child = tool(&name, &["echo", "wheels/desired", "-n", "2", "--timeout", "1"]);
    let mut child = Some(child);
    wait_for(|| {
        tap.wait(tap.bell(), Duration::from_millis(5));
        child.as_mut().unwrap().try_wait().unwrap().is_some()
    });
    let output = child.take().unwrap().wait_with_output().unwrap();
    assert_eq!(
        (output.status.code(), output.stdout.iter().filter(|&&byte| byte == b'\n').count()),
        (Some(3), 1)
    );
    drop((publisher, tap));
    host.take_down().unwrap();
}

#[test]
fn readers_end_with_the_board() {
    let name = name("ends");
    let host = host(&name);
    let commands: [&[&str]; 4] = [
        &["echo", "plan/path"],
        &["rate", "--interval", "3600"],
        &["delay", "plan/path"],
        &["publish", "mission/order", "{}", "--rate", "10"],
    ];
    let tools = commands.map(|arguments| begun(&mut command(&name, arguments)));
    let board = host.switchboard();
    let readers = |topic: u32| (0..128).filter(|&slot| board.topic(topic).unwrap().wakes(slot)).count();
    let published = || board.topic(2).unwrap().count.load(Ordering::Acquire) > 0;
    // The one that reads all topics comes to the last one at the end.
    wait_for(|| readers(1) == 3 && readers(3) == 1 && published());
    host.take_down().unwrap();
    for (tool, arguments) in tools.into_iter().zip(commands) {
        let output = tool.wait_with_output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && stderr.contains("went down"), "{arguments:?}: {stderr}");
    }
}

#[test]
fn a_text_on_the_board_gives_a_terminal_no_orders() {
    let name = name("escape");
    let host = host(&name);
    let mut tap = Tap::join(host.place().clone(), "test").unwrap();
    let text = serde_json::json!({ "room": "\u{1b}[2J\u{7}\u{202e}" });
    let bytes = tap.manifest().topic("mission/order").unwrap().1.message.from_json(&text).unwrap();
    let publisher = tap.publisher("mission/order").unwrap();
    publisher.publish(&bytes).unwrap();
    for arguments in
        [&["echo", "mission/order", "-n", "1"][..], &["echo", "mission/order", "--field", "room", "-n", "1"]]
    {
        let mut child = begun(&mut command(&name, arguments));
        wait_for(|| {
            tap.wait(tap.bell(), Duration::from_millis(5));
            child.try_wait().unwrap().is_some()
        });
        let output = child.wait_with_output().unwrap();
        let stdout = String::from_utf8(output.stdout).unwrap();
        assert!(stdout.contains("\\u{1b}[2J\\u{7}\\u{202e}"), "{stdout}");
        assert!(!stdout.contains(['\u{1b}', '\u{7}', '\u{202e}']), "{stdout:?}");
    }
    // Nor does a name that is no topic's.
    let (_, _, stderr) = said(&name, &["info", "\u{1b}[2J"]);
    assert!(stderr.contains("\\u{1b}[2J") && !stderr.contains('\u{1b}'), "{stderr:?}");
    drop((publisher, tap));
    host.take_down().unwrap();
}

#[test]
fn numbers_that_are_none_are_refused_alike() {
    let commands: [&[&str]; 8] = [
        &["list", "--sample"],
        &["echo", "x", "--timeout"],
        &["rate", "--interval"],
        &["delay", "x", "--interval"],
        &["delay", "x", "--timeout"],
        &["record", "-o", "x.mcap", "--duration"],
        &["publish", "x", "{}", "--rate"],
        &["replay", "x.mcap", "--speed"],
    ];
    for arguments in commands {
        for number in ["nan", "-nan", "inf", "-1", "0", "1e999", "", "x"] {
            let mut arguments = arguments.to_vec();
            let last = format!("{}={number}", arguments.pop().unwrap());
            arguments.push(&last);
            let (code, _, stderr) = said("nowhere", &arguments);
            assert_eq!(code, Some(2), "{arguments:?}: {stderr}");
        }
    }
}

#[test]
fn clean_cleans_what_it_is_told() {
    let forsaken = [name("one"), name("two")].map(|name| {
        let place = Place::new(&name).unwrap();
        place.create().unwrap();
        std::fs::write(place.file("remains"), "x").unwrap();
        place
    });
    for bad in ["../x", "", "A", "x/y", "a-name-that-is-far-too-long"] {
        let (code, _, stderr) = said(bad, &["clean"]);
        assert!(code == Some(1) && stderr.contains("cannot be a board's name"), "{bad:?}: {stderr}");
    }
    let (code, stdout, _) = said(forsaken[0].name(), &["clean"]);
    assert!(code == Some(0) && stdout.contains(forsaken[0].name()), "{stdout}");
    assert_eq!(forsaken.clone().map(|place| place.exists()), [false, true]);
    let (code, stdout, _) = said(forsaken[0].name(), &["clean"]);
    assert_eq!((code, stdout.as_str()), (Some(0), "nothing to clear away\n"));
    assert!(said(forsaken[1].name(), &["clean"]).1.contains("removed 1 file"));
    // What cleans up after the dead makes nothing where there is no board.
    assert_eq!(said("x", &["clean-dead", &name("none")]).0, Some(1));
    assert_eq!(Place::new(&name("none")).unwrap().shared_memory(), Vec::<std::path::PathBuf>::new());
}

#[test]
fn a_board_that_is_not_there_is_an_error() {
    for arguments in
        [&["doctor"][..], &["list"], &["echo", "x"], &["info", "x"], &["rate"], &["record", "-o", "x"]]
    {
        let (code, _, stderr) = said(&name("nosuch"), arguments);
        assert!(code == Some(1) && stderr.contains("there is no board"), "{arguments:?}: {stderr}");
    }
}

#[test]
fn a_closed_pipe_ends_quietly() {
    let name = name("pipe");
    let host = host(&name);
    let commands: [&[&str]; 7] = [
        &["completions", "bash"],
        &["--help"],
        &["echo", "--help"],
        &["list"],
        &["doctor"],
        &["info", "plan/path"],
        &["rate", "-n", "1", "--interval", "0.01"],
    ];
    for arguments in commands {
        let mut child = begun(&mut command(&name, arguments));
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert!(stderr.is_empty() && output.status.code() != Some(101), "{arguments:?}: {stderr}");
    }
    // Nor is anything lost with the standard error closed or full.
    for target in ["/dev/full", "/dev/null"] {
        let target = std::fs::OpenOptions::new().write(true).open(target).unwrap();
        let status =
            command(&name, &["echo", "nothing"]).stdout(Stdio::null()).stderr(target).status().unwrap();
        assert_eq!(status.code(), Some(1));
    }
    host.take_down().unwrap();
}

#[test]
fn a_page_full_of_nonsense_hangs_nobody() {
    let name = name("page");
    let host = host(&name);
    plays(&host, "somebody");
    for byte in [0x5a, 0xff] {
        let page = host.place().file("switchboard");
        let size = std::fs::metadata(&page).unwrap().len() as usize;
        let file = std::fs::OpenOptions::new().write(true).open(&page).unwrap();
        // Behind the page's mark, which alone would be refused.
        std::os::unix::fs::FileExt::write_all_at(&file, &vec![byte; size - 8], 8).unwrap();
        assert!(said(&name, &["list", "--sample", "0.01"]).1.contains("wheels/desired"));
        said(&name, &["list", "--services"]);
        said(&name, &["echo", "wheels/desired", "--timeout", "0.5"]);
        said(&name, &["rate", "-n", "1", "--interval", "0.01"]);
        let (code, stdout, _) = said(&name, &["doctor"]);
        assert!(code == Some(1) && stdout.contains("page is damaged"), "{stdout}");
        host.repair(&[]);
    }
    host.take_down().unwrap();
}

#[test]
fn a_recording_follows_the_board() {
    let name = name("follow");
    let mut host = host(&name);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let recorder = tool(&name, &["record", "-o", file.to_str().unwrap()]);
    wait_for(|| Recording::open(&file).is_ok());
    let added =
        Topic { name: "shadow/wheels".into(), ..host.manifest().topic("wheels/desired").unwrap().1.clone() };
    host.add_topics(vec![added]).unwrap();
    let mut tap = Tap::join(host.place().clone(), "test").unwrap();
    let publisher = tap.publisher("shadow/wheels").unwrap();
    wait_for(|| {
        publisher.publish(&[7; size_of::<WheelSpeeds>()]).unwrap();
        tap.wait(tap.bell(), Duration::from_millis(20));
        let recording = Recording::open(&file).unwrap();
        recording.as_recorded(|topic| topic.name == "shadow/wheels").next().is_some()
    });
    drop((publisher, tap));
    host.take_down().unwrap();
    assert_eq!(succeeds(recorder)["board_went_down"], true);
    let (code, stdout, _) = said("nowhere", &["info", file.to_str().unwrap()]);
    assert!(code == Some(0) && stdout.contains("shadow/wheels") && stdout.contains("complete"), "{stdout}");
    // Cut, it says so.
    let bytes = std::fs::read(&file).unwrap();
    std::fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
    let (_, stdout, _) = said("nowhere", &["info", file.to_str().unwrap()]);
    assert!(stdout.contains("cut: its recorder did not end in order"), "{stdout}");
}

#[test]
fn a_full_disk_is_said_at_once_with_what_is_kept() {
    let name = name("full");
    let host = host(&name);
    let folder = tempfile::tempdir().unwrap();
    let (small, kept) = (folder.path().join("small"), folder.path().join("kept.mcap"));
    std::fs::create_dir(&small).unwrap();
    let script = "mount -t tmpfs -o size=3m tmpfs \"$1\" || exit 77; \"$2\" --board \"$3\" record -o \"$1/run.mcap\"; \
                  code=$?; cp \"$1/run.mcap\" \"$4\"; exit $code";
    let mut recorder = Command::new("unshare");
    recorder
        .args(["-m", "sh", "-c", script, "sh"])
        .arg(&small)
        .arg(env!("CARGO_BIN_EXE_board"))
        .arg(&name)
        .arg(&kept);
    let Ok(mut child) = recorder.stdout(Stdio::null()).stderr(Stdio::piped()).spawn() else {
        println!("skipped: there is no unshare");
        return;
    };
    let mut tap = Tap::join(host.place().clone(), "test").unwrap();
    let publisher = tap.publisher("plan/path").unwrap();
    let mut noise = 1_u64;
    // Points that do not compress.
    wait_for(|| {
        let bytes: Vec<u8> = std::iter::repeat_with(|| {
            noise = noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (noise >> 56) as u8
        })
        .take(40 + 16 * 200)
        .collect();
        publisher.publish(&bytes).unwrap();
        tap.wait(tap.bell(), Duration::from_millis(2));
        child.try_wait().unwrap().is_some()
    });
    let output = child.wait_with_output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    if matches!(output.status.code(), Some(77)) || stderr.contains("unshare") {
        println!("skipped: no file system can be mounted here");
    } else {
        assert_eq!(output.status.code(), Some(1), "{stderr}");
        assert!(stderr.contains("No space left") && stderr.contains("are kept"), "{stderr}");
        let recording = Recording::open(&kept).unwrap();
        assert!(!recording.is_complete());
        let messages = recording.as_recorded(|_| true).map(Result::unwrap).count();
        assert!(
            messages > 10 && stderr.contains(&format!("its first {messages} messages")),
            "{messages}: {stderr}"
        );
    }
    drop((publisher, tap));
    host.take_down().unwrap();
}

#[test]
fn only_plain_files_are_overwritten() {
    let name = name("plain");
    let host = host(&name);
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("link");
    std::os::unix::fs::symlink("/dev/null", &link).unwrap();
    for target in ["/dev/full", "/dev/null", link.to_str().unwrap(), folder.path().to_str().unwrap()] {
        let (code, _, stderr) = said(&name, &["record", "-o", target, "--force", "--duration", "0.1"]);
        assert!(code == Some(1) && stderr.contains("no plain file"), "{target}: {stderr}");
        let found = std::fs::symlink_metadata(target).unwrap();
        assert!(!found.is_file(), "{target} was replaced");
    }
    host.take_down().unwrap();
}
