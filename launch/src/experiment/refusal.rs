//! Why an experiment is refused.

use files::toml::TomlError;

/// More runs than this are a slip in the file.
pub(super) const RUNS_MAX: usize = 100_000;

/// The longest excerpt of a file with its complaint, in characters.
const EXCERPT_MAX: usize = 2000;

/// With the line in question, unless that is endless.
fn shown(cause: &TomlError) -> String {
    let text = cause.to_string();
    if text.len() <= EXCERPT_MAX { text } else { files::clipped(cause.message(), EXCERPT_MAX) }
}

/// Why an experiment file is refused.
#[derive(Debug, thiserror::Error)]
pub(super) enum PlanError {
    /// The file cannot be read.
    #[error("cannot read the experiment file {file}: {cause}")]
    Unreadable {
        /// The file.
        file: String,
        /// Why.
        cause: files::FileProblem,
    },
    /// The file is no experiment.
    #[error("{file}: {}", shown(.cause))]
    Malformed {
        /// The file.
        file: String,
        /// What is wrong, with its line.
        cause: Box<TomlError>,
    },
    /// Something to vary that is no list.
    #[error("`{key}` takes a list of values, such as [{value}]")]
    NotAList {
        /// What varies.
        key: String,
        /// What is there instead.
        value: String,
    },
    /// A list with nothing in it.
    #[error("`{key}` is an empty list: give it a value, or remove it")]
    EmptyList {
        /// What varies.
        key: String,
    },
    /// A binary that is not named by a text.
    #[error("the role `{role}` takes a binary's name in quotes, not {value}")]
    NotABinary {
        /// The role.
        role: String,
        /// What is there instead.
        value: String,
    },
    /// A ratio that is called like a figure.
    #[error("the ratio `{name}` is made of itself: give it a name of its own")]
    RatioOfItself {
        /// The name.
        name: String,
    },
    /// Two variants cannot be told apart.
    #[error("two variants are called `{name}`: give each a name of its own")]
    SameName {
        /// The name.
        name: String,
    },
    /// A variant's axis that the others do not have.
    #[error("`{key}` is varied across in a variant, but not in the experiment: name it under [across] too")]
    NotAnAxis {
        /// The key.
        key: String,
    },
    /// So many changes in so many runs that they do not fit into memory.
    #[error(
        "its runs change more than can be kept in mind: vary fewer parameters, or name long values in the graph"
    )]
    TooMuch,
    /// A limit that is none.
    #[error("limit_s = {limit_s} is not above zero")]
    NoLimit {
        /// The limit.
        limit_s: f64,
    },
    /// A variant that is not in the file.
    #[error("there is no variant `{name}`: {hint}")]
    NoSuchVariant {
        /// The name.
        name: String,
        /// What may be meant.
        hint: String,
    },
    /// Seeds that are not written as such.
    #[error("--seeds {given}: give the first and the last as 1..20, or single ones as 3,5,8")]
    Seeds {
        /// What was given.
        given: String,
    },
    /// A sweep, or a value for all, that is not written as such.
    #[error(
        "`{given}`: name a parameter and its values as planner.clearance_m=0.1,0.2,0.4, or a role and its binaries"
    )]
    Sweep {
        /// What was given.
        given: String,
    },
    /// A parameter that is swept or set more than once.
    #[error("`{key}` is given twice on the command line")]
    GivenTwice {
        /// What.
        key: String,
    },
    /// A parameter that is varied already.
    #[error("the experiment's file varies `{key}` already; choose among its values there")]
    VariedAlready {
        /// What.
        key: String,
    },
    /// No seeds, or far too much to do.
    #[error(
        "this makes {runs} runs; between 1 and {RUNS_MAX} are possible: change the seeds or what is varied"
    )]
    Size {
        /// How many.
        runs: usize,
    },
}
