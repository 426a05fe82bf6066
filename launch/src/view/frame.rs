//! One frame: services, map, mission, events.

use super::keys::{Choice, Order, Prompt};
use super::map::{draw_map, is_worthwhile};
use super::plan::Plan;
use super::snapshot::Snapshot;
use crate::console::harmless;
use crate::control::{EventLine, ServiceStatus, Status, Tempo};
use messages::{DeliveryStatusName, RunState, Verdict};
use ratatui::Frame;
use ratatui::layout::{Alignment, Constraint, Layout, Rect};
use ratatui::style::{Color, Style, Stylize as _};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Cell, Clear, Paragraph, Row, Table};

/// Fewest rows on which a map says something.
const MAP_ROWS_MIN: u16 = 8;
/// Width of a service in the short list.
const SHORT_WIDTH: u16 = 38;

/// Draws the snapshot onto all of the frame, whatever its size.
pub(crate) fn draw(frame: &mut Frame<'_>, snapshot: &Snapshot, plan: Option<&Plan>) {
    let area = frame.area();
    let services = snapshot.choice.shown(&snapshot.status);
    let with_map = snapshot.choice.logs || is_worthwhile(plan, &snapshot.scene);
    let words = words_of(snapshot, area.width);
    let event_rows = (area.height / 6).clamp(3, 10);
    let full = u16::try_from(services.len()).unwrap_or(u16::MAX).saturating_add(1);
    let word_rows = u16::try_from(words.len()).unwrap_or(0);
    let line = line_of(&snapshot.choice);
    let line_rows = u16::from(line.is_some());
    let body = area.height.saturating_sub(1 + word_rows + event_rows + line_rows);
    let columns = (area.width / SHORT_WIDTH).clamp(1, 4);
    let short = u16::try_from(services.len().div_ceil(usize::from(columns))).unwrap_or(u16::MAX);
    let is_short = with_map && full.saturating_add(MAP_ROWS_MIN) > body;
    let list_rows = if is_short { short.min(body) } else { full.min(body) };
    let map_rows = if with_map { Constraint::Fill(1) } else { Constraint::Length(0) };
    let events = if with_map { Constraint::Length(event_rows) } else { Constraint::Fill(1) };
    let rows = [
        Constraint::Length(1),
        Constraint::Length(list_rows),
        map_rows,
        Constraint::Length(word_rows),
        events,
        Constraint::Length(line_rows),
    ];
    let [head, list, map, word, log, bottom] = Layout::vertical(rows).areas(area);
    draw_head(frame, head, snapshot);
    let selected = snapshot.choice.selected.as_deref();
    if is_short {
        draw_short_list(frame, list, &services, selected, columns);
    } else {
        draw_table(frame, list, &services, selected);
    }
    if snapshot.choice.logs {
        draw_log(frame, map, snapshot);
    } else if with_map {
        draw_map(frame, map, plan, &snapshot.scene, robot_colour(snapshot));
    }
    frame.render_widget(Paragraph::new(words), word);
    draw_events(frame, log, &snapshot.status.events);
    if let Some(line) = line {
        frame.render_widget(line, bottom);
    }
    if snapshot.choice.help {
        draw_help(frame, area, snapshot);
    }
}

fn draw_head(frame: &mut Frame<'_>, area: Rect, snapshot: &Snapshot) {
    let status = &snapshot.status;
    let running = status.services.iter().filter(|service| service.state == "running").count();
    let all = status.services.len();
    let mut spans = vec![
        Span::from(format!(" {} ", status.board)).bold().reversed(),
        Span::from(format!("  {}  ", clock_of(status))),
        Span::styled(
            format!("{running}/{all} running"),
            if running == all { Style::new().green() } else { Style::new().yellow() },
        ),
    ];
    if snapshot.choice.frozen {
        spans.push(Span::from("  PICTURE STOPPED, THE ROBOT IS NOT (p)").yellow().bold());
    }
    if !snapshot.choice.filter.is_empty() {
        spans.push(Span::from(format!("  /{}", snapshot.choice.filter)).yellow());
    }
    if snapshot.choice.order != Order::Graph {
        spans.push(Span::from(format!("  by {}", snapshot.choice.order.name())).dark_gray());
    }
    if status.recording.is_some() {
        spans.push(Span::from("  ● rec").red());
    }
    let left = Line::from(spans);
    let keys = if snapshot.is_attached { "q leave  ? keys " } else { "q stop  ? keys " };
    let right = Line::from(keys).alignment(Alignment::Right).dark_gray();
    // On a narrow screen the keys give way.
    if left.width() + right.width() <= usize::from(area.width) {
        frame.render_widget(right, area);
    }
    let left_area = Rect { width: area.width.min(u16::try_from(left.width()).unwrap_or(u16::MAX)), ..area };
    frame.render_widget(left, left_area);
}

