//! What the judge of a run said of it, in the recording and in the rerun, figure by figure.

use crate::numbers::{aligned, number, signed};
use messages::{Message as _, RunSummary};
use recording::{Recording, RecordingError};
use serde::Serialize;
use serde_json::Value;

/// The judge's last word on both runs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Judged {
    /// Where it was said.
    pub(super) topic: String,
    pub(super) recorded: Word,
    pub(super) rerun: Word,
    /// Those of the recording in their order, then what only the rerun has.
    pub(super) figures: Vec<Compared>,
}

/// A verdict.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Word {
    pub(super) verdict: Verdict,
    /// The judge's own words.
    pub(super) remark: String,
}

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Verdict {
    Passed,
    Failed,
    /// It was over before the judge had decided.
    Undecided,
    /// The judge said nothing at all.
    Silent,
}

impl Verdict {
    fn word(self) -> &'static str {
        match self {
            Self::Passed => "PASSED",
            Self::Failed => "FAILED",
            Self::Undecided => "undecided",
            Self::Silent => "no word",
        }
    }
}

/// A figure of both runs; null where it is not known.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Compared {
    pub(super) name: String,
    pub(super) unit: String,
    pub(super) recorded: Option<f64>,
    pub(super) rerun: Option<f64>,
    /// The rerun's less the recorded one.
    pub(super) difference: Option<f64>,
}

/// What a judge said last.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LastWord {
    topic: String,
    word: Word,
    figures: Vec<(String, String, f64)>,
}

impl LastWord {
    /// Of this recording, on the topic that ends its graph or any other of a judge; `None` when it has none.
    /// A judge that has not spoken is silent.
    ///
    /// # Errors
    /// When the recording is damaged.
    pub(super) fn of(recording: &Recording, finish: Option<&str>) -> Result<Option<Self>, RecordingError> {
        let topics = recording.topics().iter();
        // By name, so that a judge whose layout was another one then is understood too.
        let mut judges = topics.filter(|topic| topic.message.name == RunSummary::NAME);
        let by_name = judges.clone().find(|topic| Some(topic.name.as_str()) == finish);
        let Some(topic) = by_name.or_else(|| judges.next()) else { return Ok(None) };
        let mut last = None;
        for message in recording.as_recorded(|other| other.name == topic.name) {
            last = Some(topic.message.to_json(message?.bytes()));
        }
        Ok(Some(last.map_or_else(|| Self::silent(&topic.name), |json| Self::from_json(&topic.name, &json))))
    }

    /// Whether the run ended because the judge had decided.
    pub(super) fn is_decided(&self) -> bool {
        matches!(self.word.verdict, Verdict::Passed | Verdict::Failed)
    }

    fn silent(topic: &str) -> Self {
        let word = Word { verdict: Verdict::Silent, remark: String::new() };
        Self { topic: topic.to_owned(), word, figures: Vec::new() }
    }

    fn from_json(topic: &str, json: &Value) -> Self {
        let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
        let verdict = match json["state"].as_str() {
            Some("Passed") => Verdict::Passed,
            Some("Failed") => Verdict::Failed,
            _ => Verdict::Undecided,
        };
        let count = json["metric_count"].as_u64().unwrap_or(0) as usize;
        let figures = json["metrics"].as_array().into_iter().flatten().take(count).map(|figure| {
            let value = &figure["value"];
            // What is no number (NaN, infinite) is written as a text.
            let value = value.as_f64().or_else(|| value.as_str()?.parse().ok());
            (text(&figure["name"]), text(&figure["unit"]), value.unwrap_or(f64::NAN))
        });
        let word = Word { verdict, remark: text(&json["remark"]) };
        Self { topic: topic.to_owned(), word, figures: figures.collect() }
    }
}

impl Judged {
    /// Both words beside each other. `None` when neither run has a judge.
    pub(super) fn new(recorded: Option<LastWord>, rerun: Option<LastWord>) -> Option<Self> {
        let topic = recorded.as_ref().or(rerun.as_ref())?.topic.clone();
        let recorded = recorded.unwrap_or_else(|| LastWord::silent(&topic));
        let rerun = rerun.unwrap_or_else(|| LastWord::silent(&topic));
        let mut figures: Vec<Compared> = Vec::new();
        for (side, word) in [&recorded, &rerun].into_iter().enumerate() {
            for (name, unit, value) in &word.figures {
                let known = figures.iter().position(|known| known.name == *name && known.unit == *unit);
                let place = known.unwrap_or(figures.len());
                if known.is_none() {
                    let (name, unit) = (name.clone(), unit.clone());
                    figures.push(Compared { name, unit, recorded: None, rerun: None, difference: None });
                }
                let value = (!value.is_nan()).then_some(*value);
                let figure = &mut figures[place];
                if side == 0 {
                    figure.recorded = value;
                } else {
                    figure.rerun = value;
                }
            }
        }
        for figure in &mut figures {
            let both = figure.recorded.zip(figure.rerun);
            figure.difference = both.map(|(was, is)| is - was).filter(|by| by.is_finite());
        }
        Some(Self { topic, recorded: recorded.word, rerun: rerun.word, figures })
    }

