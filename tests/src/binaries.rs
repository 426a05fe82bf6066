//! The binaries under test: those that an operator runs, built once for all tests of a process.

use std::io::{BufRead as _, BufReader, Write};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::OnceLock;

/// The launcher's binary, after all services have been built.
///
/// # Panics
/// When the build fails, with cargo's words.
pub fn launcher() -> PathBuf {
    build().join("launch")
}

/// Builds the launcher, the `board` tool and every service in release, and returns the folder they are in.
/// When something has to be compiled, cargo's lines are passed on, since it may take minutes.
///
/// # Panics
/// When the build fails, with cargo's words.
#[allow(clippy::panic)]
pub fn build() -> &'static PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let child = Command::new(cargo)
            .args(["build", "--release", "--bins", "--workspace"])
            .args(["--message-format", "short", "--color", "never"])
            .current_dir(root)
            // What cargo set for this test would make it build everything anew.
            .env_remove("CARGO_MANIFEST_DIR")
            .stdin(Stdio::null())
            .stderr(Stdio::piped())
            .spawn();
        let mut child = child.unwrap_or_else(|error| panic!("cargo cannot be run: {error}"));
        let lines = child.stderr.take().into_iter().flat_map(|pipe| BufReader::new(pipe).lines());
        let said = passed_on(lines.map_while(Result::ok), &mut std::io::stderr());
        if !child.wait().is_ok_and(|status| status.success()) {
            panic!("the services do not build:\n{}", said.join("\n"));
        }
        target_folder().join("release")
    })
}

/// Cargo's lines, each written at once from the first on that says that something is done or waited for.
fn passed_on(lines: impl Iterator<Item = String>, to: &mut impl Write) -> Vec<String> {
    let mut is_told = false;
    let take = |line: String| {
        let is_work = ["Compiling", "Blocking", "Downloading"].iter().any(|word| line.contains(word));
        // Not by the macro, whose words are kept back until a test has failed. Who does not listen is not
        // told.
        if is_work && !std::mem::replace(&mut is_told, true) {
            let _ = writeln!(to, "building the services (release) ..");
        }
        if is_told {
            let _ = writeln!(to, "{line}");
        }
        line
    };
    lines.map(take).collect()
}

/// This test lies in `<target>/<profile>/deps`.
pub(crate) fn target_folder() -> PathBuf {
    let test = std::env::current_exe().unwrap_or_default();
    test.ancestors().nth(3).map(PathBuf::from).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(lines: &[&str], expected: &str) {
        let mut told = Vec::new();
        let kept = passed_on(lines.iter().map(|&line| line.to_owned()), &mut told);
        assert_eq!(
            (kept.as_slice(), String::from_utf8_lossy(&told).as_ref()),
            (lines.iter().map(|&line| line.to_owned()).collect::<Vec<_>>().as_slice(), expected)
        );
    }

    #[test]
    fn a_build_that_takes_long_is_told() {
        check(&["    Finished release"], "");
        check(
            &["   Compiling board v0.1.0", "    Finished release"],
            "building the services (release) ..\n   Compiling board v0.1.0\n    Finished release\n",
        );
    }
}
