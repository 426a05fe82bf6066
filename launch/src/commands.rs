//! What the other commands do beside a running graph.

use crate::cli::{AttachArgs, LastArgs, LogsArgs, OrderArgs, RestartArgs, StatusArgs, StopArgs};
use crate::console::{harmless, say, say_line, warn};
use crate::control::{self, Answer, Request, Status};
use crate::journal;
use crate::order;
use crate::runs;
use crate::view::{self, OnQuit};
use board::clock;
use board::host;
use board::place::Place;
use comfy_table::{Cell, CellAlignment, Table, presets};
use rustix::process::{Pid, Signal, kill_process};
use std::collections::BTreeMap;
use std::io::{IsTerminal as _, Read as _, Seek as _, SeekFrom};
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

type Outcome = Result<(), String>;

/// For so long a launcher may take to obey, before it is asked by a signal.
const OBEYS_WITHIN: Duration = Duration::from_millis(1000);
/// For so long a robot may take to stop in order.
const STOPS_WITHIN: Duration = Duration::from_secs(15);

/// Prints the outcome as every command does.
pub(crate) fn finish(outcome: Outcome) -> ExitCode {
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            warn(&format!("error: {error}"));
            ExitCode::FAILURE
        }
    }
}

/// Clears away boards whose launcher is gone, and says so: the one that is named, or else all of them.
pub(crate) fn sweep(board: Option<&str>) -> Outcome {
    let swept = host::sweep_named(board)
        .map_err(|error| format!("what is left of a board cannot be cleared away: {error}"))?;
    for board in swept {
        warn(&crate::summary::swept(&board));
    }
    Ok(())
}

/// `launch ps`.
pub(crate) fn ps(args: &StatusArgs) -> Outcome {
    sweep(args.running.board.as_deref())?;
    let status = status_of(&choose(args.running.board.as_deref())?)?;
    if args.json {
        say_line(&serde_json::to_string_pretty(&status).map_err(|error| error.to_string())?);
    } else {
        say(&format!("{}\n{}\n", heading(&status), table(&status).trim_fmt()));
    }
    Ok(())
}

/// `launch attach`, also called `top`: the view of `launch up` on a robot that runs already; elsewhere than on a terminal, a table a second.
pub(crate) fn attach(args: &AttachArgs) -> Outcome {
    sweep(args.running.board.as_deref())?;
    let place = choose(args.running.board.as_deref())?;
    let name = place.name().to_owned();
    if !args.json && !args.plain && view::can_show() {
        let ended = view::watch(&place, &OnQuit::Leave, &AtomicBool::new(false));
        match ended {
            Some(_) if host::living_launcher(&place).is_none() => {
                say_line(&format!("the board `{name}` is down"))
            }
            Some(why) => return Err(why),
            None => say_line(&format!("the robot goes on; `launch stop --board {name}` stops it")),
        }
        return Ok(());
    }
    if let Some(why) = view::why_not().filter(|_| !args.json && !args.plain) {
        warn(why);
    }
    loop {
        match status_of(&place) {
            Ok(status) if args.json => {
                say_line(&serde_json::to_string(&status).map_err(|error| error.to_string())?)
            }
            Ok(status) => {
                let events = status.events.iter().rev().take(8).rev();
                let events = events.map(|event| {
                    let role = if event.role.is_empty() { "launch" } else { &event.role };
                    format!("{:>9.3} {role:<20} {}\n", event.at_s, harmless(&event.text))
                });
                say(&format!(
                    "{}\n{}\n{}\n",
                    heading(&status),
                    table(&status).trim_fmt(),
                    events.collect::<String>()
                ));
            }
            Err(_) if host::living_launcher(&place).is_none() => {
                say_line(&format!("the board `{name}` is down"));
                return Ok(());
            }
            Err(error) => return Err(error),
        }
        clock::sleep(Duration::from_secs(1));
    }
}

/// Where the logs of a run lie, and whose there are.
struct Logs {
    folder: std::path::PathBuf,
    roles: Vec<String>,
    /// The board, while it is up.
    place: Option<Place>,
}

