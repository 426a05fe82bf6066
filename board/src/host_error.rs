//! Why a board cannot be made, or be a host's.

use crate::lack::Lack;
use crate::place::InvalidBoardName;
use crate::switchboard;
use crate::transport::TransportError;
use std::io;

/// Why a board cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum HostError {
    /// The name.
    #[error(transparent)]
    Name(#[from] InvalidBoardName),
    /// It is up.
    #[error(
        "the board `{board}` is up already (launcher {pid}); stop it with `launch stop --board {board}`, or use another name with --board"
    )]
    Taken {
        /// The board.
        board: String,
        /// Its launcher's process.
        pid: u32,
    },
    /// It is up, and cannot be reached any more.
    #[error(
        "the launcher of the board `{board}` (process {pid}) lives, though the board's folder was deleted, so a second robot is not started \
         beside it; it stops by itself, or with `kill {pid}`"
    )]
    Displaced {
        /// The board.
        board: String,
        /// Its launcher's process.
        pid: u32,
    },
    /// There is not enough shared memory, or something else for it.
    #[error("the board `{board}` with {topics} topic{} cannot be made: {lack}", if *topics == 1 { "" } else { "s" })]
    Lack {
        /// The board.
        board: String,
        /// How many topics it was to have.
        topics: usize,
        /// What is lacking.
        lack: Lack,
    },
    /// Too many topics.
    #[error("the graph has {topics} topics; a board holds {}", switchboard::TOPICS)]
    TooManyTopics {
        /// How many.
        topics: usize,
    },
    /// Files.
    #[error("the board's files: {0}")]
    Io(#[from] io::Error),
    /// The transport.
    #[error(transparent)]
    Transport(#[from] TransportError),
}
