//! What keys do, without a terminal: from what is shown and a key to what is shown next, and to what is asked of the launcher.

use crate::control::{PaceChange, ServiceStatus, Status};
use crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use std::cmp::Ordering;

/// What a step of logical time is, when it stands still.
const STEP: std::time::Duration = std::time::Duration::from_millis(100);

/// What the person has chosen to see.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Choice {
    /// The service that keys act upon; none before a key has chosen one.
    pub(crate) selected: Option<String>,
    /// Only services with this in their names.
    pub(crate) filter: String,
    /// The order of the services.
    pub(crate) order: Order,
    /// Whether the log of the selected service is shown in the place of the map.
    pub(crate) logs: bool,
    /// Whether the keys are explained.
    pub(crate) help: bool,
    /// Whether the picture stands still. The robot does not.
    pub(crate) frozen: bool,
    /// What is being asked of the person.
    pub(crate) prompt: Option<Prompt>,
    /// What came of the last request.
    pub(crate) message: Option<Message>,
}

/// The order of the services.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) enum Order {
    /// As in the graph.
    #[default]
    Graph,
    /// By name.
    Name,
    /// Who uses most of the processor first.
    Processor,
    /// Whose steps take longest first.
    Step,
    /// Who was started most often first.
    Restarts,
}

impl Order {
    /// Its name.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Graph => "graph",
            Self::Name => "name",
            Self::Processor => "CPU",
            Self::Step => "step",
            Self::Restarts => "restarts",
        }
    }

    fn next(self) -> Self {
        match self {
            Self::Graph => Self::Name,
            Self::Name => Self::Processor,
            Self::Processor => Self::Step,
            Self::Step => Self::Restarts,
            Self::Restarts => Self::Graph,
        }
    }
}

/// A question to the person.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Prompt {
    /// A text for the filter.
    Filter(String),
    /// What is to be ordered.
    Order(String),
    /// Whether to start a service anew.
    Restart(String),
    /// Whether to stop the robot.
    Stop,
}

/// What came of a request.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Message {
    pub(crate) text: String,
    pub(crate) is_trouble: bool,
}

/// What a key asks for.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Wish {
    /// Leave the view; in `launch up` this stops the robot.
    Quit,
    /// Stop the robot.
    Stop,
    /// Start a service anew.
    Restart(String),
    /// Give an order.
    Order(String),
    /// Change the pace of logical time.
    Pace(PaceChange),
}

