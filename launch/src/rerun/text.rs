//! What came of a rerun, for a person.

use super::Report;
use crate::numbers::{number, with_unit};
use recording::{Difference, TopicComparison};

/// All that is told of a rerun.
pub(super) fn of(report: &Report) -> String {
    let mut text = String::new();
    let mut line = |words: String| text += &(words + "\n");
    for remark in &report.remarks {
        line(format!("note: {remark}"));
    }
    let who = match report.closed_or_open {
        "open" => format!("{} on the recorded inputs", report.services.join(", ")),
        _ => format!("all {} services", report.services.len()),
    };
    line(format!("{who}: {:.3} s of logical time in {:.3} s", report.logical_s, report.wall_s));
    if let Some(judge) = &report.judge {
        text += &judge.text();
    }
    // Of a whole graph only the topics that differ are of interest.
    let is_of_interest = |topic: &&TopicComparison| {
        report.closed_or_open == "open" || topic.changed + topic.missing + topic.added > 0
    };
    let topics: Vec<&TopicComparison> = report.topics.iter().filter(is_of_interest).collect();
    if !topics.is_empty() {
        text += &table(&topics);
    }
    let mut line = |words: String| text += &(words + "\n");
    for topic in topics {
        for field in topic.fields.iter().filter(|_| report.closed_or_open == "open") {
            let shown = |value: f64| with_unit(&number(value), &field.unit);
            line(format!(
                "`{}`: `{}` differs in {} messages, by {} on average and {} at most",
                topic.topic,
                field.field,
                field.messages,
                shown(field.mean),
                shown(field.largest)
            ));
        }
        if let Some(first) = &topic.first {
            line(format!("first {}", words(first)));
        }
    }
    match (&report.digests, report.same) {
        (Some(both), true) if both.recorded == both.rerun => {
            line(format!("SAME: digest {} ({} messages)", both.rerun.digest, both.rerun.messages));
        }
        (_, true) => line("SAME: every message that was compared".to_owned()),
        (both, false) => {
            let first = report.difference.as_ref().map(|first| format!(": {}", words(first)));
            line(format!("DIFFERENT{}", first.unwrap_or_default()));
            if let Some(both) = both {
                line(format!("  digest {} recorded, {} now", both.recorded.digest, both.rerun.digest));
            }
        }
    }
    text
}

fn table(topics: &[&TopicComparison]) -> String {
    let mut table = comfy_table::Table::new();
    table.load_style(comfy_table::presets::NOTHING);
    table.set_header([
        "topic",
        "recorded",
        "rerun",
        "same",
        "changed",
        "missing",
        "added",
        "first difference",
    ]);
    for topic in topics {
        let first = topic.first.as_ref().map(|first| format!("{:.6} s", first.stamp_ns as f64 * 1e-9));
        let counts = [topic.recorded, topic.rerun, topic.same, topic.changed, topic.missing, topic.added];
        let cells = counts.into_iter().map(|count| count.to_string());
        table.add_row(std::iter::once(topic.topic.clone()).chain(cells).chain([first.unwrap_or_default()]));
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(comfy_table::CellAlignment::Right);
    }
    format!("{table}\n")
}

fn words(difference: &Difference) -> String {
    let Difference { topic, stamp_ns, field, a, b, .. } = difference;
    let short = |value: &serde_json::Value| {
        let text = value.to_string();
        match text.char_indices().nth(160) {
            Some((end, _)) => format!("{} ..", &text[..end]),
            None => text,
        }
    };
    let (seconds, nanos) = (stamp_ns / 1_000_000_000, stamp_ns % 1_000_000_000);
    let (a, b) = (short(a), short(b));
    match (a.as_str(), b.as_str()) {
        ("null", _) if field == "message" => {
            format!("`{topic}` at {seconds}.{nanos:09} s: only the rerun has a message")
        }
        (_, "null") if field == "message" => {
            format!("`{topic}` at {seconds}.{nanos:09} s: only the recording has a message")
        }
        _ => format!("`{topic}` at {seconds}.{nanos:09} s: `{field}` was {a} and is {b}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use recording::FieldDifference;

    #[test]
    fn differences_have_units() {
        let field = |field: &str, unit: &str, mean| FieldDifference {
            field: field.to_owned(),
            unit: unit.to_owned(),
            messages: 120,
            mean,
            largest: 2.0 * mean,
        };
        let topic = TopicComparison {
            topic: "wheels/desired".to_owned(),
            recorded: 200,
            rerun: 200,
            same: 80,
            changed: 120,
            missing: 0,
            added: 0,
            first: None,
            fields: vec![field("left_mps", "m/s", 0.110_51), field("command_id", "", 3.0)],
        };
        let report = Report {
            same: false,
            closed_or_open: "open",
            services: vec!["controller".to_owned()],
            logical_s: 10.0,
            wall_s: 0.5,
            judge: None,
            digests: None,
            difference: None,
            topics: vec![topic],
            remarks: Vec::new(),
        };
        let text = of(&report);
        let expected = "`left_mps` differs in 120 messages, by 0.1105 m/s on average and 0.2210 m/s at most";
        assert!(text.contains(expected), "{text}");
        assert!(
            text.contains("`command_id` differs in 120 messages, by 3 on average and 6 at most"),
            "{text}"
        );
        assert!(text.contains("controller on the recorded inputs: 10.000 s"), "{text}");
    }
}
