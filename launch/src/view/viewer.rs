//! The view's thread: asks, reads, draws and listens to keys, until somebody closes it or the terminal is gone.

use super::frame::draw;
use super::keys::{Choice, Message, Wish};
use super::plan::Plan;
use super::scene::SceneReader;
use super::snapshot::Snapshot;
use super::terminal::{Ready, can_show, wait_for_keys};
use crate::console::Console;
use crate::control::{self, Answer, Request, Status};
use crate::journal;
use crate::order;
use crate::signals::{self, Alarm};
use board::clock;
use board::place::Place;
use board::terminal::harmless;
use crossterm::event::{self, Event};
use geometry::World;
use ratatui::DefaultTerminal;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver};
use std::thread::JoinHandle;
use std::time::Duration;

/// Between two pictures.
const PERIOD: Duration = Duration::from_millis(100);
/// For so long the launcher may take to say how everything stands.
const ANSWER_WITHIN: Duration = Duration::from_secs(1);
/// For so long a view may take to give the terminal back; one that does not take its last picture is left as it is.
const CLOSE_WITHIN: Duration = Duration::from_millis(250);
/// Lines of a log that are kept for the picture.
const LOG_LINES: usize = 200;

/// What leaving the view means.
#[derive(Debug, Clone)]
pub(crate) enum OnQuit {
    /// The robot stops: the view is that of `launch up`.
    Stop(Alarm),
    /// The robot goes on: the view is attached to it.
    Leave,
}

/// A view that is drawn by a thread.
#[derive(Debug)]
pub(crate) struct Viewer {
    ending: Arc<AtomicBool>,
    thread: JoinHandle<()>,
    console: Console,
}

impl Viewer {
    /// Takes the terminal, if there is one that can show a picture. What is printed meanwhile waits.
    pub(crate) fn start(place: &Place, console: Console, on_quit: OnQuit) -> Option<Self> {
        if !can_show() {
            return None;
        }
        let ending = Arc::new(AtomicBool::new(false));
        let (end, place) = (Arc::clone(&ending), place.clone());
        let thread = std::thread::Builder::new().name("view".to_owned());
        let thread = thread.spawn(move || _ = watch(&place, &on_quit, &end)).ok()?;
        console.hold();
        Some(Self { ending, thread, console })
    }

    /// Shows the last picture and gives the terminal back.
    pub(crate) fn close(self) {
        self.ending.store(true, Ordering::Release);
        let deadline = clock::monotonic().after(CLOSE_WITHIN);
        while !self.thread.is_finished() && clock::monotonic() < deadline {
            clock::sleep(Duration::from_millis(1));
        }
        if !self.thread.is_finished() {
            // It stands still in the middle of a picture. The keys, at least, are the shell's again.
            let _ = crossterm::terminal::disable_raw_mode();
        }
        self.console.release();
    }
}

/// Draws until the end: in words why it came, where the view did not ask for it.
pub(crate) fn watch(place: &Place, on_quit: &OnQuit, ending: &AtomicBool) -> Option<String> {
    let Ok(mut terminal) = ratatui::try_init() else { return Some("the terminal cannot be had".to_owned()) };
    let mut view = View {
        place,
        on_quit,
        choice: Choice::default(),
        last: None,
        scene: None,
        plan: None,
        request: None,
        is_unheard: false,
    };
    let ended = view.run(&mut terminal, ending);
    let _ = terminal.show_cursor();
    // It would complain about a terminal that is gone, on that very terminal, and panic for not being heard.
    std::mem::forget(terminal);
    let _ = ratatui::try_restore();
    ended
}

struct View<'a> {
    place: &'a Place,
    on_quit: &'a OnQuit,
    choice: Choice,
    /// What was shown last.
    last: Option<Snapshot>,
    scene: Option<SceneReader>,
    /// The walls, with the file that they are from.
    plan: Option<(String, Option<Plan>)>,
    /// A request that takes its time.
    request: Option<Receiver<Result<String, String>>>,
    /// The launcher did not answer the last time.
    is_unheard: bool,
}

