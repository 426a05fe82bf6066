//! What came of it.

use super::plan::{Deed, Kind};
use super::victims::Verdict;
use super::witness::Stopping;
use crate::statistics;
use serde_json::json;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Of the wounds that should stop the wheels, one in so many at least must hit turning wheels.
const PROOF: u64 = 5;
/// And at most one in so many may be beyond judgement.
const UNKNOWN_MOST: u64 = 5;
/// Longest lists of what went wrong.
const SHOWN: usize = 20;

/// What came of a run.
#[derive(Debug, Clone, Default)]
pub(super) struct Report {
    pub(super) seed: u64,
    victims: Vec<String>,
    /// On whom the wheels depend.
    chain: Vec<String>,
    pub(super) deeds: u64,
    in_start_up: u64,
    by_kind: BTreeMap<Kind, u64>,
    healed: u64,
    /// The same while somebody else was down as well, from whom it may have needed something.
    heals_beside_others_ms: Vec<f64>,
    /// From death to the successor's first message, by what was done.
    heals_ms: BTreeMap<Kind, Vec<f64>>,
    /// The slowest of each service after a kill.
    slowest_ms: BTreeMap<String, f64>,
    /// Wounds that had to stop turning wheels, by service: those that did, of all.
    stopped: BTreeMap<String, [u64; 2]>,
    /// Wounds that would have had to, but the robot stood, the successor was there before, or nobody knows.
    standing: u64,
    healed_first: u64,
    unknown: u64,
    broken: Vec<String>,
    /// Who did not come back.
    pub(super) unhealed: Vec<String>,
    /// Who was given up by the launcher.
    pub(super) given_up: Option<String>,
    pub(super) contacts: Option<u64>,
    pub(super) contacts_at: Vec<String>,
    pub(super) way_m: Option<f64>,
    pub(super) deliveries: Option<u64>,
    pub(super) left_behind: usize,
    pub(super) took_s: f64,
    pub(super) interrupted: bool,
}

impl Report {
    pub(super) fn new(seed: u64, victims: Vec<String>, chain: Vec<String>) -> Self {
        Self { seed, victims, chain, ..Self::default() }
    }

    pub(super) fn deed(&mut self, deed: &Deed) {
        self.deeds += 1;
        self.in_start_up += u64::from(deed.in_start_up);
        *self.by_kind.entry(deed.kind).or_default() += 1;
    }

    pub(super) fn verdict(&mut self, verdict: Verdict) {
        let Verdict { wound, stopping } = verdict;
        let mut judge = |in_time: u64| {
            let count = self.stopped.entry(wound.role.clone()).or_default();
            *count = [count[0] + in_time, count[1] + 1];
        };
        match stopping {
            Stopping::NotAsked => {}
            Stopping::Stood => self.standing += 1,
            Stopping::HealedFirst => self.healed_first += 1,
            Stopping::Unknown => self.unknown += 1,
            Stopping::InTime => judge(1),
            Stopping::Broken(words) => {
                judge(0);
                self.broken.push(format!("`{}` ({:?}): {words}", wound.role, wound.kind));
            }
        }
        match wound.healed {
            Some(_) => self.healed += 1,
            None => self.unhealed.push(wound.role.clone()),
        }
        if let Some(heal) = wound.heal().filter(|_| !wound.in_start_up) {
            let ms = heal.as_secs_f64() * 1e3;
            if wound.alone {
                self.heals_ms.entry(wound.kind).or_default().push(ms);
                let slowest = self.slowest_ms.entry(wound.role.clone()).or_default();
                *slowest = slowest.max(ms);
            } else {
                self.heals_beside_others_ms.push(ms);
            }
        }
    }

    /// How many things went wrong.
    pub(super) fn wrong(&self) -> usize {
        self.broken.len() + self.unhealed.len() + usize::from(self.given_up.is_some())
    }

    /// Why what was seen proves nothing, although nothing went wrong: in words, nothing when it does.
    fn doubts(&self) -> Vec<String> {
        let mut doubts = Vec::new();
        let judged: u64 = self.stopped.values().map(|[_, of]| of).sum();
        let turning = judged + self.healed_first;
        let asked = turning + self.standing + self.unknown;
        if self.contacts.is_none() {
            doubts.push(
                "nobody knows whether the robot has touched something: the graph has no truth".to_owned(),
            );
        }
        if self.chain.is_empty() {
            doubts.push("nobody on whom the wheels depend was hit".to_owned());
        }
        for role in self.chain.iter().filter(|role| !self.stopped.contains_key(*role)) {
            doubts.push(format!("nobody has seen turning wheels stop because of `{role}`"));
        }
        if turning * PROOF < asked {
            doubts.push(format!(
                "only {turning} of {asked} wounds that should stop the wheels hit wheels that turned; a robot that stands proves nothing"
            ));
        }
        if self.unknown * UNKNOWN_MOST > asked {
            doubts.push(format!(
                "{} of {asked} could not be judged: messages were lost, the machine is too busy",
                self.unknown
            ));
        }
        doubts
    }

