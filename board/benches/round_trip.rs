//! Round trips between two processes: the board as services use it, the bare transport with the same
//! settings, the same with a stamp that is written and looked at, and a bare futex as the floor.
//!
//! All in one run and in turn, block by block, so that whatever else the machine does hits all alike.
//! Polling: both sides look for the newest message without a pause. Waiting: both sleep until they are woken.
//! Each side touches three bytes of the message.
//! `cargo bench -p board --bench round_trip [-- [BLOCKS] [polling|waiting]]`

use board::host::Host;
use board::manifest::{Manifest, Topic};
use board::switchboard::Switchboard;
use board::{About, Latest, Publisher, clock};
use iceoryx2::config::Config;
use iceoryx2::prelude::*;
use messages::{Message, Misfit, Parameters, Time};
use rustix::thread::{CpuSet, futex, sched_setaffinity};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

type Failure = Box<dyn Error + Send + Sync>;

const SIZES: [(&str, usize); 4] = [("64 B", 64), ("4 kB", 4096), ("1 MB", 1_000_000), ("6 MB", 6_000_000)];
const BLOCKS: usize = 7;
const WHICH: &str = "CORKBOARD_BENCH_SIDE";
/// Asks the other side to leave.
const END: u64 = u64::MAX;
/// After so long without an answer the question is asked again: the other side was not there yet.
const AGAIN: Duration = Duration::from_millis(50);

/// A number, and as many bytes as the size under test wants.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[message(element = u8)]
#[repr(C)]
struct Frame {
    /// The number.
    number: u64,
}

/// What the two processes of a block do.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct Params {
    /// Bytes of a message.
    bytes: usize,
    /// Whether both sides spin.
    polling: bool,
    /// Round trips that count.
    trips: u64,
    /// Round trips before.
    warm_up: u64,
    /// The processors of the two sides.
    processors: [usize; 2],
    /// The folder of the bare contestants.
    folder: PathBuf,
    /// Whether the bare transport stamps its messages and looks at the stamps, as the board does.
    stamped: bool,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            bytes: 64,
            polling: true,
            trips: 1,
            warm_up: 0,
            processors: [0, 0],
            folder: PathBuf::new(),
            stamped: false,
        }
    }
}

/// What the bare transport carries in front of a message: as much as the board does.
#[derive(Debug, Clone, Copy, Default, ZeroCopySend)]
#[repr(C)]
struct Head {
    stamp_ns: u64,
    origin_ns: u64,
    sequence: u64,
    generation: u32,
    round: u32,
}

impl Parameters for Params {
    type Error = Misfit;
}

fn main() -> ExitCode {
    let side = std::env::var(WHICH).unwrap_or_default();
    let about = |name| About { name, version: "1.0.0", description: "A side of the benchmark" };
    let outcome = match side.as_str() {
        "board-ping" => return board::run(about("ping"), board_ping),
        "board-pong" => return board::run(about("pong"), board_pong),
        "bare-ping" => bare(true),
        "bare-pong" => bare(false),
        "futex-ping" => futex_side(true),
        "futex-pong" => futex_side(false),
        _ => compare(),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{side}: {error}");
            ExitCode::FAILURE
        }
    }
}

// The rounds.

/// Median and 99th percentile of a block, in nanoseconds.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Block {
    p50: f64,
    p99: f64,
}

fn compare() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|text| !text.starts_with('-')).collect();
    let blocks = arguments.iter().find_map(|text| text.parse().ok()).unwrap_or(BLOCKS);
    let chosen = |how: &str| {
        let mut words = arguments.iter().filter(|text| text.parse::<usize>().is_err()).peekable();
        words.peek().is_none() || words.any(|word| word == how)
    };
    let mut all = CpuSet::new();
    let affinity = rustix::thread::sched_getaffinity(None)?;
    (0..1024).filter(|&processor| affinity.is_set(processor)).for_each(|processor| all.set(processor));
    let processors: Vec<usize> = (0..1024).filter(|&processor| all.is_set(processor)).collect();
    let (first, second) = (processors[0], *processors.last().ok_or("no processor")?);
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    println!("{blocks} blocks each; load before: {}", load.split(' ').next().unwrap_or_default());
    println!(
        "{:<24} {:>17} {:>17} {:>17} {:>17} {:>10} {:>10}",
        "p50 and p99, us", "board", "iceoryx2", "iceoryx2 stamped", "futex", "to bare", "to stamped"
    );
    for (how, polling, processors) in [
        ("polling", true, [first, second]),
        ("waiting", false, [first, second]),
        ("waiting", false, [first, first]),
    ] {
        if !chosen(how) {
            continue;
        }
        let place = if processors[0] == processors[1] { "one core" } else { "two cores" };
        for (name, bytes) in SIZES {
            let trips = if polling { 20_000 } else { 1500 };
            let params =
                Params { bytes, polling, trips, warm_up: trips / 10, processors, ..Params::default() };
            let mut seen: [Vec<Block>; 4] = Default::default();
            for block in 0..blocks {
                // Turned by one each time, so that none always runs after the same other.
                for turn in 0..4 {
                    let which = (block + turn) % 4;
                    seen[which].push(match which {
                        0 => board_block(&params)?,
                        1 => pair("bare", &params)?,
                        2 => pair("bare", &Params { stamped: true, ..params.clone() })?,
                        _ => pair("futex", &params)?,
                    });
                }
            }
            let [board, bare, stamped, futex] = &seen;
            let ratio = |others: &[Block]| {
                median(board.iter().zip(others).map(|(board, other)| board.p50 / other.p50).collect())
            };
            println!(
                "{how:<8} {place:<9} {name:>5} {} {} {} {} {:>10.2} {:>10.2}",
                shown(board),
                shown(bare),
                shown(stamped),
                shown(futex),
                ratio(bare),
                ratio(stamped),
            );
        }
    }
    println!("medians over the blocks; the ratios are medians of the ratios of p50 block by block");
    Ok(())
}

