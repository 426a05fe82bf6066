//! Whether a user's shared memory outlives the user's login.
//!
//! systemd removes what a user has in shared memory when the user's last session ends (`RemoveIPC=`,
//! logind.conf(5), on unless a distribution turns it off): a robot that was started over ssh and detached
//! loses its board at the logout. Root and system users are spared, and users who linger.

use std::fs;
use std::path::{Path, PathBuf};

/// Users with smaller numbers are the system's, whose shared memory stays.
const FIRST_USER: u32 = 1000;

/// Why what this user has in shared memory will be removed at logout, and what to do about it; `None` when it
/// stays.
pub fn removes_shared_memory() -> Option<String> {
    let user = rustix::process::getuid().as_raw();
    let runs_systemd = Path::new("/run/systemd/system").exists();
    let lingers =
        user_name(user).is_some_and(|name| Path::new("/var/lib/systemd/linger").join(name).exists());
    if user < FIRST_USER || !runs_systemd || lingers || !removes_ipc(&settings()) {
        return None;
    }
    Some(
        "systemd removes this user's shared memory, a running robot's board included, when the last session ends \
         (RemoveIPC in logind.conf); `loginctl enable-linger` keeps it"
            .to_owned(),
    )
}

fn user_name(user: u32) -> Option<String> {
    let users = fs::read_to_string("/etc/passwd").ok()?;
    users.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1)?.parse() == Ok(user)).then(|| name.to_owned())
    })
}

/// The texts of logind's settings, the weakest first: the main file, then the drop-ins in the order of their
/// names, of which those in /etc hide the others.
fn settings() -> Vec<String> {
    let mut drop_ins: Vec<PathBuf> = Vec::new();
    for folder in ["/etc/systemd", "/run/systemd", "/usr/local/lib/systemd", "/usr/lib/systemd"] {
        let entries = fs::read_dir(format!("{folder}/logind.conf.d")).into_iter().flatten().flatten();
        for path in entries.map(|entry| entry.path()) {
            let is_hidden = drop_ins.iter().any(|known| known.file_name() == path.file_name());
            if path.extension().is_some_and(|extension| extension == "conf") && !is_hidden {
                drop_ins.push(path);
            }
        }
    }
    drop_ins.sort_by(|a, b| a.file_name().cmp(&b.file_name()));
    let main = ["/etc/systemd/logind.conf", "/usr/lib/systemd/logind.conf"].map(PathBuf::from);
    let main = main.into_iter().find(|path| path.exists());
    main.into_iter().chain(drop_ins).filter_map(|path| fs::read_to_string(path).ok()).collect()
}

/// Whether these settings, the weakest first, have shared memory removed.
fn removes_ipc(settings: &[String]) -> bool {
    let lines = settings.iter().flat_map(|text| text.lines());
    let mut values =
        lines.filter_map(|line| line.trim().strip_prefix("RemoveIPC")?.trim_start().strip_prefix('='));
    let last = values.next_back().map(|value| value.trim().to_ascii_lowercase());
    // systemd's own default, which also an empty value means.
    last.is_none_or(|value| matches!(value.as_str(), "" | "yes" | "y" | "true" | "t" | "on" | "1"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(settings: &[&str], removes: bool) {
        let settings: Vec<String> = settings.iter().map(|&text| text.to_owned()).collect();
        assert_eq!(removes_ipc(&settings), removes, "{settings:?}");
    }

    #[test]
    fn the_last_word_counts() {
        check(&[], true);
        check(&["[Login]\n#RemoveIPC=no\n"], true);
        check(&["[Login]\nRemoveIPC=no\n"], false);
        check(&["[Login]\n  RemoveIPC = off\nKillUserProcesses=yes"], false);
        check(&["[Login]\nRemoveIPC=no\n", "[Login]\nRemoveIPC=yes\n"], true);
        check(&["[Login]\nRemoveIPC=yes\n", "[Login]\nRemoveIPC=0\n"], false);
        check(&["RemoveIPC="], true);
        check(&["RemoveIPCs=no"], true);
    }
}