    /// Whether everything held, and was seen to hold.
    pub(super) fn is_sound(&self) -> bool {
        self.wrong() == 0
            && self.doubts().is_empty()
            && self.contacts == Some(0)
            && self.left_behind == 0
            && !self.interrupted
            && self.healed == self.deeds
    }

    pub(super) fn text(&self) -> String {
        let count = |kind| self.by_kind.get(&kind).copied().unwrap_or(0);
        let mut text = String::new();
        let verdict = if self.is_sound() { "SOUND" } else { "NOT SOUND" };
        let _ = writeln!(
            text,
            "{verdict}: {} deeds in {:.0} s (seed {}): {} kills, {} hangs, {} restarts; {} of the kills in a start-up window",
            self.deeds,
            self.took_s,
            self.seed,
            count(Kind::Kill),
            count(Kind::Hang),
            count(Kind::Restart),
            self.in_start_up
        );
        let mut line = |name: &str, value: String| {
            let _ = writeln!(text, "  {name:38} {value}");
        };
        line("services that were hit", self.victims.join(", "));
        line("came back", format!("{} of {}", self.healed, self.deeds));
        for (kind, name) in [
            (Kind::Kill, "death to first message*, killed"),
            (Kind::Hang, "death to first message*, hanging"),
            (Kind::Restart, "death to first message*, restarted"),
        ] {
            if let Some(heals) = self.heals_ms.get(&kind) {
                let [median, most, max] = quantiles(heals);
                line(
                    name,
                    format!("median {median:.0} ms, 99 % {most:.0} ms, max {max:.0} ms ({})", heals.len()),
                );
            }
        }
        if !self.heals_beside_others_ms.is_empty() {
            let [median, most, max] = quantiles(&self.heals_beside_others_ms);
            let count = self.heals_beside_others_ms.len();
            let value = format!("median {median:.0} ms, 99 % {most:.0} ms, max {max:.0} ms ({count})");
            line("the same while others were down", value);
        }
        let mut slowest: Vec<(&String, &f64)> = self.slowest_ms.iter().collect();
        slowest.sort_by(|a, b| b.1.total_cmp(a.1));
        let slowest: Vec<String> =
            slowest.into_iter().take(4).map(|(role, ms)| format!("{role} {ms:.0} ms")).collect();
        line("slowest", slowest.join(", "));
        line("", "* or to the third step of one that has nothing to say".to_owned());
        for (role, [in_time, of]) in &self.stopped {
            line(&format!("wheels as promised, {role}"), format!("{in_time} of {of}"));
        }
        line("successor there before they had to", self.healed_first.to_string());
        line("robot stood already", self.standing.to_string());
        line("not to be judged", self.unknown.to_string());
        let or_unknown = |value: Option<u64>| value.map_or("unknown".to_owned(), |value| value.to_string());
        line("contacts", or_unknown(self.contacts));
        line("way", self.way_m.map_or("unknown".to_owned(), |way_m| format!("{way_m:.1} m")));
        line("deliveries meanwhile", or_unknown(self.deliveries));
        line("files left behind", self.left_behind.to_string());
        for doubt in self.doubts() {
            let _ = writeln!(text, "no proof: {doubt}");
        }
        for wrong in self.broken.iter().take(SHOWN) {
            let _ = writeln!(text, "wrong: {wrong}");
        }
        for contact in self.contacts_at.iter().take(SHOWN) {
            let _ = writeln!(text, "wrong: {contact}");
        }
        for role in self.unhealed.iter().take(SHOWN) {
            let _ = writeln!(text, "wrong: `{role}` did not come back");
        }
        if let Some(given_up) = &self.given_up {
            let _ = writeln!(text, "wrong: given up: {given_up}");
        }
        if self.interrupted {
            text += "interrupted\n";
        }
        text
    }

