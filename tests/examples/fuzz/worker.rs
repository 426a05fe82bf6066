//! The process that reads the files, and what it says of each.

use crate::kinds::{Kind, Trial};
use crate::mutate::{Mutator, chance};
use board::clock;
use messages::Time;
use rand_pcg::Pcg64Mcg;
use rustix::process::{Resource, Rlimit, setrlimit};
use std::fmt::Write as _;
use std::io::Write as _;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Duration;

/// The most memory that a reader may ask for, in bytes.
pub(crate) const MEMORY_MAX: u64 = 1 << 30;
/// The most processor time that a file may take, in seconds.
pub(crate) const USED_MAX_S: u64 = 10;
/// The longest that a file may take on a busy machine.
pub(crate) const PASSED_MAX: Duration = Duration::from_secs(120);
/// The worker's exit code after a file that took too long.
pub(crate) const TOO_LONG: i32 = 3;

/// What became of one file.
#[derive(Debug)]
pub(crate) struct Report {
    /// Its number.
    pub(crate) number: u64,
    /// Whether it was read or refused; or what was too much.
    pub(crate) verdict: Result<bool, String>,
    /// Processor time.
    pub(crate) used: Duration,
    /// Time on the wall.
    pub(crate) passed: Duration,
    /// The most memory so far.
    pub(crate) peak_kib: u64,
}

impl Report {
    fn line(&self) -> String {
        let Self { number, used, passed, peak_kib, .. } = self;
        let mut line = format!("{number} {} {} {peak_kib} ", used.as_micros(), passed.as_micros());
        match &self.verdict {
            Ok(true) => line.push_str("read"),
            Ok(false) => line.push_str("refused"),
            Err(why) => {
                let _ = write!(line, "found {}", why.replace(['\n', '\r'], " "));
            }
        }
        line
    }

    /// What a line says.
    pub(crate) fn parse(line: &str) -> Option<Self> {
        let mut words = line.splitn(6, ' ');
        let mut number = || words.next()?.parse::<u64>().ok();
        let (number, used, passed, peak_kib) = (number()?, number()?, number()?, number()?);
        let verdict = match words.next()? {
            "read" => Ok(true),
            "refused" => Ok(false),
            _ => Err(words.next().unwrap_or_default().to_owned()),
        };
        let (used, passed) = (Duration::from_micros(used), Duration::from_micros(passed));
        Some(Self { number, verdict, used, passed, peak_kib })
    }
}

/// The damaged files of a kind.
#[derive(Debug)]
pub(crate) struct Files {
    mutator: Mutator,
    seed: u64,
}

impl Files {
    /// `scratch` is a folder for what belongs to valid files.
    pub(crate) fn new(kind: Kind, seed: u64, scratch: &Path) -> Self {
        Self { mutator: crate::seeds::of(kind, scratch), seed }
    }

    /// The file of this number, of which valid file it was made, and what else is left to chance.
    pub(crate) fn file(&self, number: u64) -> (Vec<u8>, usize, Pcg64Mcg) {
        let mut chance = chance(self.seed, number);
        let (bytes, of) = self.mutator.file(&mut chance);
        (bytes, of, chance)
    }
}

/// Since when which file is read.
static READING: Mutex<Option<(u64, Time, Duration)>> = Mutex::new(None);

/// Reads files, and says a line of each.
pub(crate) fn work(kind: Kind, seed: u64, numbers: Range<u64>) {
    let scratch = tempfile::tempdir().unwrap();
    let files = Files::new(kind, seed, scratch.path());
    if kind.is_read_here() {
        let limit = Rlimit { current: Some(MEMORY_MAX), maximum: Some(MEMORY_MAX) };
        setrlimit(Resource::Data, limit).unwrap();
    }
    std::panic::set_hook(Box::new(|_| {}));
    std::thread::spawn(watch);
    for number in numbers {
        let (bytes, of, mut chance) = files.file(number);
        let (begun, before) = (clock::monotonic(), used());
        *READING.lock().unwrap() = Some((number, begun, before));
        let trial = Trial { folder: scratch.path(), bytes: &bytes, of };
        let verdict =
            std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| kind.read(&trial, &mut chance)))
                .unwrap_or_else(|panic| Err(format!("panics: {}", panic_words(panic.as_ref()))));
        *READING.lock().unwrap() = None;
        let (used, passed) = (used().saturating_sub(before), clock::monotonic().since(begun));
        say(&Report { number, verdict, used, passed, peak_kib: peak_kib(kind) });
    }
}

/// Ends the process when a file takes too long.
fn watch() {
    loop {
        clock::sleep(Duration::from_millis(100));
        let reading = *READING.lock().unwrap();
        let Some((number, begun, before)) = reading else { continue };
        let (used, passed) = (used().saturating_sub(before), clock::monotonic().since(begun));
        if used > Duration::from_secs(USED_MAX_S) || passed > PASSED_MAX + Duration::from_secs(10) {
            let verdict = Err("takes too long".to_owned());
            say(&Report { number, verdict, used, passed, peak_kib: 0 });
            std::process::exit(TOO_LONG);
        }
    }
}

fn say(report: &Report) {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{}", report.line()).and_then(|()| out.flush()).unwrap();
}

fn panic_words(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("without words").to_owned()
}

/// Processor time of this process.
fn used() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}

fn peak_kib(kind: Kind) -> u64 {
    if !kind.is_read_here() {
        return 0;
    }
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().strip_suffix("kB")?.trim().parse().ok()).unwrap_or(0)
}

/// The folder of the release build that this program is part of.
pub(crate) fn binaries() -> PathBuf {
    std::env::current_exe().unwrap().ancestors().nth(2).unwrap().to_owned()
}