impl View<'_> {
    fn run(&mut self, terminal: &mut DefaultTerminal, ending: &AtomicBool) -> Option<String> {
        loop {
            let is_last = ending.load(Ordering::Acquire);
            if let Err(gone) = self.look() {
                match self.on_quit {
                    OnQuit::Leave => return Some(gone),
                    // The launcher says what it is about when it closes the view.
                    OnQuit::Stop(_) => {}
                }
            }
            if let Some(snapshot) = &mut self.last {
                snapshot.choice = self.choice.clone();
                snapshot.is_attached = matches!(self.on_quit, OnQuit::Leave);
                let plan = self.plan.as_ref().and_then(|(_, plan)| plan.as_ref());
                if terminal.draw(|frame| draw(frame, snapshot, plan)).is_err() {
                    return self.lose_terminal();
                }
            }
            if is_last {
                return None;
            }
            let next = clock::monotonic().after(PERIOD);
            while let left = next.since(clock::monotonic())
                && !left.is_zero()
                && !ending.load(Ordering::Acquire)
            {
                match wait_for_keys(left) {
                    Ready::Nothing => {}
                    Ready::Gone => return self.lose_terminal(),
                    Ready::Keys => {
                        if self.read_keys() {
                            return None;
                        }
                        break;
                    }
                }
            }
        }
    }

    fn lose_terminal(&self) -> Option<String> {
        // A robot whose view is closed is stopped, as by `q`: nobody sees it any more. One to which a view was attached goes on.
        if let OnQuit::Stop(alarm) = self.on_quit {
            alarm.ask_to_end(signals::Wish::HangUp);
        }
        Some("the terminal is gone".to_owned())
    }

    /// Takes in how everything stands; an error when the launcher is gone.
    fn look(&mut self) -> Result<(), String> {
        if let Some(answer) = self.request.as_ref().and_then(|request| request.try_recv().ok()) {
            self.request = None;
            self.say(answer);
        }
        let status = match control::ask_within(self.place, &Request::Status, ANSWER_WITHIN) {
            Ok(Answer::Status(status)) => *status,
            Ok(_) => return Err("the launcher answers something else".to_owned()),
            Err(error) if control::is_up(self.place) == Ok(false) => return Err(error),
            // It is just coming up.
            Err(_) if self.last.is_none() => return Ok(()),
            Err(error) => {
                self.choice.message = Some(Message { text: error, is_trouble: true });
                self.is_unheard = true;
                return Ok(());
            }
        };
        if std::mem::take(&mut self.is_unheard) {
            self.choice.message = None;
        }
        if self.choice.frozen && self.last.is_some() {
            return Ok(());
        }
        let scene = self.scene.get_or_insert_with(|| SceneReader::open(self.place, &status.view));
        scene.update();
        if let Some(world) = &status.view.world
            && self.plan.as_ref().is_none_or(|(known, _)| known != world)
        {
            // A world that cannot be read is the simulator's to refuse; the view does without.
            let read = World::load(Path::new(&status.folder).join(world)).ok();
            self.plan = Some((world.clone(), read.as_ref().map(Plan::of)));
        }
        let selected = self.choice.selected.as_deref().filter(|_| self.choice.logs);
        let log = selected.map(|role| log_of(&status, role)).unwrap_or_default();
        self.last = Some(scene.snapshot(status, log));
        Ok(())
    }

    /// Takes the keys that were pressed; true when the view is to be left.
    fn read_keys(&mut self) -> bool {
        while event::poll(Duration::ZERO).unwrap_or(false) {
            let Ok(event) = event::read() else { return false };
            let empty = Status::default();
            let status = self.last.as_ref().map_or(&empty, |snapshot| &snapshot.status);
            let wish = match event {
                Event::Key(key) => self.choice.press(key, status),
                Event::Paste(text) => {
                    self.choice.paste(&text);
                    None
                }
                _ => None,
            };
            if wish.is_some_and(|wish| self.fulfil(wish)) {
                return true;
            }
        }
        false
    }

    /// Does what is wished; true when the view is to be left.
    fn fulfil(&mut self, wish: Wish) -> bool {
        let (request, done) = match wish {
            Wish::Quit => {
                match self.on_quit {
                    OnQuit::Leave => return true,
                    OnQuit::Stop(alarm) => alarm.ask_to_end(signals::Wish::Key),
                }
                return false;
            }
            Wish::Order(what) => {
                let (sender, receiver) = mpsc::channel();
                let place = self.place.clone();
                let text = format!("ordering {what} ..");
                let ask = move || _ = sender.send(order::order(place, &what));
                let thread = std::thread::Builder::new().name("order".to_owned()).spawn(ask);
                self.request = thread.is_ok().then_some(receiver);
                self.choice.message = Some(match thread {
                    Ok(_) => Message { text, is_trouble: false },
                    Err(error) => {
                        Message { text: format!("the order was not given: {error}"), is_trouble: true }
                    }
                });
                return false;
            }
            Wish::Stop => (Request::Stop { fast: false }, "stopping the robot".to_owned()),
            Wish::Restart(role) => {
                let done = format!("`{role}` is being restarted");
                (Request::Restart { role }, done)
            }
            Wish::Pace(change) => (Request::Pace(change), String::new()),
        };
        let answer = control::ask_within(self.place, &request, ANSWER_WITHIN);
        self.say(answer.map(|_| done));
        false
    }

    fn say(&mut self, answer: Result<String, String>) {
        let is_trouble = answer.is_err();
        let text = answer.unwrap_or_else(|why| why);
        self.choice.message = (!text.is_empty()).then(|| Message { text: harmless(&text), is_trouble });
    }
}

fn log_of(status: &Status, role: &str) -> Vec<String> {
    let lines = journal::last_lines(Path::new(&status.logs), role, LOG_LINES);
    lines.iter().map(|line| harmless(line)).collect()
}
