//! What a service logs: the library that reads it takes every lone word for the name of a module, so a
//! misspelt level would silence a service. Here words have to be levels, or modules that there are.

use super::suggest::nearest;
use std::path::Path;

/// The levels, from none to all.
const LEVELS: [&str; 6] = ["off", "error", "warn", "info", "debug", "trace"];

/// The crates beside the service's own that log in its process.
const LIBRARIES: [&str; 4] = ["board", "messages", "geometry", "files"];

/// What is wrong with the directives of a service that runs this binary: the word, and what to do.
pub(super) fn mistake<'a>(directives: &'a str, run: &str) -> Option<(&'a str, String)> {
    let own = Path::new(run).file_name().unwrap_or_default().to_string_lossy().replace('-', "_");
    let modules = || LIBRARIES.into_iter().chain([own.as_str()]);
    if directives.trim().is_empty() {
        return Some((directives, format!("write a level: {}", LEVELS.join(", "))));
    }
    // Spans and fields are for those who know them.
    if directives.contains(['[', '{']) {
        return None;
    }
    directives.split(',').map(str::trim).filter(|directive| !directive.is_empty()).find_map(|directive| {
        let (module, level) = match directive.split_once('=') {
            Some((module, level)) => (Some(module), Some(level)),
            None if is_level(directive) => (None, Some(directive)),
            None => (Some(directive), None),
        };
        if let Some(level) = level.filter(|level| !is_level(level)) {
            return Some((level, suggestion(level, LEVELS.into_iter())));
        }
        let module = module?;
        let name = module.split("::").next().unwrap_or(module);
        if modules().any(|known| known == name) {
            return None;
        }
        let help = match level {
            Some(_) => suggestion(name, modules()),
            None => suggestion(name, LEVELS.into_iter().chain(modules())),
        };
        Some((directive, help))
    })
}

fn is_level(word: &str) -> bool {
    LEVELS.iter().any(|level| level.eq_ignore_ascii_case(word)) || matches!(word.as_bytes(), [b'0'..=b'5'])
}

fn suggestion<'a>(word: &str, known: impl Iterator<Item = &'a str>) -> String {
    let known: Vec<&str> = known.collect();
    // What people write elsewhere.
    let meant = match word.to_ascii_lowercase().as_str() {
        "warning" => Some("warn"),
        "err" | "fatal" | "critical" => Some("error"),
        "none" | "quiet" | "silent" => Some("off"),
        "verbose" | "all" => Some("trace"),
        _ => nearest(word, known.iter().copied()),
    };
    match meant.filter(|meant| known.contains(meant)) {
        Some(meant) => format!("did you mean `{meant}`?"),
        None => format!("known are {}", known.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn wrong(directives: &str, word: &str, help: &str) {
        let (found, told) = mistake(directives, "grid-planner").expect(directives);
        assert_eq!(found, word);
        assert!(told.contains(help), "{told}");
    }

    #[test]
    fn words_are_levels_or_modules() {
        for good in [
            "off",
            "error",
            "warn",
            "info",
            "debug",
            "trace",
            "INFO",
            "3",
            "info,grid_planner=debug",
            " warn , board=trace",
            "grid_planner",
            "grid_planner::search=trace",
            "warn,",
            "info,[step{room=\"207\"}]=debug",
        ] {
            assert_eq!(mistake(good, "grid-planner"), None, "{good}");
        }
        assert_eq!(mistake("beeper=debug", "../target/release/beeper"), None);
        wrong("wran", "wran", "did you mean `warn`?");
        wrong("warning", "warning", "did you mean `warn`?");
        wrong("loud", "loud", "known are off, error, warn, info, debug, trace, board");
        wrong("", "", "write a level: off, error");
        wrong("  ", "  ", "write a level");
        wrong(
            "info,planner=debug",
            "planner=debug",
            "known are board, messages, geometry, files, grid_planner",
        );
        wrong("info,grid-planner=debug", "grid-planner=debug", "did you mean `grid_planner`?");
        wrong("grid_planer=debug", "grid_planer=debug", "did you mean `grid_planner`?");
        wrong("grid_planner=debgu", "debgu", "did you mean `debug`?");
        wrong("info=grid_planner", "grid_planner", "known are off");
        wrong("info,wran", "wran", "did you mean `warn`?");
        wrong("fatal", "fatal", "did you mean `error`?");
    }
}
