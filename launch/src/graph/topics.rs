//! Who publishes, who reads, and whether they speak of the same thing.

use super::checked::{CheckedTopic, Publisher, Reader};
use super::problem::{Problem, Problems};
use super::settings::{Graph, ServiceTable};
use super::source::Place;
use super::suggest::{nearest, quoted};
use board::{Direction, Interface, PortDescription};
use messages::{
    Clearance, ELEMENTS, Message as _, MissionStatus, Path, PoseEstimate, RunSummary, WorldTruth,
};
use std::collections::BTreeMap;

/// A service of the graph with what its binary says of itself.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Member<'a> {
    /// Its table.
    pub(crate) table: &'a ServiceTable,
    /// Its ports.
    pub(crate) interface: &'a Interface,
}

/// One port of one service.
#[derive(Debug, Clone, Copy)]
struct Port<'a> {
    role: &'a str,
    place: &'a Place,
    description: &'a PortDescription,
}

#[derive(Debug, Default)]
struct Ports<'a> {
    publishers: Vec<Port<'a>>,
    readers: Vec<Port<'a>>,
}

/// Connects ports to topics. `complete` is false when a service's interface is not known: then a topic
/// without a publisher is no mistake of the graph.
pub(crate) fn connect(
    graph: &Graph,
    members: &[Member<'_>],
    complete: bool,
    problems: &mut Problems,
) -> Vec<CheckedTopic> {
    let mut by_topic: BTreeMap<&str, Ports<'_>> = BTreeMap::new();
    for member in members {
        for description in &member.interface.ports {
            let port = Port { role: &member.table.role, place: &member.table.place, description };
            let ports = by_topic.entry(&description.topic).or_default();
            match description.direction {
                Direction::Publish => ports.publishers.push(port),
                Direction::Latest | Direction::Queue => ports.readers.push(port),
            }
        }
    }
    let published: Vec<(&str, Port<'_>)> = by_topic
        .iter()
        .flat_map(|(topic, ports)| ports.publishers.iter().map(move |port| (*topic, *port)))
        .collect();
    for (topic, ports) in &by_topic {
        check_publishers(topic, ports, problems);
        check_layouts(topic, ports, problems);
        if complete && ports.publishers.is_empty() && !graph.external.iter().any(|(known, _)| known == topic)
        {
            check_missing(topic, ports, &published, problems);
        }
    }
    check_external(graph, &by_topic, complete, problems);
    check_finish(graph, &by_topic, complete, problems);
    if complete {
        check_view(graph, &by_topic, problems);
        note_unread(graph, &by_topic, problems);
    }
    by_topic.into_iter().filter_map(|(topic, ports)| checked(graph, topic, &ports)).collect()
}

fn check_publishers(topic: &str, ports: &Ports<'_>, problems: &mut Problems) {
    let [first, more @ ..] = ports.publishers.as_slice() else { return };
    for second in more {
        let message = format!("`{topic}` is published by `{}` and by `{}`", first.role, second.role);
        let help = "a topic has one publisher: remove one, or let an arbiter read two topics and publish one";
        problems
            .push(Problem::error(second.place, message, help).see(first.place, format!("[{}]", first.role)));
    }
}

fn check_layouts(topic: &str, ports: &Ports<'_>, problems: &mut Problems) {
    let mut all = ports.publishers.iter().chain(&ports.readers);
    let Some(first) = all.next() else { return };
    for other in all.filter(|other| other.description.fingerprint != first.description.fingerprint) {
        let (mine, theirs) = (&other.description.message, &first.description.message);
        let difference = mine.first_difference(theirs);
        let difference = difference.unwrap_or_else(|| "their fingerprints differ".to_owned());
        let verb = |port: &Port<'_>| match port.description.direction {
            Direction::Publish => "publishes",
            Direction::Latest | Direction::Queue => "reads",
        };
        let message = format!(
            "`{}` {} `{topic}` as {} ({}), `{}` {} it as {} ({})",
            other.role,
            verb(other),
            mine.name,
            other.description.fingerprint,
            first.role,
            verb(first),
            theirs.name,
            first.description.fingerprint,
        );
        let help = format!(
            "{difference} (here: `{}`, there: `{}`); build both from one source, or connect other topics",
            other.role, first.role
        );
        problems
            .push(Problem::error(other.place, message, help).see(first.place, format!("[{}]", first.role)));
    }
}

fn check_missing(topic: &str, ports: &Ports<'_>, published: &[(&str, Port<'_>)], problems: &mut Problems) {
    let needing: Vec<_> = ports.readers.iter().filter(|port| port.description.required).collect();
    let Some(first) = needing.first() else { return };
    let roles: Vec<_> = needing.iter().map(|port| format!("`{}`", port.role)).collect();
    let verb = if roles.len() == 1 { "needs" } else { "need" };
    let message = format!("nobody publishes `{topic}`, which {} {verb}", roles.join(" and "));
    let subject = topic.split('/').next().unwrap_or(topic);
    let what = first.description.message.name.as_str();
    let near = nearest(topic, published.iter().map(|(known, _)| *known));
    // What one of those that wait for the topic says itself is an answer to it, not the topic.
    let is_kin = |known: &str, port: &Port<'_>| {
        let is_near = Some(known) == near
            || (known.split('/').next() == Some(subject)
                && known.contains('/')
                && port.description.message.name == what);
        is_near && !needing.iter().any(|needing| needing.role == port.role)
    };
    let kin = published.iter().filter(|(known, port)| is_kin(known, port));
    let kin: Vec<_> =
        kin.map(|(known, port)| format!("`{}` publishes `{known}`", port.role)).take(3).collect();
    let mut help = format!(
        "add a service that publishes it (a {what}), or list it as `external` below [graph] if a tool does"
    );
    if !kin.is_empty() {
        help = format!("{}\n{help}", kin.join(", "));
    }
    let mut problem = Problem::error(first.place, message, help);
    for other in &needing[1..] {
        problem = problem.see(other.place, format!("also [{}]", other.role));
    }
    problems.push(problem);
}