    /// Both verdicts, and the figures of both runs below each other, as lines for a person.
    pub(super) fn text(&self) -> String {
        let line = |who: &str, word: &Word| {
            let colon = if word.remark.is_empty() { "" } else { ": " };
            format!("{who}{}{colon}{}\n", word.verdict.word(), word.remark)
        };
        if self.recorded == self.rerun && self.figures.iter().all(|figure| figure.recorded == figure.rerun) {
            return line("both runs  ", &self.recorded);
        }
        let mut text = line("recorded   ", &self.recorded) + &line("rerun      ", &self.rerun);
        if self.figures.is_empty() {
            return text;
        }
        let names = self.figures.iter().map(|figure| figure.name.chars().count());
        let wide = names.max().unwrap_or(0);
        let units = self.figures.iter().map(|figure| figure.unit.chars().count()).max().unwrap_or(0);
        let column = |heading: &str, cell: &dyn Fn(&Compared) -> String| {
            let cells: Vec<String> = self.figures.iter().map(cell).collect();
            let cells = aligned(&cells);
            let width = cells.iter().map(|cell| cell.chars().count()).max().unwrap_or(0);
            let width = width.max(heading.chars().count());
            let all = std::iter::once(heading.to_owned()).chain(cells);
            all.map(|cell| format!("{cell:>width$}")).collect::<Vec<_>>()
        };
        let known = |value: Option<f64>| value.map_or("-".to_owned(), number);
        let recorded = column("recorded", &|figure| known(figure.recorded));
        let rerun = column("rerun", &|figure| known(figure.rerun));
        let difference = column("difference", &|figure| match figure.difference {
            Some(by) => signed(by),
            None => "-".to_owned(),
        });
        let heads = [(String::new(), String::new())].into_iter();
        let heads = heads.chain(self.figures.iter().map(|figure| (figure.name.clone(), figure.unit.clone())));
        for ((name, unit), cells) in heads.zip(recorded.iter().zip(&rerun).zip(&difference)) {
            let ((recorded, rerun), difference) = cells;
            let row = format!("  {name:wide$}  {recorded}  {rerun}  {difference}  {unit:units$}");
            text += row.trim_end();
            text.push('\n');
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// What a judge says, as it stands in a recording.
    fn word(state: &str, remark: &str, figures: &[(&str, Value, &str)]) -> LastWord {
        let metrics =
            figures.iter().map(|(name, value, unit)| json!({"name": name, "value": value, "unit": unit}));
        let mut metrics: Vec<Value> = metrics.collect();
        let count = metrics.len();
        metrics.resize(messages::METRIC_CAPACITY, json!({}));
        let said = json!({"metrics": metrics, "metric_count": count, "state": state, "remark": remark});
        let bytes = RunSummary::description().from_json(&said).unwrap();
        LastWord::from_json("run/summary", &RunSummary::description().to_json(&bytes))
    }

    fn both() -> Judged {
        let passed = word(
            "Passed",
            "delivered to 207",
            &[
                ("deliveries", json!(1.0), ""),
                ("halt", json!(0.012), "m"),
                ("time", json!(117.25), "s"),
                ("old", json!(1.0), "cm"),
            ],
        );
        let failed = word(
            "Failed",
            "not done after 240 s",
            &[
                ("deliveries", json!(0.0), ""),
                ("halt", json!("NaN"), "m"),
                ("time", json!(240.5), "s"),
                ("new", json!("inf"), "m"),
            ],
        );
        Judged::new(Some(passed), Some(failed)).unwrap()
    }

    #[test]
    fn both_verdicts_come_first_with_what_differs() {
        let expected = "\
recorded   PASSED: delivered to 207
rerun      FAILED: not done after 240 s
               recorded  rerun  difference
  deliveries    1          0          -1
  halt          0.01200    -           -    m
  time        117.2      240.5      +123.2  s
  old           1          -           -    cm
  new           -        inf           -    m
";
        assert_eq!(both().text(), expected);
    }

    #[test]
    fn both_verdicts_and_differences_are_json() {
        let json = serde_json::to_value(both()).unwrap();
        assert_eq!(json["recorded"], serde_json::json!({"verdict": "passed", "remark": "delivered to 207"}));
        assert_eq!(json["rerun"]["verdict"], "failed");
        let [deliveries, halt] = [&json["figures"][0], &json["figures"][1]];
        assert_eq!(deliveries["difference"], -1.0);
        assert_eq!((&halt["recorded"], &halt["rerun"]), (&0.012.into(), &Value::Null));
        assert_eq!((&halt["unit"], &halt["difference"]), (&"m".into(), &Value::Null));
    }

    #[test]
    fn equal_runs_are_told_in_a_line() {
        let passed = || Some(word("Passed", "there", &[("time", json!(3.0), "s")]));
        assert_eq!(Judged::new(passed(), passed()).unwrap().text(), "both runs  PASSED: there\n");
        let running = word("Running", "on its way", &[]);
        assert!(!running.is_decided() && passed().unwrap().is_decided());
        let text = Judged::new(Some(running), None).unwrap().text();
        assert_eq!(text, "recorded   undecided: on its way\nrerun      no word\n");
        assert_eq!(Judged::new(None, None), None);
    }
}
