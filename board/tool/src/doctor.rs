//! `board doctor`: is this machine fit, and are its boards well?

use crate::connect::{self, Life, life};
use crate::{Common, Outcome, show};
use board::clock;
use board::host::orphans;
use board::host::{half_made, living_launcher, needed_bytes};
use board::manifest::Manifest;
use board::place::{Place, boards_folder, places};
use board::switchboard::{NO_SLOT, SlotState, Switchboard};
use rustix::process::{Resource, getrlimit, getuid};
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// A service that has not looked about for this long hangs, or starves.
const SILENT: Duration = Duration::from_secs(1);
const MIB: u64 = 1024 * 1024;

#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
enum Verdict {
    Ok,
    Warn,
    Problem,
}

#[derive(Debug, serde::Serialize)]
struct Finding {
    check: String,
    verdict: Verdict,
    found: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    advice: Option<String>,
}

fn ok(check: &str, found: impl Into<String>) -> Finding {
    Finding { check: check.into(), verdict: Verdict::Ok, found: found.into(), advice: None }
}

fn warn(check: &str, found: impl Into<String>, advice: impl Into<String>) -> Finding {
    Finding { check: check.into(), verdict: Verdict::Warn, found: found.into(), advice: Some(advice.into()) }
}

fn problem(check: &str, found: impl Into<String>, advice: impl Into<String>) -> Finding {
    Finding {
        check: check.into(),
        verdict: Verdict::Problem,
        found: found.into(),
        advice: Some(advice.into()),
    }
}

