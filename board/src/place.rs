//! Where a board lies in shared memory, and how it is found and removed.

use crate::names::SHARED_MEMORY;
use crate::private;

pub use crate::names::boards_folder;

use std::fs;
use std::io;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

/// Longest board name, in bytes. The transport takes 60 bytes for folder and prefix together.
pub const NAME_MAX: usize = 20;

/// A name that cannot be a board's.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{name}` cannot be a board's name: use 1 to {NAME_MAX} lower-case letters, digits and hyphens")]
pub struct InvalidBoardName {
    /// The name given.
    pub name: String,
}

/// Where one board lies: a folder and a prefix of its own in shared memory, so that two boards never meet.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    name: String,
    root: PathBuf,
    prefix: String,
}

impl Place {
    /// The place of the board with this name, whether or not it exists. Boards belong to a user: two users' boards of one name are two.
    ///
    /// # Errors
    /// When the name has other characters than `a-z0-9-`, or is too long.
    pub fn new(name: &str) -> Result<Self, InvalidBoardName> {
        let plain = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-';
        if name.is_empty() || name.len() > NAME_MAX || !name.bytes().all(plain) {
            return Err(InvalidBoardName { name: name.to_owned() });
        }
        let user = rustix::process::getuid().as_raw();
        let root = boards_folder().join(name);
        // Names in shared memory carry the prefix alone, so it stands for user and name; no other file begins like it.
        // Eight digits, because the transport takes 60 bytes for folder and prefix together.
        let hash = format!("{user}/{name}")
            .bytes()
            .fold(0x811c_9dc5_u32, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193));
        Ok(Self { name: name.to_owned(), root, prefix: format!("c{hash:08x}_") })
    }

    /// The board's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The board's folder in shared memory.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// What the names of the board's shared memory begin with.
    pub fn prefix(&self) -> &str {
        &self.prefix
    }

    /// A file in the board's folder.
    pub fn file(&self, name: &str) -> PathBuf {
        self.root.join(name)
    }

    /// Whether a folder of this board exists.
    pub fn exists(&self) -> bool {
        self.check().is_ok()
    }

    /// Whether the board's folder exists, and it and the one around it are this user's own.
    ///
    /// # Errors
    /// Of kind `NotFound` when it does not exist; when somebody else has made it, with its path and owner.
    pub(crate) fn check(&self) -> io::Result<()> {
        own_folder(&boards_folder())?;
        own_folder(&self.root).map(|_| ())
    }

    /// Makes the folder, for its owner alone.
    ///
    /// # Errors
    /// When it exists, belongs to another user, or cannot be made.
    pub fn create(&self) -> io::Result<()> {
        make_boards_folder(&boards_folder())?;
        private::create_folder(&self.root)
    }

    /// Removes everything that lies here, used or not. Only for a board whose processes are gone, and by whoever has the [`Turn`].
    ///
    /// # Errors
    /// When a file cannot be removed.
    pub fn remove(&self) -> io::Result<()> {
        self.remove_shared_memory()?;
        // Everybody may write into /dev/shm. A folder that is not ours, or a link, could lead anywhere.
        match own_folder(&boards_folder()) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
            other => _ = other?,
        }
        match fs::remove_dir_all(&self.root) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(private::at(&self.root)(error)),
            _ => Ok(()),
        }
    }

    /// Removes the board's files in shared memory outside its folder.
    pub(crate) fn remove_shared_memory(&self) -> io::Result<()> {
        self.shared_memory().iter().try_for_each(|file| {
            private::remove(file).map_err(|error| match fs::symlink_metadata(file) {
                Ok(found) if error.kind() == io::ErrorKind::PermissionDenied => io::Error::new(
                    error.kind(),
                    format!(
                        "{error}; it belongs to user {}: have it removed, or choose another name with --board",
                        found.uid()
                    ),
                ),
                _ => error,
            })
        })
    }

    /// The board's files in shared memory outside its folder.
    pub fn shared_memory(&self) -> Vec<PathBuf> {
        let Ok(entries) = fs::read_dir(SHARED_MEMORY) else { return Vec::new() };
        let ours = |path: &PathBuf| {
            path.file_name().and_then(|name| name.to_str()).is_some_and(|name| name.starts_with(&self.prefix))
        };
        entries.flatten().map(|entry| entry.path()).filter(ours).collect()
    }
}

/// Whether the folder of the boards is this user's own, or not there.
///
/// # Errors
/// When somebody else has made it, with its path and owner.
pub(crate) fn check_folder() -> io::Result<()> {
    match own_folder(&boards_folder()) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// The boards of this user that have a folder, in order of their names.
pub fn places() -> Vec<Place> {
    let folder = boards_folder();
    if own_folder(&folder).is_err() {
        return Vec::new();
    }
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut places: Vec<Place> = entries
        .flatten()
        .filter_map(|entry| Place::new(entry.file_name().to_str()?).ok())
        .filter(Place::exists)
        .collect();
    places.sort();
    places
}

/// The turn to make or to clear away boards: one process of the user at a time, so that nobody clears away a board that another is just making.
#[derive(Debug)]
pub struct Turn {
    _folder: fs::File,
}

impl Turn {
    /// Waits for the turn.
    ///
    /// # Errors
    /// When the folder of the boards belongs to another user, or cannot be made.
    pub fn take() -> io::Result<Self> {
        let folder = boards_folder();
        loop {
            make_boards_folder(&folder)?;
            let file = match fs::File::open(&folder) {
                Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
                other => other.map_err(private::at(&folder))?,
            };
            rustix::fs::flock(&file, rustix::fs::FlockOperation::LockExclusive)
                .map_err(io::Error::from)
                .map_err(private::at(&folder))?;
            // Whoever took down the last board meanwhile has removed the folder that we hold.
            if fs::symlink_metadata(&folder)
                .is_ok_and(|found| file.metadata().is_ok_and(|ours| ours.ino() == found.ino()))
            {
                return Ok(Self { _folder: file });
            }
        }
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        // Only an empty folder goes.
        let _ = fs::remove_dir(boards_folder());
    }
}

fn make_boards_folder(folder: &Path) -> io::Result<()> {
    match private::create_folder(folder) {
        // Removed again between its making and the setting of its mode.
        Err(error) if error.kind() == io::ErrorKind::NotFound && Path::new(SHARED_MEMORY).exists() => Ok(()),
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
            match own_folder(folder) {
                // Removed by another process just now; whoever needs it tries again.
                Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
                Err(error) => Err(error),
                Ok(0o700) => Ok(()),
                Ok(_) => private::close_folder(folder),
            }
        }
        other => other,
    }
}

/// The mode of a folder, which must be one, and this user's: somebody else may have made it first, to look into our boards, or to have
/// their files removed by us.
fn own_folder(folder: &Path) -> io::Result<u32> {
    let found = fs::symlink_metadata(folder).map_err(private::at(folder))?;
    let user = rustix::process::getuid().as_raw();
    if found.is_dir() && found.uid() == user {
        return Ok(found.mode() & 0o777);
    }
    Err(io::Error::new(
        io::ErrorKind::PermissionDenied,
        format!(
            "{} is not a folder of this user (it belongs to user {}); remove it, or have it removed",
            folder.display(),
            found.uid()
        ),
    ))
}
