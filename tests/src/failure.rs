//! What a failed test has to say of its graph.

use crate::keeper::folder;
use recording::Recording;
use std::collections::{BTreeMap, VecDeque};
use std::fmt::Write as _;
use std::path::Path;

/// Messages of each topic that are shown.
const LAST: usize = 2;
/// A longer message is cut.
const LINE_MAX: usize = 240;
/// Lines of the launcher that are shown.
const OUTPUT_MAX: usize = 20;

/// The last words of everybody, and where the recording is kept: under the name of the test.
pub(crate) fn report(board: &str, file: &Path, output: &str, logs: &str) -> String {
    let test = std::thread::current().name().unwrap_or("test").replace("::", "-");
    let kept = folder().join(format!("{test}-{board}.mcap"));
    let kept = if std::fs::rename(file, &kept).is_ok() { kept } else { file.to_owned() };
    let lines: Vec<&str> = output.lines().collect();
    let output = lines[lines.len().saturating_sub(OUTPUT_MAX)..].join("\n");
    format!(
        "=== the last messages of each service\n{}=== the last lines of each log\n{logs}=== the launcher\n{output}\n=== the recording is kept: {}\n\
         === look at it with `cargo launch digest`, `diff` and `rerun`, or in Foxglove",
        last_messages(&kept),
        kept.display()
    )
}

fn last_messages(file: &Path) -> String {
    let recording = match Recording::open(file) {
        Ok(recording) => recording,
        Err(error) => return format!("{error}\n"),
    };
    let mut last: BTreeMap<(String, String), VecDeque<String>> = BTreeMap::new();
    for message in recording.as_recorded(|topic| !topic.is_health()).flatten() {
        let topic = &recording.topics()[message.topic];
        let publisher = topic.publisher.clone().unwrap_or_else(|| "from outside".to_owned());
        let lines = last.entry((publisher, topic.name.clone())).or_default();
        if lines.len() == LAST {
            lines.pop_front();
        }
        let at_s = message.envelope.stamp_ns as f64 * 1e-9;
        let mut line = format!("{at_s:.3} s {}", topic.message.to_json(message.bytes()));
        if let Some((end, _)) = line.char_indices().nth(LINE_MAX) {
            line.truncate(end);
            line += " ..";
        }
        lines.push_back(line);
    }
    let mut text = String::new();
    let mut speaker = String::new();
    for ((publisher, topic), lines) in last {
        if publisher != speaker {
            let _ = writeln!(text, "--- {publisher}");
            speaker = publisher;
        }
        for line in lines {
            let _ = writeln!(text, "{topic} {line}");
        }
    }
    text
}
