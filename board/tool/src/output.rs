//! Where a command may write.

use std::fs;
use std::io;
use std::path::Path;

/// Makes way for a new file: one of the same name goes, if that was asked for.
///
/// # Errors When there is a file and nobody said `force`, and when there is anything but a plain file: a
///   device, a pipe or a link is never removed, since it is not what somebody means who wants to overwrite a
///   recording.
pub(crate) fn make_way(path: &Path, force: bool) -> Result<(), String> {
    let shown = path.display();
    match fs::symlink_metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(format!("{shown}: {error}")),
        Ok(found) if !found.is_file() => {
            Err(format!("{shown} is no plain file, and only such are overwritten; name another one"))
        }
        Ok(_) if !force => Err(format!("{shown} exists; say --force to overwrite it")),
        Ok(_) => fs::remove_file(path).map_err(|error| format!("{shown}: {error}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(path: &Path, force: bool, expected: Result<(), &str>) {
        let made = make_way(path, force);
        match expected {
            Ok(()) => assert_eq!(made, Ok(())),
            Err(words) => assert!(made.as_ref().is_err_and(|error| error.contains(words)), "{made:?}"),
        }
    }

    #[test]
    fn only_plain_files_are_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let [file, link, pipe, socket] =
            ["file", "link", "pipe", "socket"].map(|name| folder.path().join(name));
        check(&file, false, Ok(()));
        fs::write(&file, "old").unwrap();
        check(&file, false, Err("say --force"));
        assert!(file.exists());
        std::os::unix::fs::symlink(&file, &link).unwrap();
        rustix::fs::mkfifoat(rustix::fs::CWD, &pipe, rustix::fs::Mode::RUSR).unwrap();
        let listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        for other in [&link, &pipe, &socket, folder.path(), Path::new("/dev/full"), Path::new("/dev/null")] {
            check(other, true, Err("no plain file"));
            assert!(fs::symlink_metadata(other).is_ok(), "{} is gone", other.display());
        }
        drop(listener);
        check(&file, true, Ok(()));
        assert!(!file.exists());
    }
}
