//! What has run out when the transport fails: named, with its numbers and the remedy.
//!
//! The transport reports an exhausted resource by what failed because of it (`InternalFailure`). So on a
//! failure the limits of the process and the state of shared memory are looked at.

use crate::names::SHARED_MEMORY;
use crate::segments;
use crate::terminal::bytes;
use rustix::fs::{StatVfs, StatVfsMountFlags};
use rustix::process::{Resource, getrlimit};
use std::{fmt, fs, io};

/// A process that has fewer descriptors left than this has run out of them: a port takes a handful.
const FILES_SPARE: u64 = 8;
/// Shared memory with less left than this is full: the smallest thing that the transport makes is a page, and
/// it makes a few at once.
const BYTES_SPARE: u64 = 64 * 1024;
/// A process that can map less than this further has run out of address space.
const ADDRESS_SPACE_SPARE: u64 = 16 * 1024 * 1024;
/// Files that shared memory must still have room for.
const INODES_SPARE: u64 = 16;

/// A resource that has run out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Lack {
    /// Open files of this process.
    Files {
        /// How many it may have.
        limit: u64,
    },
    /// Open files of the whole machine.
    FilesOfMachine,
    /// Shared memory.
    Memory {
        /// How much was asked for, in bytes; zero when that is not known.
        needed: u64,
        /// How much is free, in bytes.
        free: u64,
        /// How much there is in all, in bytes.
        size: u64,
    },
    /// Files in shared memory, however small.
    Inodes {
        /// How many there may be.
        most: u64,
    },
    /// Shared memory that may only be read.
    ReadOnly,
    /// Address space of this process.
    AddressSpace {
        /// How much it may map, in bytes.
        limit: u64,
        /// How much it has mapped, in bytes.
        mapped: u64,
    },
}

impl Lack {
    /// What has run out, if anything has.
    pub fn look() -> Option<Self> {
        Self::of_files(0).or_else(Self::of_shared_memory).or_else(Self::of_address_space)
    }

    /// What has run out that makes a call of the system fail so, if anything has.
    pub fn behind(error: &io::Error) -> Option<Self> {
        match error.raw_os_error()? {
            libc::EMFILE => Some(Self::Files { limit: file_limit() }),
            libc::ENFILE => Some(Self::FilesOfMachine),
            libc::ENOMEM => Self::of_address_space(),
            libc::ENOSPC | libc::EROFS => Self::of_shared_memory(),
            _ => None,
        }
    }

    /// Whether this process, or the machine, can open hardly any file beyond so many more.
    pub(crate) fn of_files(more: u64) -> Option<Self> {
        let limit = file_limit();
        match fs::read_dir("/proc/self/fd") {
            Ok(entries) => {
                let left = limit.saturating_sub(entries.count() as u64);
                (left < more + FILES_SPARE).then_some(Self::Files { limit })
            }
            Err(error) => Self::behind(&error),
        }
    }

    fn of_shared_memory() -> Option<Self> {
        let needed = segments::take_refused();
        let found = rustix::fs::statvfs(SHARED_MEMORY).ok()?;
        if found.f_flag.contains(StatVfsMountFlags::RDONLY) {
            return Some(Self::ReadOnly);
        }
        let (free, size) = (free_bytes(&found), found.f_blocks * found.f_frsize);
        if needed > 0 || free < BYTES_SPARE {
            return Some(Self::Memory { needed, free, size });
        }
        // No number at all means no limit.
        let scarce = found.f_files > 0 && found.f_favail < INODES_SPARE;
        scarce.then_some(Self::Inodes { most: found.f_files })
    }

    fn of_address_space() -> Option<Self> {
        let limit = getrlimit(Resource::As).current?;
        let status = fs::read_to_string("/proc/self/status").ok()?;
        let kibibytes = status.lines().find_map(|line| line.strip_prefix("VmSize:"))?;
        let kibibytes: u64 = kibibytes.trim().trim_end_matches("kB").trim_end().parse().ok()?;
        let mapped = 1024 * kibibytes;
        let scarce = limit.saturating_sub(mapped) < ADDRESS_SPACE_SPARE.max(segments::last_bytes());
        scarce.then_some(Self::AddressSpace { limit, mapped })
    }
}

/// How many files this process may have open.
fn file_limit() -> u64 {
    getrlimit(Resource::Nofile).current.unwrap_or(u64::MAX)
}

/// How many bytes of a file system are free for this user.
pub(crate) fn free_bytes(found: &StatVfs) -> u64 {
    found.f_bavail * found.f_frsize
}

/// A size of shared memory in which there is room for so much more, in whole MiB, as `mount` and `docker`
/// take it.
pub(crate) fn enough_mib(size: u64, free: u64, needed: u64) -> u64 {
    (size.saturating_sub(free) + needed).div_ceil(1024 * 1024).next_power_of_two().max(16)
}

impl fmt::Display for Lack {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Files { limit } => {
                write!(
                    f,
                    "this process may open {limit} files, which are too few; `ulimit -n 1024` allows more"
                )
            }
            Self::FilesOfMachine => write!(
                f,
                "the machine has as many files open as it may (`cat /proc/sys/fs/file-nr`); \
                 end what opens so many, or `sysctl -w fs.file-max=1000000`"
            ),
            Self::Memory { needed, free, size } => {
                match needed {
                    0 => write!(f, "shared memory is full: ")?,
                    _ => write!(f, "{} of shared memory are needed: ", bytes(needed))?,
                }
                let mib = enough_mib(size, free, needed);
                write!(
                    f,
                    "{SHARED_MEMORY} has {} free of {}; remove what fills it, or enlarge it: \
                     `mount -o remount,size={mib}M {SHARED_MEMORY}` (in a container: `--shm-size={mib}m`)",
                    bytes(free),
                    bytes(size)
                )
            }
            Self::Inodes { most } => write!(
                f,
                "{SHARED_MEMORY} holds {most} files, which are all there; remove what fills it, or allow more: \
                 `mount -o remount,nr_inodes={} {SHARED_MEMORY}`",
                (2 * most).max(4096)
            ),
            Self::ReadOnly => write!(
                f,
                "{SHARED_MEMORY} is mounted read-only; `mount -o remount,rw {SHARED_MEMORY}` makes it writable"
            ),
            Self::AddressSpace { limit, mapped } => write!(
                f,
                "this process may map {} and has {} mapped; `ulimit -v unlimited` allows more",
                bytes(limit),
                bytes(mapped)
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_remedy_is_large_enough() {
        const MIB: u64 = 1024 * 1024;
        assert_eq!(enough_mib(64 * MIB, 60 * MIB, MIB), 16);
        assert_eq!(enough_mib(64 * MIB, 0, 5 * MIB), 128);
        assert_eq!(enough_mib(64 * MIB, MIB, 400 * MIB), 512);
        let lack = Lack::Memory { needed: 5 * MIB, free: 0, size: 64 * MIB }.to_string();
        assert!(
            lack.contains("5.00 MiB of shared memory are needed") && lack.contains("size=128M"),
            "{lack}"
        );
    }
}
