//! Files that belong to their owner alone, whatever the umask says and whoever was there first.

use crate::lack::Lack;
use std::fs::{DirBuilder, File, OpenOptions, Permissions};
use std::io::{self, Write as _};
use std::os::unix::fs::{DirBuilderExt as _, MetadataExt as _, OpenOptionsExt as _, PermissionsExt as _};
use std::path::{Path, PathBuf};

const FILE_MODE: u32 = 0o600;
const FOLDER_MODE: u32 = 0o700;

/// Makes a file that its owner alone may read and write.
///
/// # Errors
/// When there is something of this name already, a link too, or it cannot be made; the error names the file.
pub fn create(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    let options = options.read(true).write(true).create_new(true).mode(FILE_MODE);
    let file = options.open(path).map_err(at(path))?;
    // The umask may have taken bits that the owner needs.
    file.set_permissions(Permissions::from_mode(FILE_MODE)).map_err(at(path))?;
    Ok(file)
}

/// Puts a file in the place of another, whole or not at all, so that no reader sees half of it.
///
/// # Errors
/// When it cannot be written; the error names the file.
pub fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut temporary = path.as_os_str().to_owned();
    temporary.push(".new");
    let temporary = PathBuf::from(temporary);
    // What a process that died has left half written.
    remove(&temporary)?;
    create(&temporary)?.write_all(bytes).map_err(at(&temporary))?;
    std::fs::rename(&temporary, path).map_err(at(path))
}

/// Makes a folder that its owner alone may look into.
///
/// # Errors
/// When there is something of this name already, or it cannot be made; the error names the folder.
pub fn create_folder(path: &Path) -> io::Result<()> {
    DirBuilder::new().mode(FOLDER_MODE).create(path).map_err(at(path))?;
    close_folder(path)
}

/// Closes a folder that is there to everybody but its owner.
pub(crate) fn close_folder(path: &Path) -> io::Result<()> {
    std::fs::set_permissions(path, Permissions::from_mode(FOLDER_MODE)).map_err(at(path))
}

/// Opens a file for reading and writing, unless a link stands in its place.
///
/// # Errors
/// When it cannot be opened; the error names the file.
pub(crate) fn open(path: &Path) -> io::Result<File> {
    let flags = rustix::fs::OFlags::NOFOLLOW.bits() as i32;
    OpenOptions::new().read(true).write(true).custom_flags(flags).open(path).map_err(at(path))
}

/// Device and inode of a file: another one in its place is another file.
pub(crate) type Identity = (u64, u64);

/// Which file stands there, if any; of a link the link itself.
pub(crate) fn identity(path: &Path) -> Option<Identity> {
    let found = std::fs::symlink_metadata(path).ok()?;
    Some((found.dev(), found.ino()))
}

/// A file, and when it was last written.
pub(crate) type Version = (Identity, i64, i64);

/// Which file stands there, if any, and as of when.
pub(crate) fn version(path: &Path) -> Option<Version> {
    let found = std::fs::symlink_metadata(path).ok()?;
    Some(((found.dev(), found.ino()), found.mtime(), found.mtime_nsec()))
}

/// Removes a file; that there is none is fine.
pub(crate) fn remove(path: &Path) -> io::Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(at(path)(error)),
        _ => Ok(()),
    }
}

/// An error with the path it is about, and with what has run out if that is why.
pub(crate) fn at(path: &Path) -> impl FnOnce(io::Error) -> io::Error {
    let path = path.display().to_string();
    move |error| {
        let lack = Lack::behind(&error).map(|lack| format!(" ({lack})")).unwrap_or_default();
        io::Error::new(error.kind(), format!("{path}: {error}{lack}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mode(path: &Path) -> u32 {
        std::fs::symlink_metadata(path).unwrap().permissions().mode() & 0o777
    }

    #[test]
    fn nobody_elses_and_through_no_link() {
        let folder = tempfile::tempdir().unwrap();
        let [file, link, victim] = ["file", "link", "victim"].map(|name| folder.path().join(name));
        drop(create(&file).unwrap());
        assert_eq!(mode(&file), 0o600);
        let error = create(&file).unwrap_err();
        assert!(error.to_string().starts_with(&*file.to_string_lossy()), "{error}");

        std::fs::write(&victim, "untouched").unwrap();
        std::os::unix::fs::symlink(&victim, &link).unwrap();
        assert!(create(&link).is_err() && open(&link).is_err());
        // A link is replaced, not followed; so is one that waits in the place of the temporary file.
        std::os::unix::fs::symlink(&victim, folder.path().join("link.new")).unwrap();
        replace(&link, b"mine").unwrap();
        assert_eq!(std::fs::read_to_string(&victim).unwrap(), "untouched");
        assert_eq!((std::fs::read_to_string(&link).unwrap().as_str(), mode(&link)), ("mine", 0o600));

        create_folder(&folder.path().join("inner")).unwrap();
        assert_eq!(mode(&folder.path().join("inner")), 0o700);
    }
}