/// `launch logs`: of the robot that runs, or of the last run.
pub(crate) fn logs(args: &LogsArgs) -> Outcome {
    let logs = find_logs(args)?;
    let mut roles = logs.roles.clone();
    roles.push(journal::LAUNCHER.to_owned());
    if let Some(service) = &args.service {
        if !roles.contains(service) {
            return Err(format!("there is no log of `{service}`; there are {}", roles.join(", ")));
        }
        roles = vec![service.clone()];
    }
    let prefixed = roles.len() > 1;
    let mut positions: BTreeMap<String, u64> = BTreeMap::new();
    let mut silent = Vec::new();
    for role in &roles {
        let lines = journal::last_lines(&logs.folder, role, args.lines);
        lines.iter().for_each(|line| print_line(prefixed, role, line));
        if lines.is_empty() {
            silent.push(role.as_str());
        }
        let length = std::fs::metadata(journal::log_file(&logs.folder, role)).map_or(0, |found| found.len());
        positions.insert(role.clone(), length);
    }
    if !silent.is_empty() && args.lines > 0 {
        let (said, level) = (silent.join(", "), "log = \"debug\" below [SERVICE.launch]");
        warn(&format!(
            "nothing was said by {said} (at the level `info` where the graph says no other; {level} tells more)"
        ));
    }
    let Some(place) = logs.place.filter(|_| args.follow) else { return Ok(()) };
    while host::living_launcher(&place).is_some() {
        for role in &roles {
            let from = positions.entry(role.clone()).or_default();
            let more = read_from(&journal::log_file(&logs.folder, role), from);
            more.lines().for_each(|line| print_line(prefixed, role, line));
        }
        clock::sleep(Duration::from_millis(100));
    }
    warn(&format!("the board `{}` is down", place.name()));
    Ok(())
}

fn find_logs(args: &LogsArgs) -> Result<Logs, String> {
    let board = args.running.board.as_deref();
    if !args.last {
        sweep(board)?;
        let running = control::running();
        let is_up = board.is_none_or(|board| running.iter().any(|place| place.name() == board));
        if is_up && !running.is_empty() {
            let place = choose(board)?;
            let status = status_of(&place)?;
            let roles = status.services.iter().map(|service| service.role.clone()).collect();
            return Ok(Logs { folder: status.logs.into(), roles, place: Some(place) });
        }
    }
    let (folder, run) = runs::newest(board).ok_or_else(|| match board {
        Some(board) => format!("no board `{board}` is up, and no run of it is on record"),
        None => "no board is up, and no run is on record; start one with `launch up coffee`".to_owned(),
    })?;
    warn(&format!("the run of `{}` that began {}:", run.board, runs::shown_moment(run.began_unix_s)));
    let mut roles: Vec<String> = std::fs::read_dir(&folder)
        .into_iter()
        .flatten()
        .flatten()
        .filter_map(|entry| entry.file_name().to_str()?.strip_suffix(".log").map(str::to_owned))
        .filter(|role| role != journal::LAUNCHER)
        .collect();
    roles.sort();
    Ok(Logs { folder, roles, place: None })
}

/// `launch last`: how the last run ended.
pub(crate) fn last(args: &LastArgs) -> Outcome {
    let board = args.running.board.as_deref();
    let (folder, run) = runs::newest(board).ok_or_else(|| match board {
        Some(board) => format!("no run of `{board}` is on record"),
        None => "no run is on record; they are kept from `launch up` on".to_owned(),
    })?;
    if args.json {
        let value = serde_json::json!({"folder": folder, "run": run});
        say_line(&serde_json::to_string_pretty(&value).map_err(|error| error.to_string())?);
        return Ok(());
    }
    let began = runs::shown_moment(run.began_unix_s);
    let mut text = format!(
        "board {}  graph {}  seed {}  {}\n",
        run.board,
        crate::graph::shown(Path::new(&run.graph)),
        run.seed,
        run.mode
    );
    match &run.end {
        Some(end) => {
            let took_s = (end.at_unix_s - run.began_unix_s).max(0.0);
            text += &format!(
                "began {began}, ended after {took_s:.1} s: {}; exit code {}\n",
                harmless(&end.why),
                end.code
            );
            text += &end.summary.lines().map(|line| harmless(line) + "\n").collect::<String>();
        }
        None if board::switchboard::process_lives(run.launcher_pid) => {
            text += &format!("began {began}, and goes on (launcher {})\n", run.launcher_pid);
        }
        None => text += &format!("began {began}; its launcher was killed before it could say how it ended\n"),
    }
    text += &format!("logs in {} (`launch logs --last`)\n", folder.display());
    say(&text);
    Ok(())
}

/// `launch restart`.
pub(crate) fn restart(args: &RestartArgs) -> Outcome {
    sweep(args.running.board.as_deref())?;
    let place = choose(args.running.board.as_deref())?;
    control::ask(&place, &Request::Restart { role: args.service.clone() })?;
    say_line(&format!("`{}` is being restarted", args.service));
    Ok(())
}

