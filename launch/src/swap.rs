//! `launch swap`: another service for a role of the running robot, or beside it as a shadow.

use crate::cli::SwapArgs;
use crate::commands::{status_of, sweep};
use crate::console::say_line;
use crate::control::{self, Request, Status};
use crate::graph;
use crate::shadow;
use crate::supervise::{SwapRequest, SwapState};
use board::clock;
use board::place::Place;
use std::time::Duration;

/// How long a newcomer may take, beyond its warm-up.
const LIMIT: Duration = Duration::from_secs(15);

/// `launch swap`.
pub(crate) fn command(args: &SwapArgs) -> Result<(), String> {
    sweep(args.running.board.as_deref())?;
    let place = control::choose(args.running.board.as_deref())?;
    if let Some(role) = &args.back {
        return back(args, &place, role);
    }
    let swap = args.swap.as_deref().unwrap_or_default();
    let (role, run) = swap
        .split_once('=')
        .filter(|(role, run)| !role.is_empty() && !run.is_empty())
        .ok_or_else(|| format!("`{swap}` is not ROLE=BINARY, such as planner=sampling-planner"))?;
    let request = checked(args, &status_of(&place)?, role, run)?;
    control::ask(&place, &Request::Swap(Box::new(request)))?;
    if args.shadow { shadow::watch(args, &place, role) } else { await_swap(args, &place, role) }
}

/// Checks the graph as it will be, with its errors on this terminal and not on the launcher's.
fn checked(args: &SwapArgs, status: &Status, role: &str, run: &str) -> Result<SwapRequest, String> {
    if !status.services.iter().any(|service| service.role == role) {
        let known: Vec<&str> = status.services.iter().map(|service| service.role.as_str()).collect();
        return Err(format!("there is no service `{role}`; there are {}", known.join(", ")));
    }
    let mut overrides = status.overrides.clone();
    overrides.swap.retain(|swap| swap.split_once('=').is_none_or(|(known, _)| known != role));
    overrides.swap.push(format!("{role}={run}"));
    overrides.set.extend(args.set.iter().map(|set| format!("{role}.{set}")));
    let request =
        graph::Request { graph: status.graph.clone(), overrides: overrides.clone(), build: !args.no_build };
    let checked = graph::prepare(&request)
        .ok_or("the graph with this newcomer is refused; the robot goes on as it was")?;
    let service = checked
        .services
        .into_iter()
        .find(|service| service.role == role)
        .ok_or_else(|| format!("the graph's file has no `{role}` any more"))?;
    let warm_up = Duration::from_secs_f64(args.warm_up.unwrap_or(0.0));
    Ok(SwapRequest { service, topics: checked.topics, overrides, shadow: args.shadow, warm_up })
}

fn back(args: &SwapArgs, place: &Place, role: &str) -> Result<(), String> {
    control::ask(place, &Request::SwapBack { role: role.to_owned() })?;
    match state_of(place, role)? {
        Some(_) => await_swap(args, place, role),
        None => {
            say_line(&format!("`{role}`: the newcomer was sent away"));
            Ok(())
        }
    }
}

/// Waits until the newcomer has taken over and has said something, or has failed.
fn await_swap(args: &SwapArgs, place: &Place, role: &str) -> Result<(), String> {
    let warm_up = Duration::from_secs_f64(args.warm_up.unwrap_or(0.0));
    let deadline = clock::monotonic().after(LIMIT + warm_up);
    loop {
        let state = state_of(place, role)?;
        let now = clock::monotonic();
        match &state {
            Some(SwapState::Failed { why }) => return Err(format!("{why}; `{role}` goes on as it was")),
            Some(SwapState::Done { run, took_ms, gap_ms }) => {
                if args.json {
                    let state = serde_json::to_string(&state).map_err(|error| error.to_string())?;
                    say_line(&state);
                } else {
                    say_line(&format!(
                        "`{role}` is played by `{run}` after {took_ms:.0} ms{}",
                        gap_in_words(*gap_ms)
                    ));
                }
                return Ok(());
            }
            Some(SwapState::WarmingUp { .. } | SwapState::Shadow { .. }) | None => {}
        }
        if now > deadline {
            let _ = control::ask(place, &Request::SwapBack { role: role.to_owned() });
            return Err(format!("the newcomer did not get ready; `{role}` goes on as it was"));
        }
        clock::sleep(Duration::from_millis(10));
    }
}

fn gap_in_words(gap_ms: Option<f64>) -> String {
    match gap_ms {
        Some(gap_ms) => {
            format!("; {gap_ms:.0} ms between the last message of the old and the first of the new one")
        }
        None => "; nothing was said meanwhile".to_owned(),
    }
}

fn state_of(place: &Place, role: &str) -> Result<Option<SwapState>, String> {
    let status = status_of(place)?;
    Ok(status.services.into_iter().find(|service| service.role == role).and_then(|service| service.swap))
}
