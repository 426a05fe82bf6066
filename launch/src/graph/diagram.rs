//! A graph as a drawing: Mermaid and Graphviz.

use super::check::{Checked, CheckedService, CheckedTopic, Publisher, Reader};
use board::Direction;
use std::fmt::Write as _;

/// The drawing as Mermaid, which Markdown pages show: services are boxes, topics are rounded; thick arrows carry every message, thin ones the newest,
/// dotted ones are of readers that can do without.
pub(crate) fn mermaid(graph: &Checked) -> String {
    let mut out = format!("%% {}: services and topics\nflowchart LR\n", graph.name);
    for (index, service) in graph.services.iter().enumerate() {
        let _ = writeln!(out, "  s{index}[\"{}\"]", label(service, "<br/>"));
    }
    for (index, topic) in graph.topics.iter().enumerate() {
        let _ = writeln!(out, "  t{index}([\"{}<br/><small>{}</small>\"])", topic.name, topic.message.name);
    }
    if graph.topics.iter().any(|topic| topic.publisher == Publisher::External) {
        out.push_str("  outside{{\"from outside\"}}\n");
    }
    for (index, topic) in graph.topics.iter().enumerate() {
        match publisher(graph, topic) {
            Some(service) => drop(writeln!(out, "  s{service} --> t{index}")),
            None if topic.publisher == Publisher::External => drop(writeln!(out, "  outside --> t{index}")),
            None => {}
        }
        for (service, reader) in readers(graph, topic) {
            let arrow = match (reader.required, reader.direction) {
                (false, _) => "-.->",
                (true, Direction::Queue) => "==>",
                (true, _) => "-->",
            };
            let _ = writeln!(out, "  t{index} {arrow} s{service}");
        }
    }
    out.push_str("  classDef topic fill:#eef4ff,stroke:#4a78c2,color:#123\n");
    if !graph.topics.is_empty() {
        let topics: Vec<_> = (0..graph.topics.len()).map(|index| format!("t{index}")).collect();
        let _ = writeln!(out, "  class {} topic", topics.join(","));
    }
    out
}

/// The drawing for Graphviz (`| dot -Tsvg`): services are boxes, topics are rounded; bold arrows carry every message, plain ones the newest, dashed
/// ones are of readers that can do without.
pub(crate) fn dot(graph: &Checked) -> String {
    let mut out = format!(
        "digraph \"{}\" {{\n  rankdir=LR;\n  node [fontname=\"sans-serif\", fontsize=11];\n  edge [color=\"#555555\"];\n",
        graph.name
    );
    for (index, service) in graph.services.iter().enumerate() {
        let _ = writeln!(out, "  s{index} [shape=box, label=\"{}\"];", label(service, "\\n"));
    }
    for (index, topic) in graph.topics.iter().enumerate() {
        let _ = writeln!(
            out,
            "  t{index} [shape=box, style=\"rounded,filled\", fillcolor=\"#eef4ff\", color=\"#4a78c2\", label=\"{}\\n{}\"];",
            topic.name, topic.message.name
        );
    }
    if graph.topics.iter().any(|topic| topic.publisher == Publisher::External) {
        out.push_str("  outside [shape=hexagon, label=\"from outside\"];\n");
    }
    for (index, topic) in graph.topics.iter().enumerate() {
        match publisher(graph, topic) {
            Some(service) => drop(writeln!(out, "  s{service} -> t{index};")),
            None if topic.publisher == Publisher::External => drop(writeln!(out, "  outside -> t{index};")),
            None => {}
        }
        for (service, reader) in readers(graph, topic) {
            let style = match (reader.required, reader.direction) {
                (false, _) => " [style=dashed]",
                (true, Direction::Queue) => " [style=bold]",
                (true, _) => "",
            };
            let _ = writeln!(out, "  t{index} -> s{service}{style};");
        }
    }
    out.push_str("}\n");
    out
}

fn label(service: &CheckedService, line_break: &str) -> String {
    let binary = service.run.rsplit('/').next().unwrap_or_default();
    if binary == service.role {
        return service.role.clone();
    }
    format!("{}{line_break}({})", service.role, binary.replace(['"', '\\'], "'"))
}

fn index_of(graph: &Checked, role: &str) -> Option<usize> {
    graph.services.iter().position(|service| service.role == role)
}

fn publisher(graph: &Checked, topic: &CheckedTopic) -> Option<usize> {
    match &topic.publisher {
        Publisher::Service(role) => index_of(graph, role),
        Publisher::External | Publisher::Nobody => None,
    }
}

fn readers<'a>(graph: &'a Checked, topic: &'a CheckedTopic) -> impl Iterator<Item = (usize, &'a Reader)> {
    topic.readers.iter().filter_map(|reader| Some((index_of(graph, &reader.role)?, reader)))
}
