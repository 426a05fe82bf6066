//! `board publish`: messages by hand.

use crate::connect::{self, Watch, who_obeys};
use crate::{Common, Outcome, show};
use board::{arguments, clock};
use messages::{Description, elements_offset};
use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng as _, SeedableRng as _};
use serde_json::json;
use std::error::Error;
use std::process::ExitCode;
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
    #[arg(long = "rate", value_name = "HZ", value_parser = arguments::period)]
    period: Option<Duration>,
    /// How many messages [default: 1; with --rate: until Ctrl-C]
    #[arg(short = 'n', long, value_name = "N")]
    count: Option<u64>,
    /// Publish where a service publishes, or where one listens that moves the robot.
    #[arg(long)]
    force: bool,
}

/// Most elements of a random message.
const RANDOM_ELEMENTS: u64 = 2000;

#[derive(Debug, thiserror::Error)]
#[error(
    "{why}: whoever obeys a message of yours might move. Stop it first, or say --force to publish all the same"
)]
struct Refused {
    why: String,
}

enum Content {
    Fixed(Vec<u8>),
    Random(Box<Pcg64>),
}

pub(crate) fn run(common: &Common, options: &Options) -> Outcome {
    let place = connect::choose(common)?;
    let mut watch = Watch::begin(place.clone())?;
    let mut tap = connect::join(&place)?;
    let (index, topic) = connect::topic(tap.manifest(), &options.topic)?;
    let description = topic.message.clone();
    if !options.force
        && let Some(why) = who_obeys(tap.manifest(), tap.switchboard(), index)
    {
        return Err(Refused { why }.into());
    }
    let mut content = content(options, &description)?;
    let period = options.period;
    let count = options.count.unwrap_or(if period.is_some() { u64::MAX } else { 1 });
    let publisher = tap.publisher(&options.topic)?;
    let begin = clock::monotonic();
    let mut published = 0_u64;
    let mut ended = false;
    while published < count && !ended {
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
            while now < due && !ended {
                tap.wait(tap.bell(), due.since(now).min(Duration::from_millis(200)));
                now = clock::monotonic();
                ended = watch.end_said()?.is_some();
            }
        }
        ended |= watch.end_said()?.is_some();
    }
    connect::linger(&tap, &mut watch)?;
    if common.json {
        show::json(&json!({ "topic": options.topic, "published": published }))?;
    } else {
        let topic = show::harmless(&options.topic);
        show::line(&format!("published {} on `{topic}`", show::count(published as usize, "message")))?;
    }
    let all = options.count.is_none_or(|count| published >= count);
    Ok(if all { ExitCode::SUCCESS } else { ExitCode::FAILURE })
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

/// Random bytes of the right length; for messages with elements any number of these, and one in four times a
/// length that cannot be.
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
