//! `launch chaos`: kills, stops and restarts services of a live robot at random instants, and checks after each that the wheels stood in time, that the
//! set healed, that nothing was touched and that nothing is left behind.

mod plan;
mod report;
mod victims;
mod witness;

use crate::cli::ChaosArgs;
use crate::console::Console;
use crate::desk::{Desk, Face};
use crate::graph::{self, Checked};
use crate::monitor::Monitor;
use crate::record::Recording;
use crate::signals::Signals;
use crate::summary;
use crate::supervise::Supervisor;
use board::clock;
use board::tap::Tap;
use indicatif::{ProgressBar, ProgressStyle};
use messages::Time;
use plan::Plan;
use report::Report;
use rustix::event::{PollFd, PollFlags, poll};
use std::error::Error;
use std::io::IsTerminal as _;
use std::os::fd::AsFd as _;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use victims::Scene;

/// The set must be whole so long after the last deed.
const HEAL_LIMIT: Duration = Duration::from_secs(10);
/// For so long, all in all, deeds that are to stop the wheels wait for wheels that turn.
const DRIVES_WITHIN: Duration = Duration::from_secs(20);
/// Between two pictures of the progress.
const BAR_PERIOD: Duration = Duration::from_millis(100);
/// How often the board is looked at.
const LOOK: Duration = Duration::from_millis(2);

/// `launch chaos`.
pub(crate) fn command(args: &ChaosArgs) -> ExitCode {
    let Some(graph) = graph::prepare(&args.which.request(args.board.as_deref())) else {
        return ExitCode::FAILURE;
    };
    let console = Console::start();
    let code = match run(&graph, args, &console) {
        Ok(report) => {
            console.print(&if args.json { format!("{:#}\n", report.json()) } else { report.text() });
            if report.is_sound() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
        }
        Err(error) => {
            console.error(&format!("error: {error}"));
            ExitCode::FAILURE
        }
    };
    console.flush();
    code
}

fn run(graph: &Checked, args: &ChaosArgs, console: &Console) -> Result<Report, Box<dyn Error>> {
    for swept in board::host::sweep_named(args.board.as_deref())? {
        console.error(&summary::swept(&swept));
    }
    let signals = Signals::catch()?;
    let board = args.board.as_deref().unwrap_or(&graph.name);
    let mut supervisor = Supervisor::new(graph, board, args.log_dir.as_deref(), false)?;
    let place = supervisor.host.place().clone();
    let face = if args.events { Face::Lines } else { Face::Silence };
    let mut desk = Desk::new(graph, console.clone(), &signals, face);
    let begun = begin(graph, args, &mut supervisor, &mut desk);
    let (mut scene, monitor, recording) = match begun {
        Ok(begun) => begun,
        Err(error) => {
            supervisor.stop(&|| true)?;
            return Err(error);
        }
    };
    let mut report = {
        let mut stage = Stage { supervisor: &mut supervisor, scene: &mut scene, desk: &mut desk, monitor };
        let report = hurt(&mut stage, args, graph.seed);
        stage.desk.close(stage.supervisor, &stage.monitor, None);
        report
    };
    drop(scene);
    let recorded = recording.map_or(Ok(()), Recording::end);
    supervisor.stop(&|| signals.count() > 1)?;
    recorded?;
    report.left_behind = place.shared_memory().len() + usize::from(place.exists());
    Ok(report)
}

/// Waits until the services are ready, and joins those who look.
fn begin(
    graph: &Checked,
    args: &ChaosArgs,
    supervisor: &mut Supervisor,
    desk: &mut Desk<'_>,
) -> Result<(Scene, Monitor, Option<Recording>), Box<dyn Error>> {
    let place = supervisor.host.place().clone();
    desk.open(&place)?;
    let recording = args.record.as_deref();
    let recording = recording.map(|file| Recording::begin(&place, graph, file)).transpose()?;
    supervisor.start_all();
    while !supervisor.all_ready() {
        pause(supervisor, LOOK);
        if let Some(failed) = supervisor.failed() {
            let role = failed.service.role.clone();
            let lines = supervisor.telling_lines(&role, 8).join("\n  ");
            return Err(format!("`{role}` does not start:\n  {lines}").into());
        }
        if desk.signals.count() > 0 {
            return Err("interrupted".into());
        }
    }
    let monitor = Monitor::new(supervisor, None)?;
    let scene = Scene::new(graph, &args.spare, Tap::join(place, "chaos")?, graph.seed)?;
    Ok((scene, monitor, recording))
}

/// Everything that takes part.
struct Stage<'a, 'b> {
    supervisor: &'a mut Supervisor,
    scene: &'a mut Scene,
    desk: &'a mut Desk<'b>,
    monitor: Monitor,
}

