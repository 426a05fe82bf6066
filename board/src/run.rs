//! The shell around every service: its command line, its place on the board, and its loop.

use crate::clock;
use crate::example;
use crate::health::StepTimes;
use crate::host;
use crate::interface::{About, Interface};
use crate::lack::Lack;
use crate::node::{Declared, JoinError, Joined, Node};
use crate::place::Place;
use crate::port::{PublisherLink, bytes_of, release_held};
use crate::shared::Shared;
use crate::switchboard::{self, Slot, SlotState};
use crate::{terminal, transport};
use clap::{Arg, ArgAction, ArgMatches, Command, value_parser};
use messages::{Health, Message as _, Parameters, ServiceState, Time};
use std::error::Error;
use std::io::{self, IsTerminal as _, Write as _};
use std::process::ExitCode;
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// What goes wrong before the first step.
pub type SetupError = Box<dyn Error + Send + Sync>;
type Step = Box<dyn FnMut(Time)>;

/// A service ends with this code when its set-up is wrong: starting it again would not help.
pub const EXIT_SETUP: u8 = 2;
/// A service ends with this code when the board had no room for it: another time it may have.
const EXIT_FAILED: u8 = 1;
/// Longest sleep: how often a waiting process shows that it lives.
const HEARTBEAT: Duration = Duration::from_millis(100);
const HEALTH_PERIOD: Duration = Duration::from_secs(1);

/// Runs a service: reads its command line, joins its board, lets `setup` declare ports and build the step, and takes steps until
/// it is asked to leave.
///
/// `setup` is also run without a board and with default parameters, to answer `--interface`, up to
/// [`Node::declared`]; it must have no effect before its first step.
pub fn run<P, S>(about: About, setup: impl Fn(&mut Node, P) -> Result<S, SetupError>) -> ExitCode
where
    P: Parameters,
    S: FnMut(Time) + 'static,
{
    let make = |node: &mut Node, values: serde_json::Value| -> Result<Step, SetupError> {
        let params: P = serde_json::from_value(values).map_err(|error| format!("parameters: {error}"))?;
        params.check()?;
        Ok(Box::new(setup(node, params)?))
    };
    let defaults = serde_json::to_value(P::default()).unwrap_or_default();
    let schema = serde_json::to_value(schemars::schema_for!(P)).unwrap_or_default();
    run_with(about, &schema, &defaults, &make)
}

fn run_with(
    about: About,
    schema: &serde_json::Value,
    defaults: &serde_json::Value,
    make: &dyn Fn(&mut Node, serde_json::Value) -> Result<Step, SetupError>,
) -> ExitCode {
    let arguments = command(about).get_matches();
    if arguments.get_flag("example") {
        say(&example::table(about, schema, defaults));
        return ExitCode::SUCCESS;
    }
    let result = if arguments.get_flag("interface") {
        describe(about, schema, defaults, &arguments, make)
    } else {
        serve(about, &arguments, make)
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // Where nobody listens any more, or the disk is full, the exit code must do.
            let _ = writeln!(Log, "error: {error}");
            ExitCode::from(if passes_by(&*error) { EXIT_FAILED } else { EXIT_SETUP })
        }
    }
}

