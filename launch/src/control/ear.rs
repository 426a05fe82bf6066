//! The launcher's ear: a thread that talks to everybody who connects to the control socket, so that no client can hold up the supervising loop.
//!
//! What can be answered without the loop is answered here: how everything stands, from the loop's last word, and the order to stop, which is a count that the loop
//! looks at. The rest is handed to the loop, which answers in its own time. A conversation is one line there and one back, with a deadline for each part; there are
//! so many at once, and the one that has dawdled longest gives way to a newcomer.

use super::{Answer, Request, Status};
use crate::signals::{Alarm, Wish};
use board::clock;
use board::place::Place;
use messages::Time;
use rustix::event::{PollFd, PollFlags, poll};
use std::io::{self, ErrorKind, Read as _, Write as _};
use std::os::fd::AsFd as _;
use std::os::unix::fs::PermissionsExt as _;
use std::os::unix::net::{UnixListener, UnixStream};
use std::sync::mpsc::{self, Receiver, Sender, SyncSender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// Conversations at once.
const GUESTS_MAX: usize = 64;
/// For so long a client may take to say its line, or to read the answer.
const PATIENCE: Duration = Duration::from_secs(2);
/// For so long the loop may take to answer; it is that busy only when it starts or ends.
const ANSWER_WITHIN: Duration = Duration::from_secs(4);
/// A service's description, with the messages of its topics, takes some.
const LINE_MAX: usize = 4 * 1024 * 1024;
/// Questions that wait for the loop.
const CALLS_MAX: usize = 64;

/// A question for the supervising loop.
#[derive(Debug)]
pub(crate) struct Call {
    pub(crate) request: Request,
    guest: u64,
    answers: Answers,
}

impl Call {
    /// Answers it.
    pub(crate) fn answer(self, answer: Answer) {
        self.answers.give(self.guest, answer);
    }
}

/// Listens until it is dropped.
#[derive(Debug)]
pub(crate) struct Ear {
    calls: Receiver<Call>,
    status: Arc<Mutex<Option<Arc<Status>>>>,
    /// Closed to end the thread.
    end: Option<UnixStream>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug, Clone)]
struct Answers {
    queue: Sender<(u64, Answer)>,
    bell: Arc<UnixStream>,
}

impl Answers {
    fn give(&self, guest: u64, answer: Answer) {
        let _ = self.queue.send((guest, answer));
        let _ = (&*self.bell).write(&[1]);
    }
}

impl Ear {
    /// Opens the control socket of a board, for its owner alone.
    ///
    /// # Errors
    /// When the socket cannot be made, or no thread can be had.
    pub(crate) fn open(place: &Place, alarm: Alarm) -> io::Result<Self> {
        let path = super::socket(place);
        let listener = UnixListener::bind(&path)?;
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600))?;
        listener.set_nonblocking(true)?;
        let (end, until) = UnixStream::pair()?;
        until.set_nonblocking(true)?;
        let (bell, rung) = UnixStream::pair()?;
        bell.set_nonblocking(true)?;
        rung.set_nonblocking(true)?;
        let (questions, calls) = mpsc::sync_channel(CALLS_MAX);
        let (queue, replies) = mpsc::channel();
        let status = Arc::default();
        let room = Room {
            listener,
            until,
            rung,
            guests: Vec::new(),
            next: 0,
            questions,
            answers: Answers { queue, bell: Arc::new(bell) },
            replies,
            status: Arc::clone(&status),
            alarm,
        };
        let thread = std::thread::Builder::new().name("control".to_owned()).spawn(move || room.serve())?;
        Ok(Self { calls, status, end: Some(end), thread: Some(thread) })
    }

    /// Says how everything stands, for those who ask from now on.
    pub(crate) fn tell(&self, status: Status) {
        *self.status.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::new(status));
    }

    /// The next question for the loop.
    pub(crate) fn next_call(&self) -> Option<Call> {
        self.calls.try_recv().ok()
    }
}

