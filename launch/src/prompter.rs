//! Says the words of those who are not there: messages from a recording, in the instants and rounds in which they were said.

use board::tap::{OUTSIDE_ROUND, Tap, TapPublisher};
use messages::Time;
use recording::{Message, Messages, Recording};
use std::iter::Peekable;

/// What is said from the recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    /// Only what came from outside: the services say the rest themselves.
    Outside,
    /// Everything that was said on the topics.
    All,
}

/// Publishes recorded messages; without a recording it is silent.
#[derive(Default)]
pub(crate) struct Prompter<'a> {
    script: Option<Script<'a>>,
}

struct Script<'a> {
    messages: Peekable<Messages<'a>>,
    /// By the topic's place in the recording.
    publishers: Vec<Option<TapPublisher>>,
    part: Part,
    /// Keeps the place on the board, and its publishers alive.
    tap: Tap,
}

impl std::fmt::Debug for Prompter<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Prompter").field("speaks", &self.script.is_some()).finish_non_exhaustive()
    }
}

impl<'a> Prompter<'a> {
    /// A prompter for these topics of a recording, as far as the board has them.
    ///
    /// # Errors
    /// When a topic has another layout than on the board, or the board takes no more publishers.
    pub(crate) fn new(
        mut tap: Tap,
        recording: &'a Recording,
        topics: &[String],
        part: Part,
    ) -> Result<Self, String> {
        let mut publishers = Vec::new();
        for topic in recording.topics() {
            let wanted = topics.contains(&topic.name);
            let here = tap.manifest().topic(&topic.name).filter(|_| wanted).map(|(_, here)| &here.message);
            if let Some(difference) = here.and_then(|here| topic.message.first_difference(here)) {
                return Err(format!("`{}` was recorded with another layout: {difference}", topic.name));
            }
            let publisher = here.is_some().then(|| tap.publisher(&topic.name)).transpose();
            publishers.push(publisher.map_err(|error| error.to_string())?);
        }
        let spoken: Vec<&str> = recording
            .topics()
            .iter()
            .zip(&publishers)
            .filter_map(|(topic, publisher)| publisher.as_ref().map(|_| topic.name.as_str()))
            .collect();
        let messages = recording.in_order(|topic| spoken.contains(&topic.name.as_str())).peekable();
        let mut script = Script { messages, publishers, part, tap };
        script.skip();
        Ok(Self { script: Some(script) })
    }

    /// When the next message is due; `None` when all is said.
    pub(crate) fn next(&mut self) -> Option<Time> {
        // What cannot be read is said to be due, so that somebody asks for it and hears why.
        Some(self.script.as_mut()?.peek()?.map_or(Time::ZERO, |(stamp, _)| stamp))
    }

    /// Whether there is something to say in this instant, in this round or a later one.
    pub(crate) fn has_more_at(&mut self, now: Time, round: u32) -> bool {
        let next = self.script.as_mut().and_then(Script::peek);
        next.is_some_and(|next| {
            next.is_none_or(|(stamp, due)| stamp <= now && due != OUTSIDE_ROUND && due >= round)
        })
    }

    /// Says what is due in this round.
    pub(crate) fn say(&mut self, now: Time, round: u32) -> Result<(), String> {
        self.say_while(|stamp, due| (stamp, due) <= (now, round) && due != OUTSIDE_ROUND)
    }

    /// Says what came from outside before the instant at `next`.
    pub(crate) fn say_between(&mut self, next: Time) -> Result<(), String> {
        self.say_while(|stamp, due| stamp < next && due == OUTSIDE_ROUND)
    }

    /// Gives a service that was started again the last words on each topic.
    pub(crate) fn repeat(&self) {
        if let Some(script) = &self.script {
            script.tap.serve_new_readers();
        }
    }

    fn say_while(&mut self, is_due: impl Fn(Time, u32) -> bool) -> Result<(), String> {
        let Some(script) = &mut self.script else { return Ok(()) };
        while let Some(next) = script.peek() {
            if next.is_some_and(|(stamp, due)| !is_due(stamp, due)) {
                return Ok(());
            }
            let Some(message) = script.messages.next() else { return Ok(()) };
            let message = message.map_err(|error| error.to_string())?;
            if let Some(publisher) = &script.publishers[message.topic] {
                publisher.publish_as(message.envelope, message.bytes()).map_err(|error| error.to_string())?;
            }
            script.skip();
        }
        Ok(())
    }
}

impl Script<'_> {
    /// Moment and round of the next message; the inner `None` when it cannot be read.
    fn peek(&mut self) -> Option<Option<(Time, u32)>> {
        let due = |message: &Message| (Time::from_nanos(message.envelope.stamp_ns), message.envelope.round);
        self.messages.peek().map(|next| next.as_ref().ok().map(due))
    }

    /// Leaves out what the services say themselves.
    fn skip(&mut self) {
        if self.part == Part::Outside {
            let is_theirs = |next: &Result<Message, _>| {
                next.as_ref().is_ok_and(|message: &Message| message.envelope.round != OUTSIDE_ROUND)
            };
            while self.messages.next_if(is_theirs).is_some() {}
        }
    }
}
