//! The examples that `--help` shows. Each works beside the coffee robot, word for word.

/// What the tool is called, and what it is good for.
pub(crate) const BOARD: &[&str] = &[
    "board list                                 # what is on the board, who publishes it, how often",
    "board echo safety/clearance                # every message, with names and units",
    "board echo wheels/odometry --field forward_mps --json -n 10",
    "board rate tof/ranges world/truth          # messages per second and how regular they are",
    "board doctor                               # what is wrong with this machine, and what to do",
];
pub(crate) const LIST: &[&str] =
    &["board list", "board list --services", "board list --json | jq '.[].topic'"];
pub(crate) const INFO: &[&str] = &["board info safety/clearance", "board info drive.mcap"];
pub(crate) const ECHO: &[&str] = &[
    "board echo safety/clearance",
    "board echo location/pose --field x_m",
    "board echo tof/ranges --json -n 1 --timeout 5 | jq .message",
];
pub(crate) const RATE: &[&str] = &["board rate", "board rate tof/ranges --interval 5 -n 1 --json"];
pub(crate) const DELAY: &[&str] = &["board delay wheels/applied -n 1000"];
pub(crate) const PUBLISH: &[&str] = &[
    "board publish mission/orders '{\"room\": \"211\"}'",
    "board publish wheels/desired '{\"left_mps\": 0.1}' --rate 20 -n 100 --force",
    "board publish safety/clearance --raw random --seed 7 -n 1000 --rate 500 --force",
    "board publish tof/ranges --raw @ranges.bin --force",
];
pub(crate) const RECORD: &[&str] =
    &["board record -o drive.mcap", "board record 'tof/*' wheels/applied -o short.mcap --duration 10"];
pub(crate) const REPLAY: &[&str] = &[
    "board replay drive.mcap --topics 'tof/*',tag/ranges --force",
    "board replay drive.mcap --speed 10 --loop --force",
];
pub(crate) const CLEAN: &[&str] = &["board clean", "board clean --board coffee"];
pub(crate) const DOCTOR: &[&str] = &["board doctor || echo 'not fit to drive'"];
pub(crate) const COMPLETIONS: &[&str] =
    &["board completions bash > ~/.local/share/bash-completion/completions/board"];

/// The end of a command's help.
pub(crate) fn help(examples: &[&str], more: &str) -> String {
    let title = if examples.len() == 1 { "Example:" } else { "Examples:" };
    let more = if more.is_empty() { String::new() } else { format!("\n\n{more}") };
    format!("{title}\n  {}{more}", examples.join("\n  "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Cli;
    use clap::Parser as _;

    /// The words of a command as a shell splits them, up to a pipe or whatever else is the shell's.
    fn words(command: &str) -> Vec<String> {
        let mut words = vec![String::new()];
        let mut quoted = false;
        for letter in command.chars() {
            match letter {
                '\'' => quoted = !quoted,
                ' ' if !quoted => words.push(String::new()),
                _ => words.last_mut().unwrap().push(letter),
            }
        }
        let shell = |word: &String| matches!(word.as_str(), "|" | "||" | ">" | "#");
        words.into_iter().filter(|word| !word.is_empty()).take_while(|word| !shell(word)).collect()
    }

    #[test]
    fn every_example_is_a_command() {
        let all = [BOARD, LIST, INFO, ECHO, RATE, DELAY, PUBLISH, RECORD, REPLAY, CLEAN, DOCTOR, COMPLETIONS];
        for command in all.iter().copied().flatten() {
            if let Err(error) = Cli::try_parse_from(words(command)) {
                panic!("`{command}`: {error}");
            }
        }
    }
}
