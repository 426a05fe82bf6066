//! `board publish`: messages by hand.

use crate::connect::{self, Life, publisher_life};
use crate::{Common, Outcome, show};
use board::clock;
use messages::{Description, elements_offset};
use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng as _, SeedableRng as _};
use serde_json::json;
use std::error::Error;
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::Duration;

#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// The topic.
    topic: String,
    /// The message, as JSON; fields that are not given are zero.
    #[arg(value_name = "JSON", required_unless_present = "raw", conflicts_with = "raw")]
    message: Option<String>,
    /// Bytes as they are: hexadecimal digits, `@FILE`, or `random`.
    #[arg(long, value_name = "HEX|@FILE|random")]
    raw: Option<String>,
    /// Seed of `--raw random`.
    #[arg(long, value_name = "N", default_value_t = 1, requires = "raw")]
    seed: u64,
    /// Messages per second; without -n, until Ctrl-C.
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// How many messages [default: 1; with --rate: until Ctrl-C]
    #[arg(short = 'n', long, value_name = "N")]
    count: Option<u64>,
    /// Publish beside a service that publishes this topic.
    #[arg(long)]
    force: bool,
}

/// Readers find a publisher when they next look, and get nothing from one that has left before.
const LINGER: Duration = Duration::from_millis(300);
/// Most elements of a random message.
const RANDOM_ELEMENTS: u64 = 2000;

#[derive(Debug, thiserror::Error)]
#[error(
    "`{publisher}` publishes `{topic}`, and lives; messages of yours would mix with its own, and whoever obeys them might move. \
     Stop it first, or say --force to publish beside it"
)]
struct Refused {
    topic: String,
    publisher: String,
}

enum Content {
    Fixed(Vec<u8>),
    Random(Box<Pcg64>),
}

pub(crate) fn run(common: &Common, options: &Options) -> Outcome {
    let interrupted = connect::interrupted()?;
    let mut tap = connect::join(common)?;
    let (index, topic) = connect::topic(tap.manifest(), &options.topic)?;
    let description = topic.message.clone();
    if let Some(publisher) = topic.publisher.clone()
        && !options.force
        && options.raw.is_none()
        && publisher_life(tap.switchboard(), index) == Life::Lives
    {
        return Err(Refused { topic: options.topic.clone(), publisher }.into());
    }
    let mut content = content(options, &description)?;
    let period = match options.rate {
        Some(rate) if rate > 0.0 && rate.is_finite() => {
            Some(Duration::from_secs_f64((1.0 / rate).min(86_400.0)))
        }
        Some(rate) => return Err(format!("--rate {rate}: more than zero is needed").into()),
        None => None,
    };
    let count = options.count.unwrap_or(if period.is_some() { u64::MAX } else { 1 });
    let publisher = tap.publisher(&options.topic)?;
    let begin = clock::monotonic();
    let mut published = 0;
    while published < count && !interrupted.load(Ordering::Relaxed) {
        match &mut content {
            Content::Fixed(bytes) => publisher.publish(bytes)?,
            Content::Random(random) => publisher.publish(&random_message(random, &description))?,
        }
        published += 1;
        if let Some(period) = period
            && published < count
        {
            // On the multiples of the period, so that the rate holds whatever a message takes.
            let due = begin.after(period.mul_f64(published as f64));
            let mut now = clock::monotonic();
            while now < due && !interrupted.load(Ordering::Relaxed) {
                tap.wait(tap.bell(), due.since(now).min(Duration::from_millis(200)));
                now = clock::monotonic();
            }
        }
    }
    let until = clock::monotonic().after(LINGER);
    while clock::monotonic() < until && !interrupted.load(Ordering::Relaxed) {
        tap.wait(tap.bell(), until.since(clock::monotonic()));
    }
    if common.json {
        show::json(&json!({ "topic": options.topic, "published": published }))?;
    } else {
        show::line(&format!("published {published} on `{}`", options.topic))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn content(options: &Options, description: &Description) -> Result<Content, Box<dyn Error>> {
    let Some(raw) = &options.raw else {
        let text = options.message.as_deref().unwrap_or("{}");
        let value = serde_json::from_str(text).map_err(|error| format!("this is no JSON: {error}"))?;
        return Ok(Content::Fixed(description.from_json(&value)?));
    };
    if raw == "random" {
        return Ok(Content::Random(Box::new(Pcg64::seed_from_u64(options.seed))));
    }
    if let Some(file) = raw.strip_prefix('@') {
        return Ok(Content::Fixed(std::fs::read(file).map_err(|error| format!("{file}: {error}"))?));
    }
    let digits: Vec<u8> = raw.bytes().filter(|byte| !byte.is_ascii_whitespace() && *byte != b'_').collect();
    let bytes: Option<Vec<u8>> = digits
        .chunks(2)
        .map(|pair| {
            u8::from_str_radix(std::str::from_utf8(pair).ok().filter(|text| text.len() == 2)?, 16).ok()
        })
        .collect();
    let bytes = bytes.ok_or_else(|| {
        format!("--raw `{raw}` is neither pairs of hexadecimal digits, nor @FILE, nor `random`")
    })?;
    Ok(Content::Fixed(bytes))
}

/// Random bytes of the right length; for messages with elements any number of these, and one in four times a length that cannot be.
fn random_message(random: &mut Pcg64, description: &Description) -> Vec<u8> {
    let length = match &description.element {
        None => description.size,
        Some(element) => {
            let elements = random.next_u64() % (RANDOM_ELEMENTS + 1);
            let whole = elements_offset(description.size) + elements as usize * element.size();
            if random.next_u64().is_multiple_of(4) { random.next_u64() as usize % (whole + 1) } else { whole }
        }
    };
    let mut bytes = vec![0; length];
    random.fill_bytes(&mut bytes);
    bytes
}
