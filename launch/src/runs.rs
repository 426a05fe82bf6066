//! What stays of a run when it is over: its logs and its end, in a folder of its own on disk, until newer runs take its place.
//!
//! `~/.local/state/corkboard/runs/BOARD/DATE-TIME-PID/` (or below `$XDG_STATE_HOME`), for its owner alone: a log a service, `launch.log` with what happened, and
//! `run.json`.

use board::clock;
use serde::{Deserialize, Serialize};
use std::fs::{self, DirBuilder, OpenOptions};
use std::io::{self, Write as _};
use std::os::unix::fs::{DirBuilderExt as _, MetadataExt as _, OpenOptionsExt as _};
use std::path::{Path, PathBuf};
use std::time::Duration;

const RECORD: &str = "run.json";
/// Runs of a board that are kept.
const KEPT: usize = 10;

/// What a run was and came to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Record {
    /// The board.
    pub(crate) board: String,
    /// The graph's file.
    pub(crate) graph: String,
    /// The command line that started it.
    pub(crate) command: Vec<String>,
    /// From which all randomness came.
    pub(crate) seed: u64,
    /// `live` or `lockstep`.
    pub(crate) mode: String,
    /// Seconds since 1970.
    pub(crate) began_unix_s: f64,
    /// The launcher's process.
    pub(crate) launcher_pid: u32,
    /// How it ended; `None` while it runs, and when the launcher was killed.
    pub(crate) end: Option<Ended>,
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Ended {
    /// Seconds since 1970.
    pub(crate) at_unix_s: f64,
    /// In words: who or what ended it.
    pub(crate) why: String,
    /// The exit code.
    pub(crate) code: u8,
    /// The last lines, as they were printed.
    pub(crate) summary: String,
    /// The judge's figures and verdict, where there was a judge.
    pub(crate) run: serde_json::Value,
}

/// The folder of one run.
#[derive(Debug, Clone)]
pub(crate) struct RunFolder {
    path: PathBuf,
}

impl RunFolder {
    /// Makes the folder of a run that begins: the one that was asked for, or a new one among those of the board, of which the oldest go.
    ///
    /// # Errors
    /// When it cannot be made: with the path.
    pub(crate) fn make(asked: Option<&Path>, board: &str) -> io::Result<Self> {
        if let Some(path) = asked {
            private_folder(path).map_err(|error| named(path, &error))?;
            return Ok(Self { path: path.to_owned() });
        }
        let Some(all) = folder_of(board) else {
            return Err(io::Error::other(
                "neither XDG_STATE_HOME nor HOME names a folder for the logs; name one with --log-dir",
            ));
        };
        let path = all.join(format!("{}-{}", date_time(clock::since_1970()), std::process::id()));
        private_folder(&path).map_err(|error| named(&path, &error))?;
        forget_old(&all, &path);
        Ok(Self { path })
    }

    /// Where it is.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Writes what the run is, whole or not at all.
    ///
    /// # Errors
    /// When it cannot be written.
    pub(crate) fn write(&self, record: &Record) -> io::Result<()> {
        let beside = self.path.join(format!("{RECORD}.new"));
        let mut file = create_private(&beside)?;
        file.write_all(&serde_json::to_vec_pretty(record)?)?;
        fs::rename(&beside, self.path.join(RECORD))
    }
}

impl Record {
    /// A run that begins now.
    pub(crate) fn begin(board: &str, graph: &Path, seed: u64, is_lockstep: bool) -> Self {
        Self {
            board: board.to_owned(),
            graph: std::path::absolute(graph).unwrap_or_else(|_| graph.to_owned()).display().to_string(),
            command: std::env::args().collect(),
            seed,
            mode: if is_lockstep { "lockstep" } else { "live" }.to_owned(),
            // To the millisecond: more digits do not survive as text in every case.
            began_unix_s: (unix_s() * 1e3).round() / 1e3,
            launcher_pid: std::process::id(),
            end: None,
        }
    }
}

/// The newest run of a board, or of any board: its folder and what it was.
pub(crate) fn newest(board: Option<&str>) -> Option<(PathBuf, Record)> {
    let folders = match board {
        Some(board) => vec![folder_of(board)?],
        None => subfolders(&state_folder()?.join("runs")),
    };
    let runs = folders.iter().flat_map(|folder| subfolders(folder));
    let runs = runs.filter_map(|folder| {
        let text = fs::read(folder.join(RECORD)).ok()?;
        Some((folder, serde_json::from_slice::<Record>(&text).ok()?))
    });
    runs.max_by(|(_, a), (_, b)| a.began_unix_s.total_cmp(&b.began_unix_s))
}

/// Seconds since 1970.
pub(crate) fn unix_s() -> f64 {
    clock::since_1970().as_secs_f64()
}

/// A moment as people write it, in the zone of Greenwich.
pub(crate) fn shown_moment(unix_s: f64) -> String {
    let [year, month, day, hour, minute, second] =
        calendar(Duration::try_from_secs_f64(unix_s).unwrap_or_default());
    format!("{year:04}-{month:02}-{day:02} {hour:02}:{minute:02}:{second:02} UTC")
}

