//! The launcher's desk: what a run says, and what it is asked, in either kind of time. The supervising loop comes by now and then, and is held up by nobody here: printing,
//! conversations and the view are threads of their own.

use crate::console::Console;
use crate::control::{Answer, Ear, Request, Tempo};
use crate::graph::Checked;
use crate::monitor::Monitor;
use crate::plain::Lines;
use crate::record::Recording;
use crate::signals::Signals;
use crate::supervise::Supervisor;
use crate::view::{OnQuit, Viewer};
use board::place::Place;
use messages::Time;
use std::time::Duration;

/// Between two words of how everything stands.
const TELL: Duration = Duration::from_millis(100);
/// Between two signs of life of a run in logical time.
const SIGN_OF_LIFE: Duration = Duration::from_secs(5);
/// Questions that are answered at once; the others wait for the next time.
const CALLS: usize = 16;

/// How a run shows itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Face {
    /// On the whole terminal.
    View,
    /// A line an event.
    Lines,
    /// Only what goes wrong, a line each.
    Trouble,
    /// Nothing: what happened is told at the end.
    Silence,
}

/// The threads that speak for a run.
pub(crate) struct Desk<'a> {
    pub(crate) console: Console,
    pub(crate) signals: &'a Signals,
    graph: &'a Checked,
    lines: Lines,
    viewer: Option<Viewer>,
    face: Face,
    ear: Option<Ear>,
    next_word: Time,
    next_sign: Time,
}

impl<'a> Desk<'a> {
    /// A desk for a run that is about to begin; it hears and shows nothing yet.
    pub(crate) fn new(graph: &'a Checked, console: Console, signals: &'a Signals, face: Face) -> Self {
        let lines = Lines::new(console.clone(), face == Face::Trouble);
        Self {
            console,
            signals,
            graph,
            lines,
            viewer: None,
            face,
            ear: None,
            next_word: Time::ZERO,
            next_sign: Time::ZERO,
        }
    }

    /// The board is there: from now on others can ask, and the view is drawn.
    ///
    /// # Errors
    /// When nobody could ask this run to stop.
    pub(crate) fn open(&mut self, place: &Place) -> std::io::Result<()> {
        self.ear = Some(Ear::open(place, self.signals.alarm())?);
        if self.face == Face::View {
            let on_quit = OnQuit::Stop(self.signals.alarm());
            self.viewer = Viewer::start(place, self.console.clone(), on_quit);
            // Without a terminal the run goes on in lines.
            self.face = if self.viewer.is_some() { Face::View } else { Face::Lines };
        }
        Ok(())
    }

    /// Says how everything stands, and answers who has asked. `tempo` is that of logical time.
    pub(crate) fn serve(
        &mut self,
        now: Time,
        supervisor: &mut Supervisor,
        monitor: &Monitor,
        recording: Option<&Recording>,
        tempo: &mut Option<Tempo>,
    ) {
        if self.signals.was_to_be_suspended() {
            let text = "Ctrl-Z would leave the robot without its launcher, and has no effect; Ctrl-C stops the robot, `launch up --detach` starts it in the background";
            supervisor.note("", text, true);
        }
        let mut news = now >= self.next_word;
        for _ in 0..CALLS {
            let Some(call) = self.ear.as_ref().and_then(Ear::next_call) else { break };
            let answer = answer(&call.request, supervisor, tempo);
            news = true;
            self.tell(supervisor, monitor, recording, *tempo);
            call.answer(answer);
        }
        if news {
            self.next_word = now.after(TELL);
            self.tell(supervisor, monitor, recording, *tempo);
            self.show_lines(supervisor, monitor);
            if tempo.is_some() {
                self.give_sign_of_life(now, supervisor);
            }
        }
    }

    /// In logical time little may happen for a long time of the world.
    fn give_sign_of_life(&mut self, now: Time, supervisor: &Supervisor) {
        let first = self.next_sign == Time::ZERO;
        if now < self.next_sign {
            return;
        }
        self.next_sign = now.after(SIGN_OF_LIFE);
        if self.face == Face::Lines && !first {
            let took_s = now.seconds_since(supervisor.began);
            let logical_s = board::tap::now(supervisor.host.switchboard()).as_secs_f64();
            let times = logical_s / took_s;
            self.console.line(&format!(
                "[{took_s:>9.3}] launch: {logical_s:.1} s of logical time, {times:.0} x real time"
            ));
        }
    }

    fn show_lines(&mut self, supervisor: &Supervisor, monitor: &Monitor) {
        if self.face != Face::Silence {
            self.lines.show(supervisor, monitor.summary());
        }
    }

    fn tell(
        &self,
        supervisor: &Supervisor,
        monitor: &Monitor,
        recording: Option<&Recording>,
        tempo: Option<Tempo>,
    ) {
        if let Some(ear) = &self.ear {
            ear.tell(monitor.status(supervisor, self.graph, recording, tempo));
        }
    }

    /// The last events and the last picture; then the terminal is free again, and nobody can ask any more.
    pub(crate) fn close(&mut self, supervisor: &Supervisor, monitor: &Monitor, tempo: Option<Tempo>) {
        self.tell(supervisor, monitor, None, tempo);
        if let Some(viewer) = self.viewer.take() {
            viewer.close();
        }
        self.show_lines(supervisor, monitor);
        self.ear = None;
    }
}

fn answer(request: &Request, supervisor: &mut Supervisor, tempo: &mut Option<Tempo>) -> Answer {
    match request {
        // Answered at the ear.
        Request::Status | Request::Stop { .. } => Answer::Done,
        Request::Restart { .. } if supervisor.host.is_lockstep() => Answer::Refused(
            "in logical time a restart is planned, so that it is the same in every run: a [[fault]] in the graph, or --set graph.fault".to_owned(),
        ),
        Request::Restart { role } if supervisor.restart(role) => Answer::Done,
        Request::Restart { role } => {
            let known: Vec<&str> =
                supervisor.services.iter().map(|service| service.service.role.as_str()).collect();
            Answer::Refused(format!("there is no service `{role}`; there are {}", known.join(", ")))
        }
        Request::Swap(request) => done(supervisor.swap(request.as_ref().clone())),
        Request::SwapBack { role } => done(supervisor.swap_back(role)),
        Request::Pace(change) => match tempo {
            Some(tempo) => {
                tempo.change(*change);
                Answer::Done
            }
            None => Answer::Refused(
                "the robot lives in the time of the world, which cannot be paused; with --lockstep it could".to_owned(),
            ),
        },
    }
}

fn done(result: Result<(), String>) -> Answer {
    result.map_or_else(Answer::Refused, |()| Answer::Done)
}