impl Choice {
    /// The services that are shown, in their order.
    pub(crate) fn shown<'a>(&self, status: &'a Status) -> Vec<&'a ServiceStatus> {
        let mut shown: Vec<&ServiceStatus> =
            status.services.iter().filter(|service| service.role.contains(&self.filter)).collect();
        let most = |a: f64, b: f64| b.partial_cmp(&a).unwrap_or(Ordering::Equal);
        match self.order {
            Order::Graph => {}
            Order::Name => shown.sort_by(|a, b| a.role.cmp(&b.role)),
            Order::Processor => shown.sort_by(|a, b| most(a.cpu_percent, b.cpu_percent)),
            Order::Step => shown.sort_by(|a, b| most(a.step_p99_us, b.step_p99_us)),
            Order::Restarts => shown.sort_by_key(|service| std::cmp::Reverse(service.restarts)),
        }
        shown
    }

    /// Takes a key.
    pub(crate) fn press(&mut self, key: KeyEvent, status: &Status) -> Option<Wish> {
        if key.kind == KeyEventKind::Release {
            return None;
        }
        // A terminal in raw mode sends no signal for it.
        if key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL) {
            return Some(Wish::Quit);
        }
        match self.prompt.take() {
            Some(prompt) => self.answer(prompt, key.code),
            None => self.command(key.code, status),
        }
    }

    /// Text that was pasted, as one word.
    pub(crate) fn paste(&mut self, text: &str) {
        if let Some(Prompt::Filter(word) | Prompt::Order(word)) = &mut self.prompt {
            word.extend(text.chars().filter(|letter| !letter.is_control()).take(80));
        }
    }

    fn answer(&mut self, prompt: Prompt, key: KeyCode) -> Option<Wish> {
        match (prompt, key) {
            (_, KeyCode::Esc) => None,
            (Prompt::Filter(word), KeyCode::Enter) => {
                self.filter = word;
                None
            }
            (Prompt::Order(word), KeyCode::Enter) if !word.trim().is_empty() => {
                Some(Wish::Order(word.trim().to_owned()))
            }
            (Prompt::Filter(mut word), key) => {
                edit(&mut word, key);
                self.filter.clone_from(&word);
                self.prompt = Some(Prompt::Filter(word));
                None
            }
            (Prompt::Order(mut word), key) => {
                edit(&mut word, key);
                self.prompt = Some(Prompt::Order(word));
                None
            }
            (Prompt::Restart(role), KeyCode::Char('y' | 'Y')) => Some(Wish::Restart(role)),
            (Prompt::Stop, KeyCode::Char('y' | 'Y')) => Some(Wish::Stop),
            (Prompt::Restart(_) | Prompt::Stop, _) => None,
        }
    }

    fn command(&mut self, key: KeyCode, status: &Status) -> Option<Wish> {
        self.message = None;
        match key {
            KeyCode::Char('q') => return Some(Wish::Quit),
            KeyCode::Char('Q') => self.prompt = Some(Prompt::Stop),
            KeyCode::Char('?' | 'h') => self.help = !self.help,
            KeyCode::Esc => {
                let was_open = self.help || self.logs;
                (self.help, self.logs) = (false, false);
                if !was_open {
                    self.filter.clear();
                    self.selected = None;
                }
            }
            KeyCode::Down | KeyCode::Char('j') => self.step(status, 1),
            KeyCode::Up | KeyCode::Char('k') => self.step(status, -1),
            KeyCode::Char('l') | KeyCode::Enter => {
                self.select_any(status);
                self.logs = !self.logs;
            }
            KeyCode::Char('r') => {
                self.select_any(status);
                self.prompt = self.selected.clone().map(Prompt::Restart);
            }
            KeyCode::Char('o') => self.prompt = Some(Prompt::Order(String::new())),
            KeyCode::Char('/') => self.prompt = Some(Prompt::Filter(self.filter.clone())),
            KeyCode::Char('s') => self.order = self.order.next(),
            KeyCode::Char('p' | ' ') => match &status.tempo {
                Some(tempo) => return Some(Wish::Pace(PaceChange::Pause(!tempo.paused))),
                None => self.frozen = !self.frozen,
            },
            KeyCode::Char('.') if status.tempo.is_some() => return Some(Wish::Pace(PaceChange::Step(STEP))),
            KeyCode::Char('+' | '=') if status.tempo.is_some() => {
                return Some(Wish::Pace(PaceChange::Times(2.0)));
            }
            KeyCode::Char('-') if status.tempo.is_some() => return Some(Wish::Pace(PaceChange::Times(0.5))),
            KeyCode::Char('0') if status.tempo.is_some() => return Some(Wish::Pace(PaceChange::Fastest)),
            _ => {}
        }
        None
    }

    fn step(&mut self, status: &Status, by: isize) {
        let shown = self.shown(status);
        let present =
            self.selected.as_ref().and_then(|role| shown.iter().position(|known| known.role == *role));
        let last = shown.len().saturating_sub(1);
        let next = match present {
            Some(index) => index.saturating_add_signed(by).min(last),
            None if by < 0 => last,
            None => 0,
        };
        self.selected = shown.get(next).map(|service| service.role.clone());
    }

    fn select_any(&mut self, status: &Status) {
        let shown = self.shown(status);
        if !shown.iter().any(|service| Some(&service.role) == self.selected.as_ref()) {
            self.selected = shown.first().map(|service| service.role.clone());
        }
    }
}

fn edit(word: &mut String, key: KeyCode) {
    match key {
        KeyCode::Char(letter) if !letter.is_control() && word.chars().count() < 80 => word.push(letter),
        KeyCode::Backspace => _ = word.pop(),
        _ => {}
    }
}
