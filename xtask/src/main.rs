//! Generates pages of the documentation from the program.

mod accuracy;
mod parameters;

use std::{
    env,
    io::{Write, stderr, stdout},
    path::Path,
    process::ExitCode,
};

const HELP: &str = "\
Usage: cargo xtask COMMAND

Commands:
  accuracy      Regenerates docs/accuracy.md and its plots. Takes minutes; the same sources give the same bytes.
  parameters    Regenerates docs/parameters.md from the parameter table.";

const WRONG_USAGE: u8 = 2;

fn main() -> anyhow::Result<ExitCode> {
    let root = root()?;
    let arguments: Vec<_> = env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["accuracy"] => accuracy::write(root)?,
        ["parameters"] => parameters::write(root)?,
        ["--help" | "-h"] => writeln!(stdout(), "{HELP}")?,
        _ => {
            writeln!(stderr(), "{HELP}")?;
            return Ok(WRONG_USAGE.into());
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// The root of the repository.
fn root() -> anyhow::Result<&'static Path> {
    let crate_directory = Path::new(env!("CARGO_MANIFEST_DIR"));
    crate_directory.parent().ok_or_else(|| anyhow::anyhow!("xtask must lie in the repository"))
}
