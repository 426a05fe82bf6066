//! A graph as a drawing, with its legend: Mermaid and Graphviz.

use super::checked::{Checked, CheckedService, CheckedTopic, Publisher};
use board::Direction;
use std::fmt::Write as _;

/// What an arrow means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Carries {
    /// A service says something on a topic.
    Word,
    /// A reader gets every message.
    All,
    /// A reader gets the newest message.
    Newest,
    /// A reader gets the newest message or every one, and can do without.
    Maybe,
}

/// Who is connected with whom, by the names of the nodes.
struct Arrow {
    from: String,
    to: String,
    carries: Carries,
}

/// How a topic is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Look {
    Connected,
    Unpublished,
    Unread,
}

const OUTSIDE: &str = "from outside";
const LAUNCHER: &str = "launcher: ends the run";
/// What the legend says of topics that are not connected.
const APART: [(Look, &str, &str); 2] =
    [(Look::Unpublished, "unpublished", "nobody publishes it"), (Look::Unread, "unread", "nobody reads it")];
/// And of arrows to readers.
const ARROWS: [(Carries, &str); 3] = [
    (Carries::All, "reads every message"),
    (Carries::Newest, "reads the newest"),
    (Carries::Maybe, "can do without"),
];

/// The drawing as Mermaid, which Markdown pages show.
pub(crate) fn mermaid(graph: &Checked) -> String {
    let mut out = format!("%% {}: services and topics\nflowchart LR\n", graph.name);
    for (index, service) in graph.services.iter().enumerate() {
        let _ = writeln!(out, "  s{index}[\"{}\"]", label(service, "<br/>"));
    }
    for (index, topic) in graph.topics.iter().enumerate() {
        let class = match look(graph, topic) {
            Look::Connected => "topic",
            Look::Unpublished => "unpublished",
            Look::Unread => "unread",
        };
        let (name, message) = (&topic.name, &topic.message.name);
        let _ = writeln!(out, "  t{index}([\"{name}<br/><small>{message}</small>\"]):::{class}");
    }
    if has_outside(graph) {
        let _ = writeln!(out, "  outside{{{{\"{OUTSIDE}\"}}}}");
    }
    if graph.finish.is_some() {
        let _ = writeln!(out, "  launcher{{{{\"{LAUNCHER}\"}}}}");
    }
    let line = |carries: Carries| match carries {
        Carries::Word | Carries::Newest => "-->",
        Carries::All => "==>",
        Carries::Maybe => "-.->",
    };
    for Arrow { from, to, carries } in arrows(graph) {
        let _ = writeln!(out, "  {from} {} {to}", line(carries));
    }
    out.push_str("  subgraph legend\n    l0[\"service\"] -->|publishes| l1([\"topic<br/><small>message</small>\"]):::topic\n");
    for (index, (carries, words)) in ARROWS.into_iter().enumerate() {
        let _ = writeln!(out, "    l1 {}|{words}| l{}[\"service\"]", line(carries), index + 2);
    }
    for (_, class, words) in looks_of(graph) {
        let _ = writeln!(out, "    l{class}([\"{words}\"]):::{class}");
    }
    out.push_str("  end\n  classDef topic fill:#eef4ff,stroke:#4a78c2,color:#123\n");
    out.push_str(
        "  classDef unpublished fill:#fff,stroke:#d55e00,stroke-width:2px,stroke-dasharray:6 4,color:#123\n",
    );
    out.push_str("  classDef unread fill:#fff,stroke:#788088,stroke-dasharray:3 3,color:#123\n");
    out
}