/// Which time the robot lives in, and how late it is there.
fn clock_of(status: &Status) -> String {
    let up_s = status.uptime_s.max(0.0) as u64;
    let up = format!("up {}:{:02}:{:02}", up_s / 3600, up_s / 60 % 60, up_s % 60);
    let Some(logical_s) = status.logical_s else { return format!("{}  {up}", status.mode) };
    let pace = match status.tempo {
        Some(tempo) if tempo.paused => "paused".to_owned(),
        Some(Tempo { speed: Some(speed), .. }) => format!("{speed} x"),
        _ => format!("{:.0} x", logical_s / status.uptime_s.max(0.1)),
    };
    format!("{}  {logical_s:.2} s  {pace}", status.mode)
}

/// The line at the bottom: what is asked of the person, or what came of a request.
fn line_of(choice: &Choice) -> Option<Line<'static>> {
    let question = |text: String| Line::from(text).black().on_yellow();
    Some(match (&choice.prompt, &choice.message) {
        (Some(Prompt::Filter(word)), _) => question(format!(" services with: {word}█  (Enter, Esc) ")),
        (Some(Prompt::Order(word)), _) => question(format!(" order: {word}█  (Enter, Esc) ")),
        (Some(Prompt::Restart(role)), _) => question(format!(" start `{role}` anew? y, or any other key ")),
        (Some(Prompt::Stop), _) => {
            question(" stop the robot and its services? y, or any other key ".to_owned())
        }
        (None, Some(message)) if message.is_trouble => Line::from(format!(" {}", message.text)).red(),
        (None, Some(message)) => Line::from(format!(" {}", message.text)).green(),
        (None, None) => return None,
    })
}

/// The last lines of the selected service's log, in the place of the map.
fn draw_log(frame: &mut Frame<'_>, area: Rect, snapshot: &Snapshot) {
    let role = snapshot.choice.selected.as_deref().unwrap_or_default();
    let block = Block::bordered()
        .title(format!(" log of {role} (Esc: the map) "))
        .border_style(Style::new().dark_gray());
    let rows = usize::from(block.inner(area).height);
    let log = &snapshot.log;
    let lines: Vec<Line<'_>> = if log.is_empty() {
        vec![Line::from(format!("{role} has said nothing")).dark_gray()]
    } else {
        log[log.len().saturating_sub(rows)..].iter().map(|line| Line::from(line.as_str())).collect()
    };
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

fn draw_table(frame: &mut Frame<'_>, area: Rect, services: &[&ServiceStatus], selected: Option<&str>) {
    // The columns in order of their worth: a narrow screen shows the first ones.
    const COLUMNS: [(&str, u16); 12] = [
        ("service", 22),
        ("state", 10),
        ("Hz", 7),
        ("step p50", 9),
        ("p99", 9),
        ("restarts", 8),
        ("CPU %", 6),
        ("late", 7),
        ("lost", 6),
        ("MiB", 6),
        ("pid", 8),
        ("binary", 22),
    ];
    let mut width = 0;
    let shown = COLUMNS
        .iter()
        .take_while(|(_, column)| {
            width += column + 1;
            width <= area.width + 1
        })
        .count()
        .max(1);
    let numeric = |index: usize| (2..11).contains(&index);
    let aligned = |index: usize, text: String| {
        Line::from(text).alignment(if numeric(index) { Alignment::Right } else { Alignment::Left })
    };
    let header = COLUMNS.iter().take(shown).enumerate();
    let header =
        Row::new(header.map(|(index, (name, _))| Cell::from(aligned(index, (*name).to_owned())))).dark_gray();
    let rows = services.iter().map(|service| {
        let count = |count: u64| if count == 0 { "-".to_owned() } else { count.to_string() };
        let texts = [
            service.role.clone(),
            service.state.clone(),
            format!("{:.1}", service.rate_hz),
            duration(service.step_p50_us),
            duration(service.step_p99_us),
            count(u64::from(service.restarts)),
            format!("{:.1}", service.cpu_percent),
            count(service.late_steps),
            count(service.lost_messages),
            format!("{:.1}", service.memory_kib as f64 / 1024.0),
            service.pid.map_or("-".to_owned(), |pid| pid.to_string()),
            service.run.clone(),
        ];
        let cells = texts.into_iter().take(shown).enumerate().map(|(index, text)| {
            let cell = Cell::from(aligned(index, text));
            match index {
                1 => cell.style(state_colour(&service.state)),
                5 if service.restarts > 0 => cell.style(Style::new().yellow()),
                8 if service.lost_messages > 0 => cell.style(Style::new().yellow()),
                _ => cell,
            }
        });
        let row = Row::new(cells);
        if Some(service.role.as_str()) == selected { row.reversed() } else { row }
    });
    let widths = COLUMNS.iter().take(shown).map(|(_, width)| Constraint::Length(*width));
    frame.render_widget(Table::new(rows, widths).header(header).column_spacing(1), area);
}

