//! What came of it.

use super::plan::{Deed, Kind};
use super::victims::Verdict;
use serde_json::json;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Longest lists of what went wrong.
const SHOWN: usize = 20;

/// What came of a run.
#[derive(Debug, Clone, Default)]
pub(super) struct Report {
    pub(super) seed: u64,
    victims: Vec<String>,
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
    wheels_checked: u64,
    too_late: Vec<String>,
    /// Who did not come back.
    pub(super) unhealed: Vec<String>,
    /// Who was given up by the launcher.
    pub(super) given_up: Option<String>,
    pub(super) contacts: Option<u64>,
    pub(super) way_m: Option<f64>,
    pub(super) deliveries: Option<u64>,
    pub(super) left_behind: usize,
    pub(super) took_s: f64,
    pub(super) interrupted: bool,
}

impl Report {
    pub(super) fn new(seed: u64, victims: Vec<String>) -> Self {
        Self { seed, victims, ..Self::default() }
    }

    pub(super) fn deed(&mut self, deed: &Deed) {
        self.deeds += 1;
        self.in_start_up += u64::from(deed.in_start_up);
        *self.by_kind.entry(deed.kind).or_default() += 1;
    }

    pub(super) fn verdict(&mut self, verdict: Verdict) {
        let Verdict { wound, too_late } = verdict;
        self.wheels_checked += u64::from(wound.in_chain);
        if let Some(late) = too_late {
            let ms = late.as_secs_f64() * 1e3;
            self.too_late
                .push(format!("`{}` ({:?}): wheels told to turn {ms:.0} ms later", wound.role, wound.kind));
        }
        match wound.healed {
            Some(_) => self.healed += 1,
            None => self.unhealed.push(wound.role.clone()),
        }
        if let Some(heal) = wound.heal().filter(|_| wound.speaks && !wound.in_start_up) {
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
        self.too_late.len() + self.unhealed.len() + usize::from(self.given_up.is_some())
    }

    /// Whether everything held.
    pub(super) fn is_sound(&self) -> bool {
        self.wrong() == 0
            && self.contacts.unwrap_or(0) == 0
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
            (Kind::Kill, "death to first message, killed"),
            (Kind::Hang, "death to first message, hanging"),
            (Kind::Restart, "death to first message, restarted"),
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
        let late = self.too_late.len();
        line(
            "wheels stood in time",
            format!("{} of {}", self.wheels_checked - late as u64, self.wheels_checked),
        );
        let or_unknown = |value: Option<u64>| value.map_or("unknown".to_owned(), |value| value.to_string());
        line("contacts", or_unknown(self.contacts));
        line("way", self.way_m.map_or("unknown".to_owned(), |way_m| format!("{way_m:.1} m")));
        line("deliveries meanwhile", or_unknown(self.deliveries));
        line("files left behind", self.left_behind.to_string());
        for wrong in self.too_late.iter().take(SHOWN) {
            let _ = writeln!(text, "wrong: {wrong}");
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
            "wheels_checked": self.wheels_checked,
            "too_late": self.too_late,
            "unhealed": self.unhealed,
            "given_up": self.given_up,
            "contacts": self.contacts,
            "way_m": self.way_m,
            "deliveries": self.deliveries,
            "left_behind": self.left_behind,
            "took_s": self.took_s,
        })
    }
}

/// Median, 99 % and the largest.
fn quantiles(values: &[f64]) -> [f64; 3] {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted.get(((sorted.len() as f64 - 1.0) * share).round() as usize).copied();
    [at(0.5), at(0.99), at(1.0)].map(|value| value.unwrap_or(f64::NAN))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chaos::witness::Wound;
    use messages::Time;
    use std::time::Duration;

    fn verdict(healed_ms: Option<u64>, too_late: Option<u64>) -> Verdict {
        let at = |ms: u64| Time::from_nanos(ms * 1_000_000);
        let wound = Wound {
            role: "planner".to_owned(),
            kind: Kind::Kill,
            in_start_up: false,
            at: at(0),
            generation: 1,
            in_chain: true,
            speaks: true,
            died: Some(at(0)),
            healed: healed_ms.map(at),
            spoke: healed_ms.map(at),
            alone: true,
            overtaken: false,
        };
        Verdict { wound, too_late: too_late.map(Duration::from_millis) }
    }

    #[track_caller]
    fn check(verdicts: Vec<Verdict>, sound: bool, says: &str) {
        let mut report = Report::new(1, vec!["planner".to_owned()]);
        report.deeds = verdicts.len() as u64;
        verdicts.into_iter().for_each(|verdict| report.verdict(verdict));
        assert_eq!(report.is_sound(), sound);
        assert!(report.text().contains(says), "{}", report.text());
    }

    #[test]
    fn a_run_is_sound_when_all_came_back_and_the_wheels_stood() {
        check(vec![verdict(Some(40), None), verdict(Some(60), None)], true, "2 of 2");
        check(vec![verdict(Some(40), None), verdict(None, None)], false, "`planner` did not come back");
        check(vec![verdict(Some(400), Some(150))], false, "wheels told to turn 150 ms later");
        check(vec![verdict(Some(40), None)], true, "median 40 ms, 99 % 40 ms, max 40 ms");
    }

    #[test]
    fn contacts_and_leftovers_are_wrong() {
        let report = Report { contacts: Some(1), ..Report::default() };
        assert!(!report.is_sound());
        let report = Report { left_behind: 1, ..Report::default() };
        assert!(!report.is_sound());
        assert!(Report::default().is_sound());
    }
}