    pub(super) fn json(&self) -> serde_json::Value {
        let heals: BTreeMap<String, _> = self
            .heals_ms
            .iter()
            .map(|(kind, heals)| {
                let [median, most, max] = quantiles(heals);
                let name = format!("{kind:?}").to_lowercase();
                (name, json!({"count": heals.len(), "median_ms": median, "p99_ms": most, "max_ms": max}))
            })
            .collect();
        json!({
            "sound": self.is_sound(),
            "seed": self.seed,
            "deeds": self.deeds,
            "in_start_up": self.in_start_up,
            "healed": self.healed,
            "heals": heals,
            "slowest_ms": self.slowest_ms,
            "wheels": self.stopped.iter().map(|(role, [in_time, of])| (role, json!({"in_time": in_time, "of": of}))).collect::<BTreeMap<_, _>>(),
            "healed_first": self.healed_first,
            "stood_already": self.standing,
            "not_judged": self.unknown,
            "broken": self.broken,
            "doubts": self.doubts(),
            "unhealed": self.unhealed,
            "given_up": self.given_up,
            "contacts": self.contacts,
            "contacts_at": self.contacts_at,
            "way_m": self.way_m,
            "deliveries": self.deliveries,
            "left_behind": self.left_behind,
            "took_s": self.took_s,
        })
    }
}

/// Median, 99 % and the largest; NaN without values.
fn quantiles(values: &[f64]) -> [f64; 3] {
    let sorted = statistics::sorted(values);
    [0.5, 0.99, 1.0].map(|share| statistics::quantile(&sorted, share).unwrap_or(f64::NAN))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chaos::witness::{Link, Wound};
    use messages::Time;

    fn verdict(healed_ms: Option<u64>, stopping: Stopping) -> Verdict {
        let at = |ms: u64| Time::from_nanos(ms * 1_000_000);
        let wound = Wound {
            role: "guard".to_owned(),
            kind: Kind::Kill,
            in_start_up: false,
            is_proof: false,
            at: at(0),
            generation: 1,
            link: Link::Word,
            died: Some(at(0)),
            healed: healed_ms.map(at),
            spoke: healed_ms.map(at),
            alone: true,
            stepped: None,
            overtaken: None,
        };
        Verdict { wound, stopping }
    }

    /// A run without a contact, in which these things were seen.
    fn report(verdicts: Vec<Verdict>) -> Report {
        let mut report = Report::new(1, vec!["guard".to_owned()], vec!["guard".to_owned()]);
        report.deeds = verdicts.len() as u64;
        report.contacts = Some(0);
        verdicts.into_iter().for_each(|verdict| report.verdict(verdict));
        report
    }

    #[track_caller]
    fn check(report: &Report, sound: bool, says: &str) {
        assert_eq!(report.is_sound(), sound, "{}", report.text());
        assert!(report.text().contains(says), "{}", report.text());
    }

    fn in_time() -> Verdict {
        verdict(Some(400), Stopping::InTime)
    }

    #[test]
    fn a_run_is_sound_when_all_came_back_and_the_wheels_stood() {
        check(&report(vec![in_time(), in_time()]), true, "2 of 2");
        check(&report(vec![in_time(), verdict(None, Stopping::InTime)]), false, "`guard` did not come back");
        let broken = Stopping::Broken("wheels told to turn 150 ms later".to_owned());
        check(&report(vec![in_time(), verdict(Some(400), broken)]), false, "told to turn 150 ms later");
        check(
            &report(vec![verdict(Some(40), Stopping::InTime)]),
            true,
            "median 40 ms, 99 % 40 ms, max 40 ms",
        );
    }

    #[test]
    fn contacts_and_leftovers_are_wrong() {
        check(&Report { contacts: Some(1), ..report(vec![in_time()]) }, false, "contacts");
        check(&Report { left_behind: 1, ..report(vec![in_time()]) }, false, "files left behind");
    }

    #[test]
    fn what_proves_nothing_is_not_sound() {
        check(
            &Report { contacts: None, ..report(vec![in_time()]) },
            false,
            "nobody knows whether the robot has touched",
        );
        let stood = || verdict(Some(40), Stopping::Stood);
        check(
            &report(vec![stood(), stood()]),
            false,
            "nobody has seen turning wheels stop because of `guard`",
        );
        let mostly = std::iter::repeat_with(stood).take(9).chain([in_time()]).collect();
        check(&report(mostly), false, "only 1 of 10 wounds");
        let healed = || verdict(Some(40), Stopping::HealedFirst);
        check(&report(vec![healed(), healed()]), false, "nobody has seen turning wheels stop");
        check(&report(vec![healed(), healed(), in_time()]), true, "1 of 1");
        let unknown = || verdict(Some(40), Stopping::Unknown);
        check(&report(vec![in_time(), unknown(), unknown()]), false, "2 of 3 could not be judged");
        check(
            &Report { chain: Vec::new(), ..report(vec![in_time()]) },
            false,
            "nobody on whom the wheels depend",
        );
    }
}
