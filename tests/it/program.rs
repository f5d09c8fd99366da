//! Runs the executable as users do.

use std::{
    ffi::OsStr,
    fs,
    io::{self, Write},
    path::Path,
    process::{Command, Output},
};

use serde_json::Value as Json;

pub(crate) const EXECUTABLE: &str = env!("CARGO_BIN_EXE_laser_profiler");

/// The exit of the executable.
#[derive(Debug)]
pub(crate) struct Ended {
    /// Exit code; `None` when a signal ended it, as an abort does.
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

/// The executable in the root of the repository, where the paths in the documents hold.
pub(crate) fn laser_profiler<Text: AsRef<OsStr>>(arguments: &[Text]) -> Command {
    let mut command = Command::new(EXECUTABLE);
    command.args(arguments).current_dir(env!("CARGO_MANIFEST_DIR"));
    command
}

/// The executable under shell commands that limit its resources.
pub(crate) fn limited<Text: AsRef<OsStr>>(limits: &str, arguments: &[Text]) -> Command {
    let mut command = Command::new("bash");
    command.args(["-c", &format!("{limits}; exec \"$0\" \"$@\""), EXECUTABLE]);
    command.args(arguments).current_dir(env!("CARGO_MANIFEST_DIR"));
    command
}

/// Runs a command to its end.
pub(crate) fn end(command: &mut Command) -> Ended {
    let Output { status, stdout, stderr } = command.output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    Ended { code: status.code(), stdout: text(stdout), stderr: text(stderr) }
}

/// Replays one recording with `--json` and more arguments; the exit code must be `code`.
pub(crate) fn replay(input: &Path, output: &Path, code: i32, arguments: &[&str]) -> (Json, String) {
    let mut command = laser_profiler(&["replay", "--json", "-o"]);
    let ended = end(command.arg(output).arg(input).args(arguments));
    assert_eq!(ended.code, Some(code), "{}: {ended:?}", input.display());
    let summary: Json = serde_json::from_str(&ended.stdout).unwrap();
    let frames = |bin: &str| summary["frames"][bin].as_u64().unwrap();
    let accounted = frames("processed") + frames("rejected") + frames("dropped");
    assert_eq!(frames("received"), accounted, "a frame in no bin, or in two: {summary}");
    (summary, ended.stderr)
}

/// Reports a skipped test and the reason. `eprintln!` would not do: the test harness hides it when a test passes.
pub(crate) fn skip(what: &str, reason: &str) {
    io::stderr().write_all(format!("SKIPPED {what}: {reason}\n").as_bytes()).unwrap();
}

/// Names and contents of the files in a directory, in order.
pub(crate) fn content(directory: &Path) -> Vec<(String, Vec<u8>)> {
    let mut files: Vec<_> = fs::read_dir(directory)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .map(|path| {
            (path.file_name().unwrap().to_string_lossy().into_owned(), fs::read(&path).unwrap())
        })
        .collect();
    files.sort();
    files
}