/// Does what the plan says, and looks what becomes of it.
fn hurt(stage: &mut Stage<'_, '_>, args: &ChaosArgs, seed: u64) -> Report {
    let mut plan = Plan::new(seed, stage.scene.victims(), stage.scene.chain());
    let progress = Progress::begin(stage.desk.console.clone(), args.kills);
    let mut report = Report::new(seed, stage.scene.victim_roles(), stage.scene.chain_roles());
    let began = clock::monotonic();
    // The robot gets under way first.
    let mut due = began.after(Duration::from_secs(3));
    let mut deed = plan.next();
    let (mut waited, mut last) = (Duration::ZERO, began);
    while report.deeds < args.kills && stage.desk.signals.count() == 0 {
        stage.step(&mut report, &mut plan);
        if stage.supervisor.failed().is_some() || stage.supervisor.lost().is_some() {
            break;
        }
        let now = clock::monotonic();
        // A robot that never gets under way is hurt all the same, and proves nothing.
        let waits = deed.while_driving && !stage.scene.drives(now) && waited < DRIVES_WITHIN;
        if waits && now >= due {
            waited += now.since(last);
        }
        last = now;
        if now >= due && !waits && stage.scene.hit(stage.supervisor, &deed, now) {
            report.deed(&deed);
            deed = plan.next();
            due = now.after(deed.after);
            progress.show(&report);
        }
    }
    let end = clock::monotonic().after(HEAL_LIMIT);
    while (stage.scene.has_open_wounds() || !stage.supervisor.all_ready())
        && stage.supervisor.failed().is_none()
        && clock::monotonic() < end
    {
        stage.step(&mut report, &mut plan);
    }
    let Stage { supervisor, scene, desk, .. } = stage;
    for role in scene.give_up() {
        report.unhealed.push(role);
    }
    report.took_s = clock::monotonic().seconds_since(began);
    report.contacts = scene.contacts();
    report.contacts_at = scene.contacts_at();
    report.way_m = scene.way_m();
    report.deliveries = scene.deliveries();
    report.interrupted = desk.signals.count() > 0;
    let failed = supervisor.failed().map(|service| {
        let role = service.service.role.clone();
        format!("{role}: {}", supervisor.telling_lines(&role, 1).join(" "))
    });
    report.given_up = failed.or_else(|| supervisor.lost().map(str::to_owned));
    report
}

impl Stage<'_, '_> {
    fn step(&mut self, report: &mut Report, plan: &mut Plan) {
        pause(self.supervisor, LOOK);
        let now = clock::monotonic();
        self.scene.look(self.supervisor, now);
        self.scene.keep_it_busy(now);
        for verdict in self.scene.close_wounds(now) {
            if let Some(victim) = self.scene.shown_nothing(&verdict) {
                plan.prove_again(victim);
            }
            report.verdict(verdict);
        }
        self.monitor.update(self.supervisor);
        self.desk.serve(now, self.supervisor, &self.monitor, None, &mut None);
    }
}

/// Looks after the services, at once when one of them dies.
fn pause(supervisor: &mut Supervisor, length: Duration) {
    let length = length.min(supervisor.next_due(clock::monotonic()));
    let timeout = rustix::time::Timespec { tv_sec: 0, tv_nsec: i64::from(length.subsec_nanos()) };
    let mut descriptors: Vec<PollFd<'_>> =
        supervisor.descriptors().map(|fd| PollFd::from_borrowed_fd(fd.as_fd(), PollFlags::IN)).collect();
    let _ = poll(&mut descriptors, Some(&timeout));
    drop(descriptors);
    supervisor.tick();
}

/// A bar that is drawn by a thread of its own, since a terminal may stand still; elsewhere than on a terminal a line for each twentieth.
struct Progress {
    console: Console,
    total: u64,
    began: Time,
    state: Arc<Mutex<(u64, String)>>,
    done: Arc<AtomicBool>,
    has_bar: bool,
}

impl Progress {
    fn begin(console: Console, total: u64) -> Self {
        let state = Arc::new(Mutex::new((0, String::new())));
        let done = Arc::new(AtomicBool::new(false));
        let has_bar = std::io::stderr().is_terminal();
        if has_bar {
            let (state, done) = (Arc::clone(&state), Arc::clone(&done));
            let _ = std::thread::Builder::new()
                .name("progress".to_owned())
                .spawn(move || draw_bar(total, &state, &done));
        }
        Self { console, total, began: clock::monotonic(), state, done, has_bar }
    }

    fn show(&self, report: &Report) {
        let message = format!("{} wrong", report.wrong());
        if self.has_bar {
            *self.state.lock().unwrap_or_else(PoisonError::into_inner) = (report.deeds, message);
        } else if report.deeds.is_multiple_of(self.total.div_ceil(20).max(1)) {
            let took_s = clock::monotonic().seconds_since(self.began);
            self.console.error(&format!("[{took_s:>8.1}] {} of {}, {message}", report.deeds, self.total));
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.done.store(true, Ordering::Release);
        if self.has_bar {
            // For the last look of the thread; one that stands still is left to itself.
            clock::sleep(2 * BAR_PERIOD);
        }
    }
}

fn draw_bar(total: u64, state: &Mutex<(u64, String)>, done: &AtomicBool) {
    let bar = ProgressBar::new(total);
    if let Ok(style) = ProgressStyle::with_template("{bar:32} {pos} of {len}, {msg}, {eta} to go") {
        bar.set_style(style);
    }
    while !done.load(Ordering::Acquire) {
        let (position, message) = state.lock().unwrap_or_else(PoisonError::into_inner).clone();
        bar.set_message(message);
        bar.set_position(position);
        clock::sleep(BAR_PERIOD);
    }
    bar.finish_and_clear();
}