fn shown(blocks: &[Block]) -> String {
    let of = |part: fn(&Block) -> f64| median(blocks.iter().map(part).collect()) / 1e3;
    format!("{:>8.2} {:>8.2}", of(|block| block.p50), of(|block| block.p99))
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn board_block(params: &Params) -> Result<Block, Failure> {
    let topic = |name: &str, publisher: &str, reader: &str| Topic {
        name: name.into(),
        publisher: Some(publisher.into()),
        readers: vec![reader.into()],
        depth: 4,
        elements: params.bytes,
        message: Frame::description(),
    };
    let topics = vec![topic("ping", "ping", "pong"), topic("pong", "pong", "ping")];
    let name = format!("bench{}", std::process::id());
    let host = Host::create(&name, Manifest { graph: "bench".into(), topics, ..Manifest::default() }, false)?;
    let text = serde_json::to_string(params)?;
    let start = |side: usize, role: &str| -> Result<std::process::Child, Failure> {
        let slot = host.prepare(role, true).ok_or("no place on the board")?;
        Ok(Command::new(std::env::current_exe()?)
            .env(WHICH, format!("board-{role}"))
            .env("RUST_LOG", "warn")
            .args(["--board", &name, "--role", role, "--slot", &slot.to_string(), "--params", &text])
            .args(["--cpu", &params.processors[side].to_string()])
            .stdout(Stdio::piped())
            .spawn()?)
    };
    let mut pong = start(1, "pong")?;
    let ping = start(0, "ping")?.wait_with_output()?;
    pong.wait()?;
    host.take_down()?;
    Ok(serde_json::from_slice(&ping.stdout)?)
}

fn pair(kind: &str, params: &Params) -> Result<Block, Failure> {
    let folder = PathBuf::from(format!("/dev/shm/corkboard-bench-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    drop(Switchboard::create(&folder.join("page"))?);
    let text = serde_json::to_string(&Params { folder: folder.clone(), ..params.clone() })?;
    let start = |side: &str| {
        Command::new(std::env::current_exe()?)
            .env(WHICH, format!("{kind}-{side}"))
            .arg(&text)
            .stdout(Stdio::piped())
            .spawn()
    };
    let mut pong = start("pong")?;
    let ping = start("ping")?.wait_with_output()?;
    pong.wait()?;
    std::fs::remove_dir_all(&folder)?;
    for entry in std::fs::read_dir("/dev/shm")?.flatten() {
        if entry.file_name().to_string_lossy().starts_with(&bare_prefix(&folder)) {
            std::fs::remove_file(entry.path())?;
        }
    }
    Ok(serde_json::from_slice(&ping.stdout)?)
}

// What all sides share.

/// The times of the round trips, and which is due.
struct Trips {
    number: u64,
    asked: Time,
    warm_up: u64,
    trips: u64,
    times_ns: Vec<f64>,
}

impl Trips {
    fn new(params: &Params) -> Self {
        Self {
            number: 0,
            asked: Time::ZERO,
            warm_up: params.warm_up,
            trips: params.trips,
            times_ns: Vec::with_capacity(params.trips as usize),
        }
    }

    fn next(&mut self) -> u64 {
        self.number += 1;
        self.asked = clock::monotonic();
        self.number
    }

    /// Takes an answer in; true when it was the last.
    fn answered(&mut self) -> bool {
        let passed = clock::monotonic().since(self.asked).as_nanos() as f64;
        if self.number > self.warm_up {
            self.times_ns.push(passed);
        }
        self.number >= self.warm_up + self.trips
    }

    fn print(&mut self) {
        self.times_ns.sort_by(f64::total_cmp);
        let at = |share: f64| self.times_ns[((self.times_ns.len() - 1) as f64 * share).round() as usize];
        let block = Block { p50: at(0.5), p99: at(0.99) };
        println!("{}", serde_json::to_string(&block).unwrap_or_default());
    }
}

/// First, middle and last byte.
fn touch(bytes: &mut [u8], number: u64) {
    for place in [0, bytes.len() / 2, bytes.len() - 1] {
        bytes[place] = number as u8;
    }
}

fn look_at(bytes: &[u8]) -> u64 {
    [0, bytes.len() / 2, bytes.len() - 1].iter().map(|&place| u64::from(bytes[place])).sum()
}

// The board.

type Step = Box<dyn FnMut(Time)>;

fn send(publisher: &mut Publisher<Frame>, number: u64, bytes: usize) {
    let Some(mut loan) = publisher.loan(bytes) else { return };
    let (frame, elements) = loan.parts();
    frame.number = number;
    touch(elements, number);
    loan.send();
}

fn newest(latest: &mut Latest<Frame>) -> Option<u64> {
    let frame = latest.read()?;
    std::hint::black_box(look_at(frame.elements));
    Some(frame.number)
}

/// As the launcher's TERM would.
fn leave() {
    // SAFETY: a signal to this process, which catches it.
    unsafe { libc::raise(libc::SIGTERM) };
}

fn board_ping(node: &mut board::Node, params: Params) -> Result<Step, Failure> {
    let mut ping = node.publisher::<Frame>("ping")?;
    let mut pong = node.latest::<Frame>("pong")?;
    node.every(AGAIN);
    let bytes = params.bytes - size_of::<Frame>();
    let mut trips = Trips::new(&params);
    if params.polling {
        return Ok(Box::new(move |_| {
            loop {
                let number = trips.next();
                send(&mut ping, number, bytes);
                let mut spins = 0_u32;
                while newest(&mut pong) != Some(number) {
                    spins = spins.wrapping_add(1);
                    if spins.is_multiple_of(65_536) && clock::monotonic().since(trips.asked) > AGAIN {
                        send(&mut ping, number, bytes);
                    }
                }
                if trips.answered() {
                    break;
                }
            }
            trips.print();
            send(&mut ping, END, bytes);
            leave();
        }));
    }
    node.wake_on(&pong);
    Ok(Box::new(move |now| {
        if trips.number == 0 {
            trips.next();
        } else if newest(&mut pong) == Some(trips.number) {
            if trips.answered() {
                trips.print();
                send(&mut ping, END, bytes);
                leave();
                return;
            }
            trips.next();
        } else if now.since(trips.asked) < AGAIN {
            return;
        }
        send(&mut ping, trips.number, bytes);
    }))
}

fn board_pong(node: &mut board::Node, params: Params) -> Result<Step, Failure> {
    let mut pong = node.publisher::<Frame>("pong")?;
    let mut ping = node.latest::<Frame>("ping")?;
    let bytes = params.bytes - size_of::<Frame>();
    let mut last = None;
    let mut answer = move || -> bool {
        let number = newest(&mut ping);
        if number == last {
            return true;
        }
        last = number;
        match number {
            Some(END) => false,
            Some(number) => {
                send(&mut pong, number, bytes);
                true
            }
            None => true,
        }
    };
    if params.polling {
        node.every(AGAIN);
        return Ok(Box::new(move |_| {
            while answer() {}
            leave();
        }));
    }
    let ping_port = node.latest::<Frame>("ping")?;
    node.wake_on(&ping_port);
    drop(ping_port);
    Ok(Box::new(move |_| {
        if !answer() {
            leave();
        }
    }))
}

// The bare transport, with the board's settings.

fn bare_prefix(folder: &Path) -> String {
    format!("x{}_", folder.to_string_lossy().rsplit('-').next().unwrap_or_default())
}

fn pinned() -> Result<(Params, bool), Failure> {
    let params: Params = serde_json::from_str(&std::env::args().nth(1).unwrap_or_default())?;
    let is_ping = std::env::var(WHICH).unwrap_or_default().ends_with("ping");
    let mut set = CpuSet::new();
    set.set(params.processors[usize::from(!is_ping)]);
    sched_setaffinity(None, &set)?;
    Ok((params, is_ping))
}

fn bare(is_ping: bool) -> Result<(), Failure> {
    let (params, _) = pinned()?;
    set_log_level(LogLevel::Fatal);
    let mut config = Config::default();
    config.global.prefix = bare_prefix(&params.folder).as_str().try_into().map_err(|_| "prefix")?;
    config.global.set_root_path(&params.folder.to_string_lossy().as_ref().try_into().map_err(|_| "root")?);
    let node = NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<ipc::Service>()?;
    let topic = |name: &str| {
        let name: ServiceName = name.try_into().map_err(|_| "name")?;
        let messages = node
            .service_builder(&name)
            .publish_subscribe::<[u8]>()
            .user_header::<Head>()
            .payload_alignment(Alignment::new(64).ok_or("alignment")?)
            .history_size(1)
            .subscriber_max_buffer_size(4)
            .subscriber_max_borrowed_samples(3)
            .max_publishers(3)
            .max_subscribers(13)
            .max_nodes(128)
            .enable_safe_overflow(true)
            .open_or_create()?;
        let bell = node.service_builder(&name).event().max_nodes(128).open_or_create()?;
        Ok::<_, Failure>((messages, bell))
    };
    let (out, out_bell) = topic(if is_ping { "ping" } else { "pong" })?;
    let (back, back_bell) = topic(if is_ping { "pong" } else { "ping" })?;
    let publisher = out
        .publisher_builder()
        .initial_max_slice_len(params.bytes)
        .allocation_strategy(AllocationStrategy::PowerOfTwo)
        .max_loaned_samples(2)
        .create()?;
    let subscriber = back.subscriber_builder().buffer_size(4).create()?;
    let notifier = out_bell.notifier_builder().create()?;
    let listener = back_bell.listener_builder().create()?;
    let mut held = None;
    let mut newest = || -> Result<Option<u64>, Failure> {
        while let Some(sample) = subscriber.receive()? {
            let envelope = *sample.user_header();
            if params.stamped && envelope.stamp_ns > clock::monotonic().as_nanos() {
                continue;
            }
            held = Some(sample);
        }
        let Some(sample) = &held else { return Ok(None) };
        let (number, rest) = sample.payload().split_at(8);
        std::hint::black_box(look_at(rest));
        Ok(Some(u64::from_le_bytes(number.try_into()?)))
    };
    let send = |number: u64| -> Result<(), Failure> {
        let mut sample = publisher.loan_slice_uninit(params.bytes)?;
        let stamp_ns = if params.stamped { clock::monotonic().as_nanos() } else { 0 };
        *sample.user_header_mut() =
            Head { stamp_ns, origin_ns: stamp_ns, sequence: number, generation: 1, round: 0 };
        // SAFETY: bytes of a mapped file have some value, and any will do.
        let mut sample = unsafe { sample.assume_init() };
        let (head, rest) = sample.payload_mut().split_at_mut(8);
        head.copy_from_slice(&number.to_le_bytes());
        touch(rest, number);
        sample.send()?;
        if !params.polling {
            notifier.notify()?;
        }
        Ok(())
    };
    let wait = |timeout: Duration| -> Result<(), Failure> {
        if !params.polling {
            listener.timed_wait(|_| {}, timeout)?;
        }
        Ok(())
    };
    if !is_ping {
        let mut last = None;
        loop {
            let number = newest()?;
            if number == last {
                wait(AGAIN)?;
                continue;
            }
            last = number;
            match number {
                Some(END) => return Ok(()),
                Some(number) => send(number)?,
                None => {}
            }
        }
    }
    let mut trips = Trips::new(&params);
    loop {
        let number = trips.next();
        send(number)?;
        let mut spins = 0_u32;
        while newest()? != Some(number) {
            wait(AGAIN)?;
            spins = spins.wrapping_add(1);
            if (!params.polling || spins.is_multiple_of(65_536))
                && clock::monotonic().since(trips.asked) > AGAIN
            {
                send(number)?;
            }
        }
        if trips.answered() {
            break;
        }
    }
    trips.print();
    send(END)
}

// The floor: two words in shared memory, without any message.

fn futex_side(is_ping: bool) -> Result<(), Failure> {
    let (params, _) = pinned()?;
    let page = Switchboard::open(&params.folder.join("page"))?;
    let header = page.header();
    let (question, answer) = (&header.round, &header.outstanding);
    let wait_for = |word: &AtomicU32, number: u32| {
        loop {
            let seen = word.load(Ordering::SeqCst);
            if seen == number {
                return;
            }
            if !params.polling {
                let _ = futex::wait(word, futex::Flags::empty(), seen, None);
            }
        }
    };
    let tell = |word: &AtomicU32, number: u32| {
        word.store(number, Ordering::SeqCst);
        if !params.polling {
            let _ = futex::wake(word, futex::Flags::empty(), 1);
        }
    };
    let last = (params.warm_up + params.trips) as u32;
    if !is_ping {
        for number in 1..=last {
            wait_for(question, number);
            tell(answer, number);
        }
        return Ok(());
    }
    let mut trips = Trips::new(&params);
    loop {
        let number = trips.next() as u32;
        tell(question, number);
        wait_for(answer, number);
        if trips.answered() {
            break;
        }
    }
    trips.print();
    Ok(())
}
