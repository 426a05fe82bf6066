//! The binaries under test: those that an operator runs, built once for all tests of a process.

use std::path::PathBuf;
use std::process::Command;
use std::sync::OnceLock;

/// The launcher's binary, after all services have been built.
///
/// # Panics
/// When the build fails, with cargo's words.
pub fn launcher() -> PathBuf {
    build().join("launch")
}

/// Builds the launcher, the `board` tool and every service in release, and returns the folder they are in.
///
/// # Panics
/// When the build fails, with cargo's words.
#[allow(clippy::panic)]
pub fn build() -> &'static PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let output = Command::new(cargo)
            .args(["build", "--release", "--bins", "--workspace"])
            .args(["--message-format", "short", "--color", "never"])
            .current_dir(root)
            // What cargo set for this test would make it build everything anew.
            .env_remove("CARGO_MANIFEST_DIR")
            .output();
        match output {
            Ok(output) if output.status.success() => {}
            Ok(output) => panic!("the services do not build:\n{}", String::from_utf8_lossy(&output.stderr)),
            Err(error) => panic!("cargo cannot be run: {error}"),
        }
        target_folder().join("release")
    })
}

/// This test lies in `<target>/<profile>/deps`.
pub(crate) fn target_folder() -> PathBuf {
    let test = std::env::current_exe().unwrap_or_default();
    test.ancestors().nth(3).map(PathBuf::from).unwrap_or_default()
}