/// `launch stop`: comes back when nothing is left. A launcher that does not answer is asked by a signal, woken if it stands still, and killed at last: its services
/// stop the robot when it dies.
pub(crate) fn stop(args: &StopArgs) -> Outcome {
    sweep(args.running.board.as_deref())?;
    let place = choose(args.running.board.as_deref())?;
    let name = place.name().to_owned();
    let Some(pid) = host::living_launcher(&place) else { return Ok(()) };
    let send = |signal| {
        // Only to the launcher that holds the board, which may have gone meanwhile.
        if host::living_launcher(&place) == Some(pid)
            && let Some(process) = i32::try_from(pid).ok().and_then(Pid::from_raw)
        {
            let _ = kill_process(process, signal);
        }
    };
    let asked = if control::is_suspended(pid) {
        Err(String::new())
    } else {
        control::ask_within(&place, &Request::Stop { fast: args.fast }, OBEYS_WITHIN).map(|_| ())
    };
    if let Err(why) = asked {
        if !why.is_empty() {
            warn(&format!("{why}; asking it by a signal"));
        }
        send(Signal::CONT);
        send(Signal::TERM);
    }
    let began = clock::monotonic();
    let mut hurried = false;
    while host::living_launcher(&place).is_some() {
        let waited = clock::monotonic().since(began);
        if waited > STOPS_WITHIN {
            warn(&format!(
                "the launcher of `{name}` (process {pid}) does not end; killing it, which stops the robot"
            ));
            send(Signal::KILL);
            clock::sleep(Duration::from_millis(500));
            break;
        }
        if waited > STOPS_WITHIN / 2 && !std::mem::replace(&mut hurried, true) {
            send(Signal::CONT);
            send(Signal::TERM);
        }
        clock::sleep(Duration::from_millis(5));
    }
    // If it was killed while it stopped, something is left.
    sweep(Some(&name))?;
    if host::living_launcher(&place).is_some() {
        return Err(format!("the board `{name}` does not come down: process {pid} cannot be killed"));
    }
    say_line(&format!("the board `{name}` is down"));
    Ok(())
}

/// `launch order`.
pub(crate) fn order(args: &OrderArgs) -> Outcome {
    sweep(args.running.board.as_deref())?;
    let place = choose(args.running.board.as_deref())?;
    say_line(&order::order(place, &args.room)?);
    Ok(())
}

/// The board that is meant; where none is up, with what became of the last one.
fn choose(board: Option<&str>) -> Result<Place, String> {
    control::choose(board).map_err(|error| match runs::newest(board).map(|(_, run)| run) {
        Some(run) if control::running().is_empty() => {
            let end = run.end.map_or("its launcher was killed".to_owned(), |end| harmless(&end.why));
            format!("{error} (the last run, of `{}`: {end}; `launch last`)", run.board)
        }
        _ => error,
    })
}

/// How everything stands on a board.
pub(crate) fn status_of(place: &Place) -> Result<Status, String> {
    match control::ask(place, &Request::Status)? {
        Answer::Status(status) => Ok(*status),
        _ => Err("the launcher answers something else".to_owned()),
    }
}

fn heading(status: &Status) -> String {
    format!(
        "board {}  graph {}  up {:.0} s  launcher {}",
        status.board,
        crate::graph::shown(Path::new(&status.graph)),
        status.uptime_s,
        status.launcher_pid
    )
}

fn table(status: &Status) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    table.set_header(vec![
        "SERVICE",
        "BINARY",
        "STATE",
        "PID",
        "RESTARTS",
        "HZ",
        "CPU %",
        "MEM MiB",
        "STEP p50 us",
        "p99 us",
        "max us",
        "LATE",
        "LOST",
        "INVALID",
    ]);
    for service in &status.services {
        let numbers = [
            service.pid.map_or("-".to_owned(), |pid| pid.to_string()),
            service.restarts.to_string(),
            // Before the first second is over nothing is known.
            known(service.rate_hz, 1),
            known(service.cpu_percent, 1),
            known(service.memory_kib as f64 / 1024.0, 1),
            known(service.step_p50_us, 0),
            known(service.step_p99_us, 0),
            known(service.step_max_us, 0),
            service.late_steps.to_string(),
            service.lost_messages.to_string(),
            service.invalid_messages.to_string(),
        ];
        let words = [&service.role, &service.run, &service.state].map(Cell::new);
        let numbers = numbers.map(|number| Cell::new(number).set_alignment(CellAlignment::Right));
        table.add_row(words.into_iter().chain(numbers));
    }
    table
}

fn print_line(prefixed: bool, role: &str, line: &str) {
    // A terminal obeys control characters; a file keeps what was said.
    let line = if std::io::stdout().is_terminal() { harmless(line) } else { line.to_owned() };
    say_line(&if prefixed { format!("{role:<20} {line}") } else { line });
}

fn read_from(file: &Path, position: &mut u64) -> String {
    let Ok(mut file) = std::fs::File::open(file) else { return String::new() };
    let length = file.metadata().map_or(0, |found| found.len());
    // A file that has shrunk was begun anew.
    if length < *position {
        *position = 0;
    }
    let mut bytes = Vec::new();
    if file.seek(SeekFrom::Start(*position)).is_ok() && file.read_to_end(&mut bytes).is_ok() {
        *position += bytes.len() as u64;
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

fn known(value: f64, decimals: usize) -> String {
    if value > 0.0 { format!("{value:.decimals$}") } else { "-".to_owned() }
}
