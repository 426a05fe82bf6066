//! What the other commands do beside a running graph.

use crate::cli::{LogsArgs, OrderArgs, RestartArgs, StatusArgs, StopArgs};
use crate::control::{self, Answer, Request, Status};
use board::clock;
use board::host;
use board::place::Place;
use board::tap::Tap;
use comfy_table::{Cell, CellAlignment, Table, presets};
use std::collections::BTreeMap;
use std::io::{IsTerminal as _, Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

type Outcome = Result<(), String>;

/// Prints the outcome as every command does.
pub(crate) fn finish(outcome: Outcome) -> ExitCode {
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Clears away boards whose launcher is gone, and says so: the one that is named, or else all of them.
pub(crate) fn sweep(board: Option<&str>) -> Outcome {
    let swept = host::sweep_named(board)
        .map_err(|error| format!("what is left of a board cannot be cleared away: {error}"))?;
    for board in swept {
        eprintln!("{}", crate::summary::swept(&board));
    }
    Ok(())
}

/// `launch ps`.
pub(crate) fn ps(args: &StatusArgs) -> Outcome {
    sweep(args.running.board.as_deref())?;
    let status = status_of(&control::choose(args.running.board.as_deref())?)?;
    if args.json {
        println!("{}", serde_json::to_string_pretty(&status).map_err(|error| error.to_string())?);
    } else {
        println!("{}", heading(&status));
        println!("{}", table(&status));
    }
    Ok(())
}

/// `launch top`: `ps`, again and again, until Ctrl-C or the graph's end.
pub(crate) fn top(args: &StatusArgs) -> Outcome {
    sweep(args.running.board.as_deref())?;
    let place = control::choose(args.running.board.as_deref())?;
    loop {
        let status = match status_of(&place) {
            Ok(status) => status,
            Err(_) if !control::is_up(&place)? => {
                println!("the board `{}` is down", place.name());
                return Ok(());
            }
            Err(error) => return Err(error),
        };
        if args.json {
            println!("{}", serde_json::to_string(&status).map_err(|error| error.to_string())?);
        } else {
            if std::io::stdout().is_terminal() {
                // Home, and clear what is below: no flicker.
                print!("\x1b[H\x1b[J");
            }
            println!("{}", heading(&status));
            println!("{}", table(&status));
            for event in status.events.iter().rev().take(8).rev() {
                println!("{:>9.3} {:<20} {}", event.at_s, event.role, event.text);
            }
        }
        clock::sleep(Duration::from_secs(1));
    }
}

/// `launch logs`.
pub(crate) fn logs(args: &LogsArgs) -> Outcome {
    sweep(args.running.board.as_deref())?;
    let place = control::choose(args.running.board.as_deref())?;
    let status = status_of(&place)?;
    if let Some(service) = &args.service
        && !status.services.iter().any(|known| known.role == *service)
    {
        let known: Vec<&str> = status.services.iter().map(|service| service.role.as_str()).collect();
        return Err(format!("there is no service `{service}`; there are {}", known.join(", ")));
    }
    let roles: Vec<String> = match &args.service {
        Some(service) => vec![service.clone()],
        None => status.services.iter().map(|service| service.role.clone()).collect(),
    };
    let prefixed = roles.len() > 1;
    let mut positions: BTreeMap<String, u64> = BTreeMap::new();
    for role in &roles {
        let file = log_file(&status, role);
        let text = String::from_utf8_lossy(&std::fs::read(&file).unwrap_or_default()).into_owned();
        let lines: Vec<&str> = text.lines().collect();
        for line in &lines[lines.len().saturating_sub(args.lines)..] {
            say(prefixed, role, line);
        }
        positions.insert(role.clone(), text.len() as u64);
    }
    while args.follow && control::is_up(&place)? {
        for role in &roles {
            let from = positions.entry(role.clone()).or_default();
            let more = read_from(&log_file(&status, role), from);
            more.lines().for_each(|line| say(prefixed, role, line));
        }
        clock::sleep(Duration::from_millis(100));
    }
    Ok(())
}

/// `launch restart`.
pub(crate) fn restart(args: &RestartArgs) -> Outcome {
    sweep(args.running.board.as_deref())?;
    let place = control::choose(args.running.board.as_deref())?;
    control::ask(&place, &Request::Restart { role: args.service.clone() })?;
    println!("`{}` is being restarted", args.service);
    Ok(())
}

/// `launch stop`: comes back when nothing is left.
pub(crate) fn stop(args: &StopArgs) -> Outcome {
    sweep(args.running.board.as_deref())?;
    let place = control::choose(args.running.board.as_deref())?;
    control::ask(&place, &Request::Stop { fast: args.fast })?;
    let deadline = clock::monotonic().after(Duration::from_secs(30));
    while control::is_up(&place)? {
        if clock::monotonic() > deadline {
            return Err(format!("the board `{}` does not come down", place.name()));
        }
        clock::sleep(Duration::from_millis(5));
    }
    // If it was killed while it stopped, something is left.
    sweep(args.running.board.as_deref())?;
    println!("the board `{}` is down", place.name());
    Ok(())
}

/// `launch order`.
pub(crate) fn order(args: &OrderArgs) -> Outcome {
    const ORDERS: &str = "mission/orders";
    sweep(args.running.board.as_deref())?;
    let place = control::choose(args.running.board.as_deref())?;
    let mut tap = Tap::join(place, "order").map_err(|error| error.to_string())?;
    let Some((_, topic)) = tap.manifest().topic(ORDERS) else {
        return Err(format!("this graph takes no orders: it has no topic `{ORDERS}`"));
    };
    let order = serde_json::json!({"room": args.room});
    let bytes = topic.message.from_json(&order).map_err(|error| error.to_string())?;
    let publisher = tap.publisher(ORDERS).map_err(|error| error.to_string())?;
    publisher.publish(&bytes).map_err(|error| error.to_string())?;
    // The message lives as long as its publisher; give its readers time to take it.
    clock::sleep(Duration::from_millis(300));
    println!("ordered: coffee for room {}", args.room);
    Ok(())
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
        "MEM KiB",
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
            format!("{:.1}", service.rate_hz),
            format!("{:.1}", service.cpu_percent),
            service.memory_kib.to_string(),
            format!("{:.0}", service.step_p50_us),
            format!("{:.0}", service.step_p99_us),
            format!("{:.0}", service.step_max_us),
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

fn log_file(status: &Status, role: &str) -> PathBuf {
    Path::new(&status.logs).join(format!("{role}.log"))
}

fn say(prefixed: bool, role: &str, line: &str) {
    if prefixed { println!("{role:<20} {line}") } else { println!("{line}") }
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