/// Name, rate and step time only, in columns: for small screens.
fn draw_short_list(
    frame: &mut Frame<'_>,
    area: Rect,
    services: &[&ServiceStatus],
    selected: Option<&str>,
    columns: u16,
) {
    let rows = services.len().div_ceil(usize::from(columns)).max(1);
    let areas =
        Layout::horizontal(vec![Constraint::Ratio(1, u32::from(columns)); usize::from(columns)]).split(area);
    for (chunk, area) in services.chunks(rows).zip(areas.iter()) {
        let lines = chunk.iter().map(|service| {
            let restarts =
                if service.restarts > 0 { format!(" ↻{}", service.restarts) } else { String::new() };
            let numbers = if service.state == "running" {
                format!("{:>7.1} Hz {:>6}", service.rate_hz, duration(service.step_p50_us))
            } else {
                format!("{:>10}", service.state)
            };
            let room = usize::from(area.width).saturating_sub(numbers.chars().count() + 3);
            let name: String = format!("{}{restarts}", service.role).chars().take(room).collect();
            let line = Line::from(vec![
                Span::styled("● ", state_colour(&service.state)),
                Span::from(format!("{name:room$}")),
                Span::from(numbers).dark_gray(),
            ]);
            if Some(service.role.as_str()) == selected { line.reversed() } else { line }
        });
        frame.render_widget(Paragraph::new(lines.collect::<Vec<_>>()), *area);
    }
}

/// The guard's signal and the mission; below it the referee's figures, in as many lines as they need.
fn words_of(snapshot: &Snapshot, width: u16) -> Vec<Line<'static>> {
    let mut lines = Vec::new();
    let mut spans = Vec::new();
    if let Some(clearance) = &snapshot.clearance {
        spans.push(match clearance.signal.get() {
            Ok(Verdict::Go) => Span::from("  GO  ").black().on_green().bold(),
            Ok(Verdict::Stop) => Span::from(" STOP ").white().on_red().bold(),
            Err(_) => Span::from("  ??  ").black().on_yellow().bold(),
        });
        spans.push(Span::from(format!(" {:?}", clearance.reason)));
        spans.push(Span::from(format!("  front {}", distance(clearance.front_m))).dark_gray());
    }
    if let Some(mission) = &snapshot.mission {
        let gap = if spans.is_empty() { " " } else { "   " };
        let room = harmless(mission.room.as_str());
        let goal = if room.is_empty() { String::new() } else { format!(" to {room}") };
        let status = match mission.status.get() {
            Ok(DeliveryStatusName::Idle) => "waiting for orders".to_owned(),
            Ok(name) => format!("{}{goal}", spaced(&format!("{name:?}"))),
            Err(error) => error.to_string(),
        };
        spans.push(Span::from(format!("{gap}{status}")).bold());
        if mission.distance_m.is_finite() && !room.is_empty() {
            spans.push(Span::from(format!(", {:.1} m to go", mission.distance_m)));
        }
        spans.push(
            Span::from(format!("   delivered {}, waiting {}", mission.delivered, mission.waiting))
                .dark_gray(),
        );
        if !mission.remark.is_empty() {
            spans.push(Span::from(format!("   {}", harmless(mission.remark.as_str()))).yellow());
        }
    }
    if !spans.is_empty() {
        lines.push(Line::from(spans));
    }
    if let Some(summary) = &snapshot.summary {
        let mut words = vec![match summary.state.get() {
            Ok(RunState::Passed) => vec![Span::from(" PASSED ").black().on_green(), Span::from(" ")],
            Ok(RunState::Failed) => vec![Span::from(" FAILED ").white().on_red(), Span::from(" ")],
            _ => vec![Span::from(" ")],
        }];
        words[0].push(Span::from(harmless(summary.remark.as_str())));
        for figure in summary.figures().iter().filter(|figure| figure.value.is_finite()) {
            let value = if figure.value.fract() == 0.0 {
                format!("{:.0}", figure.value)
            } else {
                format!("{:.3}", figure.value)
            };
            words.push(vec![
                Span::from(format!("  {} ", harmless(figure.name.as_str()))).dark_gray(),
                Span::from(format!("{value} {}", harmless(figure.unit.as_str())).trim_end().to_owned()),
            ]);
        }
        lines.extend(wrapped(words, usize::from(width)));
    }
    lines
}

