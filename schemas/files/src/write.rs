//! Writing: beside the name first, and under it only when all of it is on the disk.

use crate::read::kind_unless_plain;
use crate::{FileError, FileProblem, at};
use rustix::fs::{Access, AtFlags, Mode, OFlags};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// A file that is written and on the disk, but not yet under its name. Dropped before, it leaves nothing
/// behind.
#[derive(Debug)]
pub struct Draft {
    beside: PathBuf,
    place: PathBuf,
    is_put: bool,
}

impl Draft {
    /// Writes a file beside `path`, where links lead.
    ///
    /// # Errors
    /// When something other than a plain file is in its place, or it cannot be written.
    pub fn write(
        path: &Path,
        content: impl FnOnce(&mut BufWriter<&File>) -> std::io::Result<()>,
    ) -> Result<Self, FileError> {
        let place = place_of(path).map_err(at(path))?;
        let name = place.file_name().unwrap_or_default().to_string_lossy();
        let beside = place.with_file_name(format!(".{name}.{}.new", std::process::id()));
        // Only a process of this number could have left it, and that one is no more.
        let _ = std::fs::remove_file(&beside);
        let flags = OFlags::WRONLY | OFlags::CREATE | OFlags::EXCL | OFlags::NOFOLLOW | OFlags::CLOEXEC;
        let file = rustix::fs::open(&beside, flags, Mode::from_raw_mode(0o666));
        let file = File::from(file.map_err(|error| at(path)(std::io::Error::from(error)))?);
        let draft = Self { beside, place, is_put: false };
        draft.fill(&file, content).map_err(at(path))?;
        Ok(draft)
    }

    fn fill(
        &self,
        file: &File,
        content: impl FnOnce(&mut BufWriter<&File>) -> std::io::Result<()>,
    ) -> std::io::Result<()> {
        // Who may read the file that is replaced may read the new one.
        if let Ok(old) = self.place.metadata() {
            file.set_permissions(old.permissions())?;
        }
        let mut writer = BufWriter::new(file);
        content(&mut writer)?;
        writer.flush()?;
        file.sync_all()
    }

    /// Puts the file under its name, in the place of the plain file that may be there.
    ///
    /// # Errors
    /// When it cannot be; then all is as it was.
    pub fn put(mut self) -> Result<(), FileError> {
        std::fs::rename(&self.beside, &self.place).map_err(at(&self.place))?;
        self.is_put = true;
        // The name is on the disk when its folder is; a file system that cannot do that does without.
        let folder = folder_of(&self.place);
        let _ = File::open(folder).and_then(|folder| folder.sync_all());
        Ok(())
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        if !self.is_put {
            let _ = std::fs::remove_file(&self.beside);
        }
    }
}

/// Whether a file can be written there: its folder exists and may be written, and nothing but a plain file
/// has its name. For set-ups that are checked before they are used.
///
/// # Errors
/// When it could not be.
pub fn check_place(path: &Path) -> Result<(), FileError> {
    let place = place_of(path).map_err(at(path))?;
    let folder = folder_of(&place);
    rustix::fs::accessat(rustix::fs::CWD, folder, Access::WRITE_OK | Access::EXEC_OK, AtFlags::EACCESS)
        .map_err(|error| {
            let why = std::io::Error::from(error);
            at(path)(FileProblem::BadPlace(format!(
                "nothing can be written into {}: {why}",
                folder.display()
            )))
        })
}

/// The file itself, behind links; it need not exist, but its folder must.
fn place_of(path: &Path) -> Result<PathBuf, FileProblem> {
    if path.file_name().is_none() || path.as_os_str().as_encoded_bytes().ends_with(b"/") {
        return Err(FileProblem::BadPlace(
            "this is the name of a folder, and a file is to be written".to_owned(),
        ));
    }
    let folder = folder_of(path);
    if !folder.is_dir() {
        let why = if folder.exists() { "is no folder" } else { "does not exist" };
        return Err(FileProblem::BadPlace(format!("the folder {} {why}", folder.display())));
    }
    match path.metadata() {
        Ok(found) => match kind_unless_plain(found.file_type()) {
            Some(kind) => Err(FileProblem::NotPlain { kind }),
            None => Ok(path.canonicalize()?),
        },
        // A link that leads nowhere is replaced no more than a device.
        Err(_) if path.is_symlink() => Err(FileProblem::NotPlain { kind: "a link that leads nowhere" }),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(path.to_owned()),
        Err(error) => Err(error.into()),
    }
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}
