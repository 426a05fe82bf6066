//! One frame: services, map, mission, events.

use super::map::{draw_map, is_worthwhile};
use super::plan::Plan;
use super::snapshot::Snapshot;
use crate::control::{EventLine, ServiceStatus};
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
    let with_map = is_worthwhile(plan, &snapshot.scene);
    let words = words_of(snapshot);
    let event_rows = (area.height / 6).clamp(3, 10);
    let services = snapshot.status.services.len();
    let full = u16::try_from(services).unwrap_or(u16::MAX).saturating_add(1);
    let word_rows = u16::try_from(words.len()).unwrap_or(0);
    let body = area.height.saturating_sub(1 + word_rows + event_rows);
    let columns = (area.width / SHORT_WIDTH).clamp(1, 4);
    let short = u16::try_from(services.div_ceil(usize::from(columns))).unwrap_or(u16::MAX);
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
    ];
    let [head, list, map, word, log] = Layout::vertical(rows).areas(area);
    draw_head(frame, head, snapshot);
    if is_short {
        draw_short_list(frame, list, &snapshot.status.services, columns);
    } else {
        draw_table(frame, list, &snapshot.status.services);
    }
    if with_map {
        draw_map(frame, map, plan, &snapshot.scene, robot_colour(snapshot));
    }
    frame.render_widget(Paragraph::new(words), word);
    draw_events(frame, log, &snapshot.status.events);
    if snapshot.help {
        draw_help(frame, area);
    }
}

fn draw_head(frame: &mut Frame<'_>, area: Rect, snapshot: &Snapshot) {
    let status = &snapshot.status;
    let running = status.services.iter().filter(|service| service.state == "running").count();
    let all = status.services.len();
    let up_s = status.uptime_s.max(0.0) as u64;
    let left = Line::from(vec![
        Span::from(format!(" {} ", status.board)).bold().reversed(),
        Span::from(format!(
            "  {}  up {}:{:02}:{:02}  ",
            snapshot.mode,
            up_s / 3600,
            up_s / 60 % 60,
            up_s % 60
        )),
        Span::styled(
            format!("{running}/{all} running"),
            if running == all { Style::new().green() } else { Style::new().yellow() },
        ),
    ]);
    let right = Line::from("q stop  ? help ").alignment(Alignment::Right).dark_gray();
    // On a narrow screen the keys give way.
    if left.width() + right.width() <= usize::from(area.width) {
        frame.render_widget(right, area);
    }
    let left_area = Rect { width: area.width.min(u16::try_from(left.width()).unwrap_or(u16::MAX)), ..area };
    frame.render_widget(left, left_area);
}

fn draw_table(frame: &mut Frame<'_>, area: Rect, services: &[ServiceStatus]) {
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
        Row::new(cells)
    });
    let widths = COLUMNS.iter().take(shown).map(|(_, width)| Constraint::Length(*width));
    frame.render_widget(Table::new(rows, widths).header(header).column_spacing(1), area);
}

/// Name, rate and step time only, in columns: for small screens.
fn draw_short_list(frame: &mut Frame<'_>, area: Rect, services: &[ServiceStatus], columns: u16) {
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
            Line::from(vec![
                Span::styled("● ", state_colour(&service.state)),
                Span::from(format!("{name:room$}")),
                Span::from(numbers).dark_gray(),
            ])
        });
        frame.render_widget(Paragraph::new(lines.collect::<Vec<_>>()), *area);
    }
}

/// The guard's signal and the mission; below it the referee's figures.
fn words_of(snapshot: &Snapshot) -> Vec<Line<'static>> {
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
        let room = mission.room.as_str();
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
            spans.push(Span::from(format!("   {}", mission.remark)).yellow());
        }
    }
    if !spans.is_empty() {
        lines.push(Line::from(spans));
    }
    if let Some(summary) = &snapshot.summary {
        let mut spans = vec![match summary.state.get() {
            Ok(RunState::Passed) => Span::from(" PASSED ").black().on_green(),
            Ok(RunState::Failed) => Span::from(" FAILED ").white().on_red(),
            _ => Span::from(" "),
        }];
        spans.push(Span::from(summary.remark.as_str().to_owned()));
        for figure in summary.figures().iter().filter(|figure| figure.value.is_finite()) {
            let value = if figure.value.fract() == 0.0 {
                format!("{:.0}", figure.value)
            } else {
                format!("{:.3}", figure.value)
            };
            spans.push(Span::from(format!("  {} ", figure.name)).dark_gray());
            spans.push(Span::from(format!("{value} {}", figure.unit).trim_end().to_owned()));
        }
        lines.push(Line::from(spans));
    }
    lines
}

fn draw_events(frame: &mut Frame<'_>, area: Rect, events: &[EventLine]) {
    let rows = usize::from(area.height.saturating_sub(1));
    let newest = &events[events.len().saturating_sub(rows)..];
    let lines = newest.iter().map(|event| {
        let role = if event.role.is_empty() { "launch" } else { &event.role };
        let text = Span::from(event.text.clone());
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

fn draw_help(frame: &mut Frame<'_>, area: Rect) {
    const LINES: [&str; 11] = [
        "q, Ctrl-C  stop the robot, then its services",
        "?          show or hide this",
        "",
        "→          the robot: green GO, red STOP",
        "circle     magenta: where it believes to be",
        "           red: a person",
        "lines      cyan: its path; yellow: doors",
        "",
        "step p50   half of the steps are shorter",
        "late       steps that began a period late",
        "lost       messages overwritten unread",
    ];
    let (width, height) = (50.min(area.width), 13.min(area.height));
    let place =
        Rect { x: area.x + (area.width - width) / 2, y: area.y + (area.height - height) / 2, width, height };
    frame.render_widget(Clear, place);
    let lines: Vec<_> = LINES.iter().map(|line| Line::from(format!(" {line}"))).collect();
    frame.render_widget(Paragraph::new(lines).block(Block::bordered().title(" help ")), place);
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
