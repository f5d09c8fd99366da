//! Programs on other implementations of DDS, started and ended by a test.

use std::{
    env, fs,
    io::{BufRead, BufReader, Write},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    sync::{OnceLock, mpsc},
    thread,
    time::{Duration, Instant},
};

use serde_json::Value as Json;

use super::{domain::Domain, network::Place};
use crate::{interop, program::skip};

/// Deadline for an expected line of a peer: discovery takes a second, more on a loaded machine.
const PATIENCE: Duration = Duration::from_secs(40);
/// The same for a line behind hundreds of calls.
const LONG_PATIENCE: Duration = Duration::from_mins(5);
/// Lines that may wait for the test.
const MAX_LINES: usize = 1024;

/// DDS implementation of a peer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Vendor {
    Cyclone,
    FastDds,
}

pub(crate) const VENDORS: [Vendor; 2] = [Vendor::Cyclone, Vendor::FastDds];

/// A program that is running. Dropping it ends it.
pub(crate) struct Peer {
    child: Child,
    lines: mpsc::Receiver<Json>,
}

impl Peer {
    /// Starts `tests/peers`' program; `None` after reporting the reason if it cannot.
    pub(crate) fn start(vendor: Vendor, domain: &Domain, arguments: &[&str]) -> Option<Self> {
        Self::start_with(vendor, domain, arguments, &[])
    }

    /// The same with environment variables.
    pub(crate) fn start_with(
        vendor: Vendor,
        domain: &Domain,
        arguments: &[&str],
        environment: &[(&str, &str)],
    ) -> Option<Self> {
        let mut command = Command::new(compiled(vendor)?);
        command.args(arguments).args(["--domain", &domain.id.to_string()]);
        Some(Self::spawn(command.envs(environment.iter().copied())))
    }

    /// The same elsewhere on the network.
    pub(crate) fn start_in(
        place: &Place,
        vendor: Vendor,
        domain: &Domain,
        arguments: &[&str],
    ) -> Option<Self> {
        let mut command = place.command(compiled(vendor)?);
        command.args(arguments).args(["--domain", &domain.id.to_string()]);
        Some(Self::spawn(&mut command))
    }

    pub(crate) fn spawn(command: &mut Command) -> Self {
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let stdout = BufReader::new(child.stdout.take().unwrap());
        let (sender, lines) = mpsc::sync_channel(MAX_LINES);
        thread::spawn(move || {
            for line in stdout.lines().map_while(Result::ok) {
                let line = serde_json::from_str(&line).unwrap_or(Json::String(line));
                if sender.send(line).is_err() {
                    return;
                }
            }
        });
        Self { child, lines }
    }

    /// Starts `tests/interop/dds_peer.py`; `None` after reporting the reason if there is no Python.
    pub(crate) fn python(verb: &str, domain: &Domain, arguments: &[&str]) -> Option<Self> {
        let mut command = Command::new(interop::python()?);
        command.arg(interop::interop("dds_peer.py")).arg(verb).arg(domain.id.to_string());
        Some(Self::spawn(command.args(arguments)))
    }

    /// Releases a held publisher after its match: one end detects a match before the other.
    pub(crate) fn release(&mut self) {
        self.wait_for("matched");
        self.child.stdin.as_mut().unwrap().write_all(b"\n").unwrap();
    }

    /// Sends it a signal, such as `STOP`.
    pub(crate) fn signal(&self, name: &str) {
        crate::live::signal(&self.child, name);
    }

    /// The next line with `event`.
    pub(crate) fn wait_for(&self, event: &str) -> Json {
        self.wait_until(|line| line["event"] == event)
    }

    /// The next line with `event`, which takes long.
    pub(crate) fn wait_long_for(&self, event: &str) -> Json {
        self.wait_within(LONG_PATIENCE, |line| line["event"] == event)
    }

    /// The next line that is as wanted.
    pub(crate) fn wait_until(&self, is_wanted: impl Fn(&Json) -> bool) -> Json {
        self.wait_within(PATIENCE, is_wanted)
    }

    fn wait_within(&self, patience: Duration, is_wanted: impl Fn(&Json) -> bool) -> Json {
        let end = Instant::now() + patience;
        let mut seen = Vec::new();
        while let Ok(line) = self.lines.recv_timeout(end.saturating_duration_since(Instant::now()))
        {
            if is_wanted(&line) {
                return line;
            }
            seen.push(line);
        }
        panic!("the peer printed only {seen:?}");
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

fn compiled(vendor: Vendor) -> Option<&'static Path> {
    static CYCLONE: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    static FAST_DDS: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    let program = match vendor {
        Vendor::Cyclone => CYCLONE.get_or_init(|| compile("cc", "cyclone.c", &["-lddsc"])),
        Vendor::FastDds => {
            FAST_DDS.get_or_init(|| compile("c++", "fastdds.cpp", &["-lfastrtps", "-lfastcdr"]))
        }
    };
    match program {
        Ok(program) => Some(program),
        Err(reason) => {
            skip(&format!("a peer on {vendor:?}"), reason);
            assert!(env::var_os("CI").is_none(), "CI skips nothing: {reason}");
            None
        }
    }
}

/// Compiles one of `tests/peers` unless the compiled program is up to date.
fn compile(compiler: &str, source: &str, libraries: &[&str]) -> Result<PathBuf, String> {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers");
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join(source).with_extension("peer");
    let changed = |path: &Path| fs::metadata(path).and_then(|metadata| metadata.modified()).ok();
    let newest = [sources.join(source), sources.join("peer.h")];
    let newest = newest.iter().filter_map(|path| changed(path)).max();
    if changed(&program) > newest {
        return Ok(program);
    }
    let mut command = Command::new(compiler);
    command.arg("-O2").arg("-o").arg(&program).arg(sources.join(source)).args(libraries);
    match command.output() {
        Ok(output) if output.status.success() => Ok(program),
        Ok(output) => Err(format!("{command:?}: {}", String::from_utf8_lossy(&output.stderr))),
        Err(error) => Err(format!("{command:?}: {error}")),
    }
}