pub(crate) fn run(common: &Common) -> Outcome {
    let places = chosen(common)?;
    let mut findings = vec![shared_memory(), folder(), user(), logout()];
    findings.extend(limits());
    findings.extend(clocks());
    findings.extend(boards(&places));
    let problems = findings.iter().filter(|finding| finding.verdict == Verdict::Problem).count();
    if common.json {
        show::json(&serde_json::to_value(&findings)?)?;
    } else {
        print(&findings)?;
    }
    Ok(if problems > 0 { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// The boards that are looked at: the one that is named, which must be there, or all.
fn chosen(common: &Common) -> Result<Vec<Place>, Box<dyn std::error::Error>> {
    let Some(name) = &common.board else { return Ok(places()) };
    let place = Place::new(name)?;
    if place.exists() { Ok(vec![place]) } else { Err(connect::unknown(name, &places()).into()) }
}

fn print(findings: &[Finding]) -> std::io::Result<()> {
    let colours = show::colours();
    let width = findings.iter().map(|finding| finding.check.chars().count()).max().unwrap_or(0);
    for Finding { check, verdict, found, advice } in findings {
        let verdict = match verdict {
            Verdict::Ok => show::good(colours, "ok     "),
            Verdict::Warn => show::doubtful(colours, "warn   "),
            Verdict::Problem => show::bad(colours, "problem"),
        };
        let (check, found) = (show::harmless(check), show::harmless(found));
        show::line(&format!("{verdict}  {check:<width$}  {found}"))?;
        if let Some(advice) = advice {
            show::line(&format!("         {:<width$}  -> {}", "", show::harmless(advice)))?;
        }
    }
    Ok(())
}

fn shared_memory() -> Finding {
    const CHECK: &str = "shared memory";
    let Ok(found) = rustix::fs::statvfs("/dev/shm") else {
        return problem(CHECK, "/dev/shm is missing", "mount a tmpfs there: `mount -t tmpfs tmpfs /dev/shm`");
    };
    let mounts = std::fs::read_to_string("/proc/self/mounts").unwrap_or_default();
    let is_tmpfs = mounts.lines().any(|line| {
        let mut words = line.split(' ').skip(1);
        words.next() == Some("/dev/shm") && words.next() == Some("tmpfs")
    });
    let (size, free) = (found.f_blocks * found.f_frsize, found.f_bavail * found.f_frsize);
    let text = format!("/dev/shm has {} free of {}", show::bytes(free), show::bytes(size));
    let larger = "enlarge it: `mount -o remount,size=1G /dev/shm` (in a container: --shm-size=1g)";
    if found.f_flag.contains(rustix::fs::StatVfsMountFlags::RDONLY) {
        let mend = "no board can be made there: `mount -o remount,rw /dev/shm`";
        problem(CHECK, format!("{text}, and is mounted read-only"), mend)
    } else if found.f_files > 0 && found.f_favail < 1000 {
        let text = format!("{text}, and has room for {} more files", found.f_favail);
        problem(CHECK, text, "a board makes a few hundred: `mount -o remount,nr_inodes=100000 /dev/shm`")
    } else if free < 8 * MIB {
        problem(CHECK, text, format!("a robot takes a few MiB, and is refused without: {larger}"))
    } else if free < 32 * MIB {
        warn(CHECK, text, format!("enough for a small robot; {larger}"))
    } else if !is_tmpfs {
        warn(
            CHECK,
            format!("{text}, and is no tmpfs"),
            "on a disk, messages may wait for it; mount a tmpfs there",
        )
    } else if free < 256 * MIB {
        warn(CHECK, text, format!("images and maps need tens of MiB a topic; {larger}"))
    } else {
        ok(CHECK, text)
    }
}

fn folder() -> Finding {
    const CHECK: &str = "boards' folder";
    let folder = boards_folder();
    let Ok(found) = std::fs::symlink_metadata(&folder) else {
        return ok(CHECK, format!("{} is not there: no board is up", folder.display()));
    };
    let (mode, owner) = (found.mode() & 0o777, found.uid());
    if !found.is_dir() || owner != getuid().as_raw() {
        let text = format!("{} is no folder of this user (owner {owner})", folder.display());
        return problem(
            CHECK,
            text,
            "somebody else made it, and no board can start; have its owner or root remove it",
        );
    }
    if mode & 0o077 != 0 {
        let text = format!("{} has mode {mode:o}: others can look into it", folder.display());
        return warn(CHECK, text, format!("chmod 700 {}", folder.display()));
    }
    ok(CHECK, format!("{} belongs to this user alone", folder.display()))
}

fn user() -> Finding {
    const CHECK: &str = "user";
    let others: Vec<String> = std::fs::read_dir("/dev/shm")
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .filter(|name| name.starts_with("corkboard-") && *name != format!("corkboard-{}", getuid().as_raw()))
        .collect();
    let others = if others.is_empty() {
        String::new()
    } else {
        format!("; other users' boards: {}", others.join(", "))
    };
    if getuid().is_root() {
        let text = format!("running as root{others}");
        return warn(
            CHECK,
            text,
            "a board of root's locks every other user out; run the robot as a user of its own",
        );
    }
    ok(CHECK, format!("user {}{others}", getuid().as_raw()))
}

/// Whether what lies in shared memory stays when this user logs out.
fn logout() -> Finding {
    const CHECK: &str = "logout";
    match board::logout::removes_shared_memory() {
        None => ok(CHECK, "this user's shared memory stays at a logout"),
        Some(_) => warn(
            CHECK,
            "systemd removes this user's shared memory when the last session ends (RemoveIPC in logind.conf), and a robot that still \
             runs loses its board",
            "before `launch up --detach`: `loginctl enable-linger`",
        ),
    }
}

fn limits() -> Vec<Finding> {
    let soft = |resource| getrlimit(resource).current;
    let text = |limit: Option<u64>| limit.map_or("no limit".to_owned(), |limit| limit.to_string());
    let files = soft(Resource::Nofile);
    // What a process may ask for, it asks for by itself.
    let hard = getrlimit(Resource::Nofile).maximum;
    let found = format!("{} a process, {} when it asks", text(files), text(hard));
    let mend = "each port of a service opens a few; `ulimit -n 4096`, or LimitNOFILE=4096 in the unit";
    let mut findings = vec![match hard {
        Some(hard) if hard < 256 => problem("open files", found, mend),
        Some(hard) if hard < 1024 => warn("open files", found, mend),
        _ => ok("open files", found),
    }];
    // Root, and whoever has the capability, needs no limit raised.
    let capable = getuid().is_root() || has_capability(23);
    let priority = soft(Resource::Rtprio);
    findings.push(if capable || priority.is_none_or(|priority| priority >= 50) {
        ok("real-time priority", if capable { "allowed".to_owned() } else { format!("up to {}", text(priority)) })
    } else {
        warn(
            "real-time priority",
            format!("limited to {}", text(priority)),
            "only for graphs with `priority = { fifo = .. }`: a line `USER - rtprio 80` in /etc/security/limits.conf",
        )
    });
    let locked = soft(Resource::Memlock);
    findings.push(if getuid().is_root() || locked.is_none_or(|bytes| bytes >= 64 * MIB) {
        ok("locked memory", locked.map_or("no limit".to_owned(), show::bytes))
    } else {
        warn(
            "locked memory",
            format!("limited to {}", locked.map_or(String::new(), show::bytes)),
            "only where services lock their memory against swapping: `USER - memlock unlimited` in limits.conf",
        )
    });
    findings
}

fn has_capability(number: u32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let effective = status.lines().find_map(|line| line.strip_prefix("CapEff:"));
    effective
        .and_then(|digits| u64::from_str_radix(digits.trim(), 16).ok())
        .is_some_and(|set| set & (1 << number) != 0)
}

fn clocks() -> Vec<Finding> {
    let mut findings = Vec::new();
    let source = std::fs::read_to_string("/sys/devices/system/clocksource/clocksource0/current_clocksource");
    findings.push(match source.as_deref().map(str::trim) {
        Ok(source @ ("tsc" | "kvm-clock" | "hyperv_clocksource_tsc_page" | "arch_sys_counter")) => {
            ok("clock", source)
        }
        Ok(source) => warn(
            "clock",
            format!("{source}: each look at it is a system call"),
            "boot with `tsc=reliable` if the processor's counter is sound (`dmesg | grep -i tsc`)",
        ),
        Err(_) => ok("clock", "monotonic"),
    });
    // Two looks at the clock in a row must not go back, and be less than a scheduler's tick apart more often
    // than not.
    let gaps: Vec<u128> = (0..100)
        .map(|_| {
            let first = clock::monotonic();
            clock::monotonic().since(first).as_nanos()
        })
        .collect();
    let median = {
        let mut sorted = gaps;
        sorted.sort_unstable();
        sorted[sorted.len() / 2]
    };
    if median > 1000 {
        findings.push(warn(
            "clock's cost",
            format!("{median} ns a look"),
            "every message is stamped; a slow clock slows the board down",
        ));
    }
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let load = load.split(' ').next().and_then(|text| text.parse::<f64>().ok()).unwrap_or(0.0);
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    findings.push(if load > 2.0 * processors as f64 {
        warn(
            "load",
            format!("{load} on {processors} processors"),
            "services wait for their turn; end what else runs, or give the robot processors of its own (`cpu = [..]`)",
        )
    } else {
        ok("load", format!("{load} on {processors} processors"))
    });
    findings
}

fn boards(places: &[Place]) -> Vec<Finding> {
    let mut findings = Vec::new();
    for place in places {
        match living_launcher(place) {
            Err(error) => findings.push(problem(
                &format!("board {}", place.name()),
                error.to_string(),
                "nothing of it was touched",
            )),
            Ok(None) => findings.push(warn(
                &format!("board {}", place.name()),
                "its launcher is gone, and its remains are still here",
                "`board clean` ends its services and removes it",
            )),
            Ok(Some(pid)) => findings.extend(board(place, pid)),
        }
    }
    findings.push(match orphans() {
        Ok(orphans) if orphans.is_empty() => ok("leftovers", "no shared memory without a board"),
        Ok(orphans) => warn(
            "leftovers",
            format!("{} in /dev/shm belonging to no board", show::count(orphans.len(), "file")),
            "`board clean` removes them",
        ),
        Err(error) => problem("leftovers", error.to_string(), "nothing of them was touched"),
    });
    findings
}

fn board(place: &Place, launcher: u32) -> Vec<Finding> {
    let check = format!("board {}", place.name());
    let opened = Manifest::read(place).and_then(|manifest| {
        let switchboard = Switchboard::open(&place.file("switchboard"))?;
        Ok((manifest, switchboard))
    });
    let (manifest, switchboard) = match opened {
        Ok(opened) => opened,
        Err(error) => {
            return vec![problem(&check, error.to_string(), "restart it: `launch stop` and `launch up`")];
        }
    };
    let files = place.shared_memory();
    let bytes: u64 =
        files.iter().filter_map(|file| std::fs::metadata(file).ok()).map(|found| found.blocks() * 512).sum();
    let mut findings = vec![ok(
        &check,
        format!(
            "up (launcher {launcher}), {}, {} with {} in shared memory ({} is what its graph takes)",
            show::count(manifest.topics.len(), "topic"),
            show::count(files.len(), "file"),
            show::bytes(bytes),
            show::bytes(needed_bytes(&manifest))
        ),
    )];
    let half_made = half_made(place);
    if let Some(file) = half_made.first() {
        findings.push(warn(
            &check,
            format!(
                "{} half made by a process that died, such as {}",
                show::count(half_made.len(), "file"),
                name_of(file)
            ),
            "services may hang on them: `board clean`",
        ));
    }
    let dead_tools = switchboard.dead_tools().count();
    if dead_tools > 0 {
        findings.push(warn(
            &check,
            format!("{} killed, still holding ports", show::count(dead_tools, "tool")),
            "topics take only so many readers: `board clean`",
        ));
    }
    findings.extend(modes(&check, place, &files));
    findings.extend(page(&check, &manifest, &switchboard));
    findings.extend(services(&check, &manifest, &switchboard));
    findings
}

/// Files that others could read, or worse.
fn modes(check: &str, place: &Place, files: &[PathBuf]) -> Option<Finding> {
    let fixed =
        ["", "board.json", "switchboard", "launcher.lock", "control.sock"].map(|name| place.file(name));
    let is_open = |file: &&PathBuf| {
        let found = std::fs::symlink_metadata(file);
        found.is_ok_and(|found| found.mode() & 0o077 != 0 || found.uid() != getuid().as_raw())
    };
    let open: Vec<&PathBuf> = files.iter().chain(&fixed).filter(is_open).collect();
    let first = open.first()?;
    let found =
        format!("{} not its owner's alone, such as {}", show::count(open.len(), "file"), first.display());
    let mend = format!("whoever may write there can end the robot: `chmod go= {}`", first.display());
    Some(if files.contains(first) { problem(check, found, mend) } else { warn(check, found, mend) })
}

/// What cannot stand on a page that only sound processes have written to.
fn page(check: &str, manifest: &Manifest, switchboard: &Switchboard) -> Option<Finding> {
    const MEND: &str = "a broken process has written over it, and the launcher should have mended it: `launch stop`, `launch up`";
    let header = switchboard.header();
    if header.lockstep.load(Ordering::Acquire) > 1 {
        return Some(problem(check, "the page is damaged: it says no kind of time", MEND));
    }
    let given = header.generations.load(Ordering::Acquire);
    let is_damaged = |index: u32| {
        switchboard.topic(index).is_some_and(|topic| {
            let publisher = topic.publisher.load(Ordering::Acquire);
            topic.generation.load(Ordering::Acquire) > given
                || (publisher != NO_SLOT && switchboard.slot(publisher).is_none())
        })
    };
    let topics = (0_u32..).zip(&manifest.topics);
    let names: Vec<&str> =
        topics.filter(|&(index, _)| is_damaged(index)).map(|(_, topic)| topic.name.as_str()).collect();
    let first = names.first()?;
    let found = format!("the page is damaged for {}, such as `{first}`", show::count(names.len(), "topic"));
    Some(problem(check, found, MEND))
}

fn services(check: &str, manifest: &Manifest, switchboard: &Switchboard) -> Vec<Finding> {
    let mut findings = Vec::new();
    let now = clock::monotonic();
    let lockstep = switchboard.header().lockstep.load(Ordering::Relaxed) != 0;
    let mut seen = Vec::new();
    for (_, slot) in switchboard.taken().filter(|(_, slot)| slot.is_service.load(Ordering::Relaxed) != 0) {
        let (role, pid) = (slot.role(), slot.pid.load(Ordering::Relaxed));
        let silent = slot.silence(now).unwrap_or_default();
        let in_step = slot.in_step(now).unwrap_or_default();
        let restart = format!("`launch restart {role}`");
        match life(slot) {
            Life::Dead => findings.push(problem(
                check,
                format!("`{role}` (process {pid}) is dead, and nobody has cleaned up after it"),
                "its launcher should have; is it overloaded or stopped? `launch ps`",
            )),
            Life::Lives if in_step > SILENT => findings.push(problem(
                check,
                format!("`{role}` (process {pid}) has been in one step for {}", age(in_step)),
                restart,
            )),
            // In lockstep a service sleeps until it is its turn.
            Life::Lives if silent > SILENT && !lockstep => findings.push(problem(
                check,
                format!("`{role}` (process {pid}) has not looked about for {}", age(silent)),
                format!("it is stopped, or starves: `ps -o stat,ni,pcpu {pid}`; {restart}"),
            )),
            Life::Idle if slot.state() == SlotState::Starting => {
                findings.push(warn(
                    check,
                    format!("`{role}` (process {pid}) has not joined yet"),
                    "`launch logs`",
                ));
            }
            _ => {}
        }
        seen.push(role);
    }
    for missing in manifest.services.iter().filter(|name| !seen.contains(name)) {
        findings.push(warn(check, format!("`{missing}` is not there"), format!("`launch logs {missing}`")));
    }
    if findings.is_empty() && !seen.is_empty() {
        findings.push(ok(check, format!("{} taking steps", show::count(seen.len(), "service"))));
    }
    findings
}

fn age(duration: Duration) -> String {
    show::duration(duration.as_nanos() as f64)
}

fn name_of(file: &Path) -> String {
    file.file_name().unwrap_or_default().to_string_lossy().into_owned()
}
