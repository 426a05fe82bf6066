//! `launch up --detach`: the launcher goes on by itself.

use crate::control;
use board::clock;
use board::host;
use board::place::Place;
use std::os::unix::process::CommandExt as _;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Starts this very command again, without `--detach`, in a session of its own, and waits until its services are ready.
///
/// # Errors
/// With the launcher's words, when the graph does not come up.
pub(crate) fn detach(board: &str) -> Result<(), String> {
    let place = Place::new(board).map_err(|error| error.to_string())?;
    if let Some(pid) = host::living_launcher(&place).map_err(|error| error.to_string())? {
        return Err(format!(
            "the board `{board}` is up already (launcher {pid}); stop it with `launch stop --board {board}`"
        ));
    }
    let output = std::env::temp_dir().join(format!("corkboard-{}.start", std::process::id()));
    let file = std::fs::File::create(&output).map_err(|error| format!("{}: {error}", output.display()))?;
    let copy = file.try_clone().map_err(|error| error.to_string())?;
    let launcher = std::env::current_exe().map_err(|error| error.to_string())?;
    let arguments = std::env::args().skip(1).filter(|argument| argument != "--detach");
    let mut command = Command::new(launcher);
    command.args(arguments).arg("--plain").stdin(Stdio::null()).stdout(file).stderr(copy);
    // SAFETY: setsid is a plain system call; it cannot fail in a process that was just made.
    unsafe {
        command.pre_exec(|| {
            let _ = rustix::process::setsid();
            Ok(())
        });
    }
    let mut child = command.spawn().map_err(|error| error.to_string())?;
    let words = || std::fs::read_to_string(&output).unwrap_or_default();
    let ready = loop {
        if let Ok(Some(_)) = child.try_wait() {
            break Err(words());
        }
        if let Ok(control::Answer::Status(status)) = control::ask(&place, &control::Request::Status)
            && status.services.iter().all(|service| matches!(service.state.as_str(), "running" | "finished"))
        {
            break Ok(());
        }
        clock::sleep(Duration::from_millis(10));
    };
    let _ = std::fs::remove_file(&output);
    if ready.is_ok() {
        println!(
            "the board `{board}` is up (launcher {}); `launch ps`, `launch logs`, `launch stop`",
            child.id()
        );
    }
    ready
}