fn state_folder() -> Option<PathBuf> {
    let named = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let state = named("XDG_STATE_HOME").or_else(|| Some(named("HOME")?.join(".local/state")))?;
    Some(state.join("corkboard"))
}

fn folder_of(board: &str) -> Option<PathBuf> {
    Some(state_folder()?.join("runs").join(board))
}

fn subfolders(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let folders = entries.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir()));
    folders.map(|entry| entry.path()).collect()
}

/// A folder for its owner alone; one that exists must be this user's.
fn private_folder(path: &Path) -> io::Result<()> {
    DirBuilder::new().recursive(true).mode(0o700).create(path)?;
    let found = fs::metadata(path)?;
    let user = rustix::process::getuid().as_raw();
    if !found.is_dir() || found.uid() != user {
        return Err(io::Error::other(format!("it belongs to user {}", found.uid())));
    }
    Ok(())
}

/// A new file for its owner alone; what bore the name before goes, a link as a link.
fn create_private(path: &Path) -> io::Result<fs::File> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    OpenOptions::new().write(true).create_new(true).mode(0o600).open(path)
}

/// Removes the oldest runs of a board, but never this one, and nothing that is no run.
fn forget_old(all: &Path, present: &Path) {
    let mut runs: Vec<PathBuf> =
        subfolders(all).into_iter().filter(|run| run != present && run.join(RECORD).is_file()).collect();
    // Their names begin with the date.
    runs.sort();
    let too_many = (runs.len() + 1).saturating_sub(KEPT);
    for run in runs.into_iter().take(too_many) {
        let _ = fs::remove_dir_all(run);
    }
}

fn named(path: &Path, error: &io::Error) -> io::Error {
    io::Error::new(
        error.kind(),
        format!("the folder for the logs, {}: {error}; name another with --log-dir", path.display()),
    )
}

/// `20261130-124731`, in the zone of Greenwich.
fn date_time(time: Duration) -> String {
    let [year, month, day, hour, minute, second] = calendar(time);
    format!("{year:04}{month:02}{day:02}-{hour:02}{minute:02}{second:02}")
}

/// Year, month, day, hour, minute, second in the zone of Greenwich.
fn calendar(since_1970: Duration) -> [u64; 6] {
    let s = since_1970.as_secs();
    let (days, rest) = (s / 86_400, s % 86_400);
    // Days to a date of the Gregorian calendar, whose years begin in March for this purpose (Hinnant 2013, "chrono-compatible low-level date algorithms").
    let shifted = days + 719_468;
    let (era, day_of_era) = (shifted / 146_097, shifted % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * shifted_month + 2) / 5 + 1;
    let month = if shifted_month < 10 { shifted_month + 3 } else { shifted_month - 9 };
    let year = year_of_era + 400 * era + u64::from(month <= 2);
    [year, month, day, rest / 3600, rest / 60 % 60, rest % 60]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(unix_s: u64, expected: &str) {
        assert_eq!(date_time(Duration::from_secs(unix_s)), expected);
    }

    #[test]
    fn moments_are_dates() {
        check(0, "19700101-000000");
        check(951_782_399, "20000228-235959");
        check(951_782_400, "20000229-000000");
        check(1_796_042_851, "20261130-124731");
        check(4_107_542_400, "21000301-000000");
    }

    #[test]
    fn of_many_runs_the_newest_stay_and_what_is_no_run_too() {
        let folder = tempfile::tempdir().unwrap();
        let all = folder.path();
        for day in 10..30 {
            let run = all.join(format!("202611{day}-000000-1"));
            fs::create_dir(&run).unwrap();
            fs::write(run.join(RECORD), "{}").unwrap();
        }
        fs::create_dir(all.join("a-folder-of-mine")).unwrap();
        let present = all.join("20261130-000000-1");
        fs::create_dir(&present).unwrap();
        forget_old(all, &present);
        let mut left: Vec<String> = subfolders(all)
            .iter()
            .map(|path| path.file_name().unwrap().to_string_lossy().into_owned())
            .collect();
        left.sort();
        assert_eq!(left.len(), KEPT + 1);
        assert_eq!(left[0], "20261121-000000-1");
        assert!(left.contains(&"a-folder-of-mine".to_owned()));
    }

    #[test]
    fn a_record_is_written_whole_and_never_through_a_link() {
        let folder = tempfile::tempdir().unwrap();
        let victim = folder.path().join("victim");
        fs::write(&victim, "mine").unwrap();
        let run = RunFolder::make(Some(&folder.path().join("run")), "b").unwrap();
        std::os::unix::fs::symlink(&victim, run.path().join("run.json.new")).unwrap();
        let record = Record::begin("b", Path::new("g.toml"), 7, true);
        run.write(&record).unwrap();
        assert_eq!(fs::read_to_string(&victim).unwrap(), "mine");
        let read: Record = serde_json::from_slice(&fs::read(run.path().join(RECORD)).unwrap()).unwrap();
        assert_eq!(read, record);
        assert_eq!(fs::metadata(run.path().join(RECORD)).unwrap().mode() & 0o777, 0o600);
        assert_eq!(fs::metadata(run.path()).unwrap().mode() & 0o777, 0o700);
    }
}
