//! The harness's side of `launch up --lockstep --steered`: orders in, answers out.

use serde_json::Value;
use std::cell::{Cell, RefCell};
use std::io::{BufRead as _, BufReader, Write as _};
use std::process::{Child, ChildStdin, ChildStdout};

/// The pipes to a launcher that waits for orders.
pub(crate) struct Steering {
    orders: RefCell<Option<ChildStdin>>,
    answers: RefCell<Option<BufReader<ChildStdout>>>,
    has_ended: Cell<bool>,
}

impl Steering {
    pub(crate) fn new(launcher: &mut Child) -> Self {
        Self {
            orders: RefCell::new(launcher.stdin.take()),
            answers: RefCell::new(launcher.stdout.take().map(BufReader::new)),
            has_ended: Cell::new(false),
        }
    }

    /// Whether the run is over.
    pub(crate) fn has_ended(&self) -> bool {
        self.has_ended.get()
    }

    /// Gives an order. What goes wrong is heard, not told.
    pub(crate) fn tell(&self, order: &str) {
        if let Some(orders) = self.orders.borrow_mut().as_mut() {
            let _ = writeln!(orders, "{order}");
        }
    }

    /// Waits for the answer to the last order.
    pub(crate) fn hear(&self) -> Result<(), String> {
        if self.has_ended() {
            return Ok(());
        }
        let mut answers = self.answers.borrow_mut();
        let Some(answers) = answers.as_mut() else { return Err("the graph has ended".to_owned()) };
        let mut words = String::new();
        loop {
            let mut line = String::new();
            if !answers.read_line(&mut line).is_ok_and(|read| read > 0) {
                return Err(format!("the graph has ended in the middle of the test:\n{words}"));
            }
            let Some(answer) = serde_json::from_str::<Value>(&line).ok().filter(Value::is_object) else {
                // What the launcher says to people.
                words += &line;
                continue;
            };
            if let Some(error) = answer["error"].as_str() {
                return Err(error.to_owned());
            }
            self.has_ended.set(answer["ended"] == true);
            return Ok(());
        }
    }

    /// Ends the run: the end of the input is the last order.
    pub(crate) fn end(&self) {
        self.orders.borrow_mut().take();
        self.answers.borrow_mut().take();
    }
}