fn check_external(
    graph: &Graph,
    by_topic: &BTreeMap<&str, Ports<'_>>,
    complete: bool,
    problems: &mut Problems,
) {
    for (topic, place) in &graph.external {
        match by_topic.get(topic.as_str()) {
            Some(Ports { publishers, .. }) if !publishers.is_empty() => {
                let role = publishers[0].role;
                let message = format!("`{topic}` is external, and `{role}` publishes it too");
                let help = "remove it here, or the service";
                problems
                    .push(Problem::error(place, message, help).see(publishers[0].place, format!("[{role}]")));
            }
            None if complete => {
                let message = format!("`{topic}` is external, and no service reads it");
                let help = match nearest(topic, by_topic.keys().copied()) {
                    Some(known) => format!("did you mean `{known}`?"),
                    None => "remove it, or add the service that reads it".to_owned(),
                };
                problems.push(Problem::error(place, message, help));
            }
            _ => {}
        }
    }
}

fn check_finish(
    graph: &Graph,
    by_topic: &BTreeMap<&str, Ports<'_>>,
    complete: bool,
    problems: &mut Problems,
) {
    let Some((topic, place)) = &graph.finish else { return };
    let publisher = by_topic.get(topic.as_str()).and_then(|ports| ports.publishers.first());
    let Some(publisher) = publisher else {
        if complete {
            let summaries = by_topic.iter().filter(|(_, ports)| {
                ports.publishers.iter().any(|port| port.description.message.name == RunSummary::NAME)
            });
            let summaries: Vec<_> = summaries.map(|(topic, _)| format!("`{topic}`")).collect();
            let message = format!("nobody publishes `{topic}`, which is to end the run");
            let help = if summaries.is_empty() {
                "add a referee, or remove `finish`".to_owned()
            } else {
                format!("a {} is on {}", RunSummary::NAME, summaries.join(", "))
            };
            problems.push(Problem::error(place, message, help));
        }
        return;
    };
    if publisher.description.message.name != RunSummary::NAME {
        let name = &publisher.description.message.name;
        let message = format!("`{topic}` cannot end the run: it is a {name}, not a {}", RunSummary::NAME);
        let help = "name the topic of a referee, such as `run/summary`";
        problems
            .push(Problem::error(place, message, help).see(publisher.place, format!("[{}]", publisher.role)));
    }
}