/// Whether an error is the board's and not the set-up's, so that another start may help: a page that was
/// written over is mended by the launcher.
fn passes_by(error: &(dyn Error + Send + Sync + 'static)) -> bool {
    matches!(
        error.downcast_ref(),
        Some(JoinError::Transport(_) | JoinError::Full { .. } | JoinError::Unreadable { .. })
    )
}

/// Prints an answer; whoever closes the pipe has read enough.
fn say(text: &str) {
    let _ = io::stdout().write_all(text.as_bytes()).and_then(|()| io::stdout().flush());
}

/// The standard error. A log that cannot be written is no reason to die, and what a service logs may come
/// from a message: a terminal is not to obey it.
struct Log;

impl io::Write for Log {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut stderr = io::stderr();
        let _ = if stderr.is_terminal() {
            let text = String::from_utf8_lossy(bytes);
            text.split_inclusive('\n').try_for_each(|line| {
                let (line, end) = line.strip_suffix('\n').map_or((line, ""), |line| (line, "\n"));
                write!(stderr, "{}{end}", terminal::harmless(line))
            })
        } else {
            stderr.write_all(bytes)
        };
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn command(about: About) -> Command {
    let text = |name: &'static str, value: &'static str, help: &'static str| {
        Arg::new(name).long(name).value_name(value).help(help)
    };
    Command::new(about.name)
        .version(about.version)
        .about(about.description)
        .after_help("A service is started by the launcher: `launch up GRAPH`. By hand it joins a board that is up already.")
        .arg(text("board", "NAME", "Join this board").default_value("corkboard"))
        .arg(text("role", "ROLE", "The service's name in the graph [default: the binary's name]"))
        .arg(text("params", "JSON", "Parameters, as a JSON object; see --example").default_value("{}"))
        .arg(text("slot", "N", "The place that the launcher has prepared").value_parser(value_parser!(u32)).hide(true))
        .arg(
            Arg::new("shadow")
                .long("shadow")
                .action(ArgAction::SetTrue)
                .hide(true)
                .help("Publish beside the topics of the role, to be compared"),
        )
        .arg(text("compute-ns", "N", "In lockstep: how long a step takes").value_parser(value_parser!(u64)).hide(true))
        .arg(text("cpu", "N", "Run on this processor only").value_parser(value_parser!(usize)).action(ArgAction::Append))
        .arg(text("fifo", "PRIORITY", "Real-time priority, 1 to 99").value_parser(value_parser!(i32).range(1..=99)))
        .arg(
            text("nice", "NICE", "Nice value, -20 to 19")
                .value_parser(value_parser!(i32).range(-20..=19))
                .allow_hyphen_values(true),
        )
        .arg(
            Arg::new("interface")
                .long("interface")
                .action(ArgAction::SetTrue)
                .help("Print ports, message types and parameters as JSON, and leave"),
        )
        .arg(
            Arg::new("example")
                .long("example")
                .action(ArgAction::SetTrue)
                .help("Print a commented table for a graph file, and leave"),
        )
}

fn parameters(arguments: &ArgMatches) -> Result<serde_json::Value, SetupError> {
    let text = arguments.get_one::<String>("params").map_or("{}", String::as_str);
    serde_json::from_str(text).map_err(|error| format!("--params: {error}").into())
}

fn describe(
    about: About,
    schema: &serde_json::Value,
    defaults: &serde_json::Value,
    arguments: &ArgMatches,
    make: &dyn Fn(&mut Node, serde_json::Value) -> Result<Step, SetupError>,
) -> Result<(), SetupError> {
    let mut node = Node::describing(about.name);
    match make(&mut node, parameters(arguments)?) {
        Ok(step) => drop(step),
        // Its ports are all declared; the rest would only take time.
        Err(error) if error.is::<Declared>() => {}
        Err(error) => return Err(error),
    }
    let interface = Interface {
        service: about.name.to_owned(),
        version: about.version.to_owned(),
        description: about.description.to_owned(),
        ports: node.ports,
        period_ns: node.period.map(|period| u64::try_from(period.as_nanos()).unwrap_or(u64::MAX)),
        parameters: schema.clone(),
        defaults: defaults.clone(),
    };
    say(&format!("{}\n", serde_json::to_string(&interface)?));
    Ok(())
}

fn serve(
    about: About,
    arguments: &ArgMatches,
    make: &dyn Fn(&mut Node, serde_json::Value) -> Result<Step, SetupError>,
) -> Result<(), SetupError> {
    start_logging();
    let board = arguments.get_one::<String>("board").map_or("corkboard", String::as_str);
    let role = arguments.get_one::<String>("role").map_or(about.name, String::as_str).to_owned();
    let prepared = arguments.get_one::<u32>("slot").copied();
    let joined = Joined::join(Place::new(board)?, &role, prepared)?;
    if prepared.is_some() {
        die_with_launcher(joined.manifest.launcher_pid)?;
    }
    apply_scheduling(arguments)?;
    let shared = Rc::clone(&joined.shared);
    catch_signals(&shared)?;
    let is_shadow = arguments.get_flag("shadow");
    let mut node = Node::joined(&role, joined, is_shadow);
    let step = make(&mut node, parameters(arguments)?)?;
    let Some(mut joined) = node.joined.take() else { return Ok(()) };
    tracing::info!(
        "{} {} begins as `{role}`{}",
        about.name,
        about.version,
        if is_shadow { ", mute" } else { "" }
    );
    let name = if is_shadow { host::shadow_role(&role) } else { role };
    let health = open_health(&mut joined, &name)?;
    let mut service = Service {
        shared: Rc::clone(&shared),
        wakes: node.wakes.iter().map(|&topic| (topic, 0)).collect(),
        period: node.period,
        step,
        publishers: joined.publishers.clone(),
        topology: 0,
        awaited: Vec::new(),
        times: StepTimes::default(),
        steps: 0,
        late_steps: 0,
        unconnected: transport::unconnected(),
        health,
    };
    shared.computes.set(shared.lockstep && arguments.get_one::<u64>("compute-ns").is_some_and(|&ns| ns > 0));
    for &(topic, _) in &service.wakes {
        shared.keep_awake(topic);
    }
    // Those who publish what we read serve us the last message.
    shared.switchboard.announce_reader();
    let joined_at = shared.switchboard.header().topology.load(Ordering::Acquire);
    service.awaited = node.wakes.iter().map(|&topic| (topic, joined_at)).collect();
    if shared.lockstep {
        service.run_lockstep()
    } else {
        service.run_live()
    }
    if let Some(slot) = shared.own_slot() {
        slot.set_state(SlotState::Stopping);
    }
    // The step holds the devices; they come to rest before the ports close.
    drop(service);
    drop(joined);
    match prepared {
        Some(_) => {
            if let Some(slot) = shared.own_slot() {
                slot.set_state(SlotState::Gone);
            }
        }
        None => shared.switchboard.release(shared.slot),
    }
    Ok(())
}

fn open_health(joined: &mut Joined, role: &str) -> Result<Option<PublisherLink>, SetupError> {
    let topic = messages::health_topic(role);
    if joined.manifest.topic(&topic).is_none() || joined.shared.lockstep {
        return Ok(None);
    }
    let fingerprint = Health::description().fingerprint();
    Ok(Some(joined.open_publisher(&topic, fingerprint, false)?))
}

struct Service {
    shared: Rc<Shared>,
    /// Topics that wake the service, with the count of their messages at the last look.
    wakes: Vec<(u32, u64)>,
    period: Option<Duration>,
    step: Step,
    publishers: Vec<PublisherLink>,
    topology: u32,
    /// Topics that wake the service and whose publishers may not have served it the last message yet, with the topology at its coming.
    awaited: Vec<(u32, u32)>,
    times: StepTimes,
    steps: u64,
    late_steps: u64,
    /// Ports that could not be connected, as of the last look.
    unconnected: u64,
    health: Option<PublisherLink>,
}

impl Service {
    fn run_live(&mut self) {
        let shared = Rc::clone(&self.shared);
        let Some(slot) = shared.own_slot() else { return };
        let begin = clock::monotonic();
        let mut due = begin;
        let mut next_health = begin.after(HEALTH_PERIOD);
        slot.set_state(SlotState::Running);
        while !leaving() {
            let heard = slot.bell();
            let now = clock::monotonic();
            slot.heartbeat_ns.store(now.as_nanos(), Ordering::Relaxed);
            self.hold_place(slot);
            self.serve_new_readers();
            self.say_unconnected();
            let woken = self.look_for_messages();
            let timer = now >= due;
            if woken || timer {
                if timer {
                    due = self.next_due(begin, due, now);
                }
                slot.step_since_ns.store(now.as_nanos(), Ordering::Relaxed);
                self.take_step(now, 0);
                slot.step_since_ns.store(0, Ordering::Relaxed);
                slot.steps.store(self.steps, Ordering::Relaxed);
            }
            let now = clock::monotonic();
            if now >= next_health {
                self.publish_health(now);
                next_health = now.after(HEALTH_PERIOD);
            }
            if due > now {
                slot.wait(heard, Some(due.since(now).min(HEARTBEAT)));
            }
        }
        let now = clock::monotonic();
        self.publish_health(now);
    }

    /// Turns are given by the conductor; see the design, section 7.
    fn run_lockstep(&mut self) {
        let shared = Rc::clone(&self.shared);
        let Some(slot) = shared.own_slot() else { return };
        let header = shared.switchboard.header();
        let mut turn = slot.done.load(Ordering::Acquire);
        let mut computing = false;
        slot.next_due_ns.store(0, Ordering::Release);
        slot.set_state(SlotState::Running);
        switchboard::ring(&header.conductor_bell, &header.conductor_sleeps);
        while !leaving() {
            let heard = slot.bell();
            let given = slot.turn.load(Ordering::Acquire);
            if given == turn {
                self.hold_place(slot);
                self.serve_new_readers();
                slot.wait(heard, Some(HEARTBEAT));
                continue;
            }
            turn = given;
            let now = Time::from_nanos(header.logical_ns.load(Ordering::Acquire));
            let round = header.round.load(Ordering::Acquire);
            self.serve_new_readers();
            // On a slow computer the turn after a step is that in which its messages are seen.
            if std::mem::take(&mut computing) {
                shared.begin_step(now, round);
                release_held(&shared);
            } else {
                self.take_step(now, round);
                self.set_timer(slot, now);
                computing = shared.computes.get();
            }
            slot.steps.store(self.steps, Ordering::Relaxed);
            slot.done.store(turn, Ordering::Release);
            if header.outstanding.fetch_sub(1, Ordering::AcqRel) == 1 {
                switchboard::ring(&header.conductor_bell, &header.conductor_sleeps);
            }
        }
        // A step that was not computed to its end has published nothing, and its ports must close.
        shared.held.borrow_mut().clear();
    }

    /// Writes again what is this process's own on the board's page, should a broken process have written over
    /// it: its place, and what wakes it.
    fn hold_place(&self, slot: &Slot) {
        slot.hold();
        for &(topic, _) in &self.wakes {
            self.shared.keep_awake(topic);
        }
    }

    fn set_timer(&self, slot: &Slot, now: Time) {
        if let Some(period) = self.period
            && slot.next_due_ns.load(Ordering::Relaxed) <= now.as_nanos()
        {
            let period = u64::try_from(period.as_nanos()).unwrap_or(u64::MAX).max(1);
            slot.next_due_ns.store((now.as_nanos() / period + 1).saturating_mul(period), Ordering::Release);
        } else if self.period.is_none() {
            slot.next_due_ns.store(u64::MAX, Ordering::Release);
        }
    }

    fn take_step(&mut self, now: Time, round: u32) {
        self.shared.begin_step(now, round);
        (self.step)(now);
        self.steps += 1;
        if !self.shared.lockstep {
            let duration = clock::monotonic().since(now).as_nanos();
            self.times.add(u64::try_from(duration).unwrap_or(u64::MAX));
        }
    }

    /// The next multiple of the period. Periods that were missed are counted, not made up for.
    fn next_due(&mut self, begin: Time, due: Time, now: Time) -> Time {
        let Some(period) = self.period else { return Time::from_nanos(u64::MAX) };
        let next = due.after(period);
        if now < next {
            return next;
        }
        self.late_steps += 1;
        let period_ns = period.as_nanos().max(1);
        let periods = now.since(begin).as_nanos() / period_ns + 1;
        begin.after(Duration::from_nanos(u64::try_from(periods * period_ns).unwrap_or(u64::MAX)))
    }

    fn look_for_messages(&mut self) -> bool {
        let mut woken = false;
        for (topic, seen) in &mut self.wakes {
            let Some(entry) = self.shared.switchboard.topic(*topic) else { continue };
            let count = entry.count.load(Ordering::Acquire);
            woken |= count != *seen;
            *seen = count;
        }
        if !self.awaited.is_empty() {
            woken |= self.look_for_last_messages();
        }
        woken
    }

    /// A message from before our time counts when its publisher has served us, which may be later than our first step.
    fn look_for_last_messages(&mut self) -> bool {
        let board = &self.shared.switchboard;
        let waiting = self.awaited.len();
        self.awaited.retain(|&(topic, joined_at)| {
            let publisher = board.topic(topic).map(|entry| entry.publisher.load(Ordering::Acquire));
            let slot = publisher.and_then(|publisher| board.slot(publisher));
            // The topology counts round after a while.
            slot.is_some_and(|slot| (slot.served.load(Ordering::Acquire).wrapping_sub(joined_at) as i32) < 0)
        });
        self.awaited.len() < waiting
    }

    fn serve_new_readers(&mut self) {
        let topology = self.shared.switchboard.header().topology.load(Ordering::Acquire);
        if topology != self.topology {
            self.topology = topology;
            for link in &self.publishers {
                link.publisher.update();
            }
            if let Some(slot) = self.shared.own_slot() {
                slot.served.store(topology, Ordering::Release);
            }
            // Whoever came after our last message would sleep on it until the next one.
            if !self.shared.lockstep {
                self.publishers.iter().for_each(|link| self.shared.switchboard.ring_readers(link.topic));
            }
        }
    }

    /// A reader or a publisher came that this process could not connect to: one of the two hears nothing of
    /// the other.
    fn say_unconnected(&mut self) {
        let unconnected = transport::unconnected();
        if unconnected != self.unconnected {
            self.unconnected = unconnected;
            // Without a lack it died in the making.
            if let Some(lack) = Lack::look() {
                tracing::error!("another process of the board cannot be connected to: {lack}");
            }
        }
    }

    fn publish_health(&mut self, now: Time) {
        let Some(link) = &self.health else { return };
        let health = Health {
            steps: self.steps,
            step_p50_ns: self.times.quantile_ns(0.5),
            step_p99_ns: self.times.quantile_ns(0.99),
            step_max_ns: self.times.longest_ns(),
            late_steps: self.late_steps,
            lost_messages: self.shared.lost.get(),
            invalid_messages: self.shared.invalid.get(),
            oldest_input_ns: self.shared.oldest_input_ns.get(),
            pid: std::process::id(),
            state: if leaving() { ServiceState::Stopping } else { ServiceState::Running }.into(),
        };
        if let Ok(mut loan) = link.loan(size_of::<Health>()) {
            loan.bytes().copy_from_slice(bytes_of(&health));
            let _ = link.send_stamped(loan, now, now);
        }
        self.times = StepTimes::default();
    }
}

static LEAVING: AtomicBool = AtomicBool::new(false);

fn leaving() -> bool {
    LEAVING.load(Ordering::Acquire)
}

/// On TERM, INT and HUP the process leaves after its present step.
fn catch_signals(shared: &Rc<Shared>) -> Result<(), SetupError> {
    // The page stays mapped until the process ends, so the handler may ring at any time.
    let kept: &'static Rc<Shared> = Box::leak(Box::new(Rc::clone(shared)));
    let Some(slot) = kept.own_slot() else { return Ok(()) };
    for signal in [libc::SIGTERM, libc::SIGINT, libc::SIGHUP] {
        // SAFETY: the handler stores an atomic and rings a futex, both allowed in signal handlers.
        unsafe {
            signal_hook::low_level::register(signal, move || {
                LEAVING.store(true, Ordering::Release);
                slot.ring();
            })?;
        }
    }
    Ok(())
}

/// The launcher's death is a TERM for its services, so that they never drive on alone.
fn die_with_launcher(launcher: u32) -> Result<(), SetupError> {
    rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::TERM))?;
    let parent = rustix::process::getppid().map_or(0, |pid| pid.as_raw_nonzero().get());
    // It may have died before we asked.
    if u32::try_from(parent).ok() != Some(launcher) {
        return Err("the launcher is gone".into());
    }
    Ok(())
}