impl Drop for Ear {
    fn drop(&mut self) {
        self.end = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// What a guest is about.
#[derive(Debug)]
enum Stage {
    Speaks(Vec<u8>),
    Waits,
    Listens { words: Vec<u8>, written: usize },
    Gone,
}

#[derive(Debug)]
struct Guest {
    number: u64,
    stream: UnixStream,
    stage: Stage,
    /// When it must be done with this stage.
    until: Time,
}

/// The thread's own.
struct Room {
    listener: UnixListener,
    until: UnixStream,
    rung: UnixStream,
    guests: Vec<Guest>,
    next: u64,
    questions: SyncSender<Call>,
    answers: Answers,
    replies: Receiver<(u64, Answer)>,
    status: Arc<Mutex<Option<Arc<Status>>>>,
    alarm: Alarm,
}

impl Room {
    fn serve(mut self) {
        loop {
            let now = clock::monotonic();
            let due = self.guests.iter().map(|guest| guest.until.since(now)).min();
            let due = due.unwrap_or(Duration::from_secs(60)).min(Duration::from_secs(60));
            let pause = rustix::time::Timespec {
                tv_sec: i64::try_from(due.as_secs()).unwrap_or(60),
                tv_nsec: i64::from(due.subsec_nanos()),
            };
            let mut descriptors = vec![
                PollFd::from_borrowed_fd(self.until.as_fd(), PollFlags::IN),
                PollFd::from_borrowed_fd(self.rung.as_fd(), PollFlags::IN),
                PollFd::from_borrowed_fd(self.listener.as_fd(), PollFlags::IN),
            ];
            descriptors.extend(self.guests.iter().map(|guest| {
                let wanted = match guest.stage {
                    Stage::Speaks(_) => PollFlags::IN,
                    Stage::Listens { .. } => PollFlags::OUT,
                    Stage::Waits | Stage::Gone => PollFlags::empty(),
                };
                PollFd::from_borrowed_fd(guest.stream.as_fd(), wanted)
            }));
            let _ = poll(&mut descriptors, Some(&pause));
            let ready: Vec<bool> = descriptors.iter().map(|fd| !fd.revents().is_empty()).collect();
            drop(descriptors);
            if ready[0] {
                return;
            }
            if ready[1] {
                self.take_replies();
            }
            for (index, _) in ready.iter().skip(3).enumerate().filter(|(_, ready)| **ready) {
                self.attend(index);
            }
            let now = clock::monotonic();
            for guest in &mut self.guests {
                if guest.until <= now {
                    guest.stage = Stage::Gone;
                }
            }
            self.guests.retain(|guest| !matches!(guest.stage, Stage::Gone));
            if ready[2] {
                self.welcome(now);
            }
        }
    }

    /// Lets in those who wait at the door.
    fn welcome(&mut self, now: Time) {
        for _ in 0..GUESTS_MAX {
            let stream = match self.listener.accept() {
                Ok((stream, _)) => stream,
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(_) => {
                    // No descriptor is left: those who are here go first, and the door does not spin.
                    clock::sleep(Duration::from_millis(20));
                    return;
                }
            };
            if stream.set_nonblocking(true).is_err() {
                continue;
            }
            if self.guests.len() == GUESTS_MAX {
                // Who has an answer coming keeps its place.
                let longest = self.guests.iter().position(|guest| matches!(guest.stage, Stage::Speaks(_)));
                self.guests.remove(longest.unwrap_or(0));
            }
            let number = self.next;
            self.next += 1;
            let stage = Stage::Speaks(Vec::new());
            self.guests.push(Guest { number, stream, stage, until: now.after(PATIENCE) });
            // Most have spoken by the time they are let in.
            self.attend(self.guests.len() - 1);
        }
    }

    fn take_replies(&mut self) {
        let mut bytes = [0; 64];
        while matches!((&self.rung).read(&mut bytes), Ok(read) if read > 0) {}
        while let Ok((number, answer)) = self.replies.try_recv() {
            if let Some(guest) = self.guests.iter_mut().find(|guest| guest.number == number) {
                guest.tell(&answer);
            }
        }
    }

    fn attend(&mut self, index: usize) {
        let Some(guest) = self.guests.get_mut(index) else { return };
        let line = match guest.listen() {
            Some(line) => line,
            None => return,
        };
        let number = guest.number;
        let answer = match serde_json::from_slice(&line) {
            Ok(Request::Status) => match &*self.status.lock().unwrap_or_else(PoisonError::into_inner) {
                Some(status) => Some(Answer::Status(Box::new(status.as_ref().clone()))),
                None => Some(Answer::Refused("the launcher is just starting; ask again".to_owned())),
            },
            Ok(Request::Stop { fast }) => {
                if fast {
                    self.alarm.ask_to_end_at_once(Wish::Command);
                } else {
                    self.alarm.ask_to_end(Wish::Command);
                }
                Some(Answer::Done)
            }
            Ok(request) => {
                let call = Call { request, guest: number, answers: self.answers.clone() };
                let busy = || Answer::Refused("the launcher has too much else to do; try again".to_owned());
                self.questions.try_send(call).err().map(|_| busy())
            }
            Err(error) => Some(Answer::Refused(format!("not a request: {error}"))),
        };
        match answer {
            Some(answer) => {
                if let Some(guest) = self.guests.get_mut(index) {
                    guest.tell(&answer);
                }
            }
            None => self.alarm.wake(),
        }
    }
}

impl Guest {
    /// Goes on with what this guest is about; its line when it has spoken to the end.
    fn listen(&mut self) -> Option<Vec<u8>> {
        match &mut self.stage {
            Stage::Speaks(words) => {
                let mut bytes = [0; 4096];
                loop {
                    match (&self.stream).read(&mut bytes) {
                        Ok(0) => {
                            self.stage = Stage::Gone;
                            return None;
                        }
                        Ok(read) => {
                            let end = bytes[..read].iter().position(|&byte| byte == b'\n');
                            words.extend_from_slice(&bytes[..end.unwrap_or(read)]);
                            if end.is_some() {
                                let line = std::mem::take(words);
                                self.stage = Stage::Waits;
                                self.until = clock::monotonic().after(ANSWER_WITHIN);
                                return Some(line);
                            }
                            if words.len() > LINE_MAX {
                                self.stage = Stage::Gone;
                                return None;
                            }
                        }
                        Err(error) if error.kind() == ErrorKind::WouldBlock => return None,
                        Err(error) if error.kind() == ErrorKind::Interrupted => {}
                        Err(_) => {
                            self.stage = Stage::Gone;
                            return None;
                        }
                    }
                }
            }
            Stage::Listens { .. } => self.go_on_telling(),
            // It hung up while it waited.
            Stage::Waits => self.stage = Stage::Gone,
            Stage::Gone => {}
        }
        None
    }

    fn tell(&mut self, answer: &Answer) {
        let mut words = serde_json::to_vec(answer).unwrap_or_default();
        words.push(b'\n');
        self.stage = Stage::Listens { words, written: 0 };
        self.until = clock::monotonic().after(PATIENCE);
        self.go_on_telling();
    }

    fn go_on_telling(&mut self) {
        let Stage::Listens { words, written } = &mut self.stage else { return };
        while *written < words.len() {
            match (&self.stream).write(&words[*written..]) {
                Ok(more) if more > 0 => *written += more,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                _ => break,
            }
        }
        self.stage = Stage::Gone;
    }
}