/// Topics of the view that somebody has chosen are there, and are what the view draws.
fn check_view(graph: &Graph, by_topic: &BTreeMap<&str, Ports<'_>>, problems: &mut Problems) {
    for (key, topic, place) in &graph.view_topics {
        let drawn = match key.as_str() {
            "truth" => WorldTruth::NAME,
            "pose" => PoseEstimate::NAME,
            "path" => Path::NAME,
            "mission" => MissionStatus::NAME,
            _ => Clearance::NAME,
        };
        let all = by_topic
            .iter()
            .filter(|(_, ports)| ports.publishers.iter().any(|port| port.description.message.name == drawn));
        let all: Vec<&str> = all.map(|(topic, _)| *topic).collect();
        if all.contains(&topic.as_str()) || graph.external.iter().any(|(external, _)| external == topic) {
            continue;
        }
        let message = match by_topic.get(topic.as_str()).and_then(|ports| ports.publishers.first()) {
            Some(port) => {
                format!(
                    "`{topic}` is a {}, and the view draws a {drawn} as {key}",
                    port.description.message.name
                )
            }
            None => format!("nobody publishes `{topic}`, which the view is to draw"),
        };
        let help = match nearest(topic, all.iter().copied()) {
            Some(known) => format!("did you mean `{known}`?"),
            None if all.is_empty() => "remove the line".to_owned(),
            None => format!("a {drawn} is on {}", quoted(all)),
        };
        problems.push(Problem::error(place, message, help));
    }
}

fn note_unread(graph: &Graph, by_topic: &BTreeMap<&str, Ports<'_>>, problems: &mut Problems) {
    let watched = graph.view.topics();
    for (topic, ports) in by_topic {
        let finish = graph.finish.as_ref().is_some_and(|(finish, _)| finish == topic);
        if let Some(publisher) = ports.publishers.first()
            && ports.readers.is_empty()
            && !finish
            && !watched.contains(topic)
        {
            let message = format!("nobody reads `{topic}` of `{}`", publisher.role);
            problems.push(Problem::note(publisher.place, message, "it can still be watched and recorded"));
        }
    }
}

fn checked(graph: &Graph, topic: &str, ports: &Ports<'_>) -> Option<CheckedTopic> {
    let first = ports.publishers.first().or(ports.readers.first())?;
    let publisher = match ports.publishers.first() {
        Some(port) => Publisher::Service(port.role.to_owned()),
        None if graph.external.iter().any(|(known, _)| known == topic) => Publisher::External,
        None => Publisher::Nobody,
    };
    let readers = ports.readers.iter().map(|port| Reader {
        role: port.role.to_owned(),
        direction: port.description.direction,
        required: port.description.required,
        depth: port.description.depth,
        wakes: port.description.wakes,
    });
    let depths = ports.publishers.iter().chain(&ports.readers).map(|port| port.description.depth);
    Some(CheckedTopic {
        name: topic.to_owned(),
        publisher,
        readers: readers.collect(),
        message: first.description.message.clone(),
        fingerprint: first.description.fingerprint.clone(),
        depth: depths.max().unwrap_or(1).max(1),
        elements: ports.publishers.iter().map(|port| port.description.elements).max().unwrap_or(ELEMENTS),
    })
}
