//! `launch digest` and `launch diff`: are two runs the same, and where do they part?

use recording::{Recording, first_difference};
use std::path::Path;
use std::process::ExitCode;

/// `launch digest FILE`.
pub(crate) fn digest(file: &Path, as_json: bool) -> Result<(), String> {
    let digest = Recording::open(file).and_then(|run| run.digest()).map_err(|error| error.to_string())?;
    if as_json {
        println!("{}", serde_json::to_string_pretty(&digest).map_err(|error| error.to_string())?);
        return Ok(());
    }
    println!("{}  {} messages", digest.digest, digest.messages);
    for (topic, (count, hash)) in &digest.topics {
        println!("  {hash}  {count:>8}  {topic}");
    }
    Ok(())
}

/// `launch diff A B`: exit code 0 when the runs are the same, 1 when they differ.
pub(crate) fn diff(a: &Path, b: &Path, as_json: bool) -> Result<ExitCode, String> {
    let open = |file: &Path| Recording::open(file).map_err(|error| error.to_string());
    let difference = first_difference(&open(a)?, &open(b)?).map_err(|error| error.to_string())?;
    match (&difference, as_json) {
        (difference, true) => {
            println!("{}", serde_json::json!({"same": difference.is_none(), "difference": difference}))
        }
        (None, false) => println!("the runs are the same"),
        (Some(difference), false) => println!("{difference}"),
    }
    Ok(if difference.is_none() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
