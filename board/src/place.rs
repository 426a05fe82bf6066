//! Where a board lies in shared memory, and how it is found and removed.

use std::fs;
use std::io;
use std::os::unix::fs::{DirBuilderExt as _, MetadataExt as _, PermissionsExt as _};
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
        self.root.exists()
    }

    /// Makes the folder, for its owner alone.
    ///
    /// # Errors
    /// When it exists, belongs to another user, or cannot be made.
    pub fn create(&self) -> io::Result<()> {
        let folder = boards_folder();
        match fs::DirBuilder::new().mode(0o700).create(&folder) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                // Somebody else may have made it first, to look into our boards.
                let found = fs::symlink_metadata(&folder)?;
                let user = rustix::process::getuid().as_raw();
                if !found.is_dir() || found.uid() != user {
                    return Err(io::Error::new(
                        io::ErrorKind::PermissionDenied,
                        format!("{} does not belong to this user; remove it", folder.display()),
                    ));
                }
                fs::set_permissions(&folder, fs::Permissions::from_mode(0o700))?;
            }
            other => other?,
        }
        fs::DirBuilder::new().mode(0o700).create(&self.root)
    }

    /// Removes everything that lies here, used or not. Only for a board whose processes are gone.
    ///
    /// # Errors
    /// When a file cannot be removed.
    pub fn remove(&self) -> io::Result<()> {
        for file in self.shared_memory() {
            ignore_missing(fs::remove_file(file))?;
        }
        ignore_missing(fs::remove_dir_all(&self.root))?;
        // The last board takes the folder along; it stays while others are in it.
        let _ = fs::remove_dir(boards_folder());
        Ok(())
    }

    /// The board's files in shared memory outside its folder.
    pub fn shared_memory(&self) -> Vec<PathBuf> {
        let Ok(entries) = fs::read_dir("/dev/shm") else { return Vec::new() };
        let ours = |path: &PathBuf| {
            path.file_name().and_then(|name| name.to_str()).is_some_and(|name| name.starts_with(&self.prefix))
        };
        entries.flatten().map(|entry| entry.path()).filter(ours).collect()
    }
}

/// The boards of this user that have a folder, in order of their names.
pub fn places() -> Vec<Place> {
    let Ok(entries) = fs::read_dir(boards_folder()) else { return Vec::new() };
    let mut places: Vec<Place> =
        entries.flatten().filter_map(|entry| Place::new(entry.file_name().to_str()?).ok()).collect();
    places.sort();
    places
}

fn boards_folder() -> PathBuf {
    // Shared memory rather than the temporary directory: three times faster to set up, and gone after a power loss.
    PathBuf::from(format!("/dev/shm/corkboard-{}", rustix::process::getuid().as_raw()))
}

fn ignore_missing(result: io::Result<()>) -> io::Result<()> {
    match result {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        other => other,
    }
}