/// The drawing for Graphviz (`| dot -Tsvg`).
pub(crate) fn dot(graph: &Checked) -> String {
    let mut out = format!(
        "digraph \"{0}\" {{\n  rankdir=LR; labelloc=t; fontname=\"sans-serif\"; fontsize=20; label=\"{0}: services and topics\";\n  \
         node [fontname=\"sans-serif\", fontsize=14];\n  edge [color=\"#555555\", fontname=\"sans-serif\", fontsize=12];\n",
        graph.name
    );
    let style = |look: Look| match look {
        Look::Connected => "style=\"rounded,filled\", fillcolor=\"#eef4ff\", color=\"#4a78c2\"",
        Look::Unpublished => "style=\"rounded,dashed\", color=\"#d55e00\", penwidth=2",
        Look::Unread => "style=\"rounded,dotted\", color=\"#788088\", penwidth=2",
    };
    for (index, service) in graph.services.iter().enumerate() {
        let _ = writeln!(out, "  s{index} [shape=box, label=\"{}\"];", label(service, "\\n"));
    }
    for (index, topic) in graph.topics.iter().enumerate() {
        let (style, name, message) = (style(look(graph, topic)), &topic.name, &topic.message.name);
        let small = format!("<font point-size=\"11\">{message}</font>");
        let _ = writeln!(out, "  t{index} [shape=box, {style}, label=<{name}<br/>{small}>];");
    }
    if has_outside(graph) {
        let _ = writeln!(out, "  outside [shape=hexagon, label=\"{OUTSIDE}\"];");
    }
    if graph.finish.is_some() {
        let _ = writeln!(out, "  launcher [shape=hexagon, label=\"{LAUNCHER}\"];");
    }
    let line = |carries: Carries| match carries {
        Carries::Word | Carries::Newest => "",
        Carries::All => "style=bold, penwidth=2.5",
        Carries::Maybe => "style=dashed",
    };
    for Arrow { from, to, carries } in arrows(graph) {
        let style = Some(line(carries)).filter(|style| !style.is_empty());
        let style = style.map(|style| format!(" [{style}]")).unwrap_or_default();
        let _ = writeln!(out, "  {from} -> {to}{style};");
    }
    let topic = style(Look::Connected);
    let _ = writeln!(
        out,
        "  subgraph cluster_legend {{\n    label=\"legend\"; fontsize=14; color=\"#788088\";\n    l0 [shape=box, label=\"service\"];\n    \
         l1 [shape=box, {topic}, label=<topic<br/><font point-size=\"11\">message</font>>];\n    l0 -> l1 [label=\"publishes\"];"
    );
    for (index, (carries, words)) in ARROWS.into_iter().enumerate() {
        let (reader, style) = (index + 2, line(carries));
        let comma = if style.is_empty() { "" } else { ", " };
        let _ = writeln!(
            out,
            "    l{reader} [shape=box, label=\"service\"];\n    l1 -> l{reader} [label=\"{words}\"{comma}{style}];"
        );
    }
    for (look, class, words) in looks_of(graph) {
        let _ = writeln!(out, "    l{class} [shape=box, {}, label=\"{words}\"];", style(look));
    }
    out.push_str("  }\n}\n");
    out
}

fn arrows(graph: &Checked) -> Vec<Arrow> {
    let index_of = |role: &str| graph.services.iter().position(|service| service.role == role);
    let mut arrows = Vec::new();
    for (index, topic) in graph.topics.iter().enumerate() {
        let from = match &topic.publisher {
            Publisher::Service(role) => index_of(role).map(|service| format!("s{service}")),
            Publisher::External => Some("outside".to_owned()),
            Publisher::Nobody => None,
        };
        let to = format!("t{index}");
        arrows.extend(from.map(|from| Arrow { from, to: to.clone(), carries: Carries::Word }));
        for reader in &topic.readers {
            let carries = match (reader.required, reader.direction) {
                (false, _) => Carries::Maybe,
                (true, Direction::Queue) => Carries::All,
                (true, _) => Carries::Newest,
            };
            let service = index_of(&reader.role).map(|service| format!("s{service}"));
            arrows.extend(service.map(|service| Arrow { from: to.clone(), to: service, carries }));
        }
        if graph.finish.as_ref() == Some(&topic.name) {
            arrows.push(Arrow { from: to, to: "launcher".to_owned(), carries: Carries::Newest });
        }
    }
    arrows
}

fn look(graph: &Checked, topic: &CheckedTopic) -> Look {
    if topic.publisher == Publisher::Nobody {
        Look::Unpublished
    } else if topic.readers.is_empty() && graph.finish.as_ref() != Some(&topic.name) {
        Look::Unread
    } else {
        Look::Connected
    }
}

/// Of the ways in which topics can be apart those that this graph has.
fn looks_of(graph: &Checked) -> impl Iterator<Item = (Look, &'static str, &'static str)> {
    let looks: Vec<Look> = graph.topics.iter().map(|topic| look(graph, topic)).collect();
    APART.into_iter().filter(move |(look, ..)| looks.contains(look))
}

fn has_outside(graph: &Checked) -> bool {
    graph.topics.iter().any(|topic| topic.publisher == Publisher::External)
}

fn label(service: &CheckedService, line_break: &str) -> String {
    let binary = service.run.rsplit('/').next().unwrap_or_default();
    if binary == service.role {
        return service.role.clone();
    }
    format!("{}{line_break}({})", service.role, binary.replace(['"', '\\'], "'"))
}