fn apply_scheduling(arguments: &ArgMatches) -> Result<(), SetupError> {
    if let Some(processors) = arguments.get_many::<usize>("cpu") {
        let mut set = rustix::thread::CpuSet::new();
        processors.for_each(|&processor| set.set(processor));
        rustix::thread::sched_setaffinity(None, &set).map_err(|error| format!("--cpu: {error}"))?;
    }
    if let Some(&nice) = arguments.get_one::<i32>("nice") {
        rustix::process::setpriority_process(None, nice)
            .map_err(|error| format!("--nice {nice}: {error}"))?;
    }
    if let Some(&priority) = arguments.get_one::<i32>("fifo") {
        let parameter = libc::sched_param { sched_priority: priority };
        // SAFETY: a plain system call on a valid struct.
        if unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &parameter) } != 0 {
            let error = io::Error::last_os_error();
            return Err(
                format!("--fifo {priority}: {error}; it needs CAP_SYS_NICE or an rtprio limit").into()
            );
        }
    }
    Ok(())
}

fn start_logging() {
    let filter = tracing_subscriber::EnvFilter::try_from_default_env()
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("info"));
    let _ = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(|| Log)
        .log_internal_errors(false)
        .with_target(false)
        .with_ansi(false)
        .with_timer(tracing_subscriber::fmt::time::uptime())
        .try_init();
}