/// Groups of spans in lines of at most this width; a group stays whole where it fits at all.
fn wrapped(groups: Vec<Vec<Span<'static>>>, width: usize) -> Vec<Line<'static>> {
    let mut lines = vec![Line::default()];
    for group in groups {
        let needed: usize = group.iter().map(Span::width).sum();
        let last = lines.last().map_or(0, Line::width);
        if last > 0 && last + needed > width {
            lines.push(Line::default());
        }
        if let Some(line) = lines.last_mut() {
            line.spans.extend(group);
        }
    }
    lines
}

fn draw_events(frame: &mut Frame<'_>, area: Rect, events: &[EventLine]) {
    let rows = usize::from(area.height.saturating_sub(1));
    let newest = &events[events.len().saturating_sub(rows)..];
    let lines = newest.iter().map(|event| {
        let role = if event.role.is_empty() { "launch" } else { &event.role };
        let text = Span::from(harmless(&event.text));
        Line::from(vec![
            Span::from(format!("{:>9.3} ", event.at_s)).dark_gray(),
            Span::from(format!("{role:<20} ")),
            if event.is_trouble { text.red() } else { text },
        ])
    });
    let block = Block::new()
        .borders(ratatui::widgets::Borders::TOP)
        .border_style(Style::new().dark_gray())
        .title(" events ");
    frame.render_widget(Paragraph::new(lines.collect::<Vec<_>>()).block(block), area);
}

fn draw_help(frame: &mut Frame<'_>, area: Rect, snapshot: &Snapshot) {
    let quit = if snapshot.is_attached {
        "leave the view; the robot goes on"
    } else {
        "stop the robot, then its services"
    };
    let pause = if snapshot.status.tempo.is_some() {
        "stop logical time, and go on"
    } else {
        "stop the picture, not the robot"
    };
    let mut lines = vec![
        format!("q, Ctrl-C  {quit}"),
        "Q          stop the robot, also where the view is attached".to_owned(),
        "↑ ↓        select a service".to_owned(),
        "l, Enter   its log, in the place of the map".to_owned(),
        "r          start it anew".to_owned(),
        "o          give an order".to_owned(),
        "/ s        only services with a text; in another order".to_owned(),
        format!("p          {pause}"),
    ];
    if snapshot.status.tempo.is_some() {
        lines.push(". + - 0    a tenth of a second; faster; slower; fastest".to_owned());
    }
    lines.extend(
        [
            "",
            "→          the robot: green GO, red STOP; its outline",
            "circles    magenta: where it believes to be; red: people",
            "lines      cyan: its path; grey: walls, and where it was;",
            "           yellow: doors; light blue: furniture",
            "",
            "step p50   half of the steps are shorter",
            "late       steps that began a period late",
            "lost       messages overwritten unread",
        ]
        .map(str::to_owned),
    );
    let rows = u16::try_from(lines.len()).unwrap_or(u16::MAX).saturating_add(2);
    let (width, height) = (64.min(area.width), rows.min(area.height));
    let place =
        Rect { x: area.x + (area.width - width) / 2, y: area.y + (area.height - height) / 2, width, height };
    frame.render_widget(Clear, place);
    let lines: Vec<_> = lines.iter().map(|line| Line::from(format!(" {line}"))).collect();
    frame.render_widget(Paragraph::new(lines).block(Block::bordered().title(" keys and signs ")), place);
}

fn robot_colour(snapshot: &Snapshot) -> Color {
    match snapshot.clearance.map(|clearance| clearance.signal.get()) {
        Some(Ok(Verdict::Go)) => Color::Green,
        Some(_) => Color::Red,
        None => Color::White,
    }
}

fn state_colour(state: &str) -> Style {
    match state {
        "running" => Style::new().green(),
        "failed" => Style::new().red().bold(),
        "finished" => Style::new().dark_gray(),
        _ => Style::new().yellow(),
    }
}

/// Microseconds as people read them.
fn duration(us: f64) -> String {
    match us {
        us if !us.is_finite() || us <= 0.0 => "-".to_owned(),
        us if us < 999.5 => format!("{us:.0} us"),
        us if us < 999_500.0 => format!("{:.1} ms", us / 1e3),
        us => format!("{:.1} s", us / 1e6),
    }
}

fn distance(metres: f32) -> String {
    if metres.is_finite() { format!("{metres:.2} m") } else { "free".to_owned() }
}

/// `NearDoor` as `near door`.
fn spaced(name: &str) -> String {
    let mut words = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && !words.is_empty() {
            words.push(' ');
        }
        words.extend(letter.to_lowercase());
    }
    words
}
