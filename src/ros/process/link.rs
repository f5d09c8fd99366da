//! A running middleware process and its pipes.

use std::{
    fs::File,
    io::{self, BufRead, BufReader, Read},
    os::unix::{fs::FileExt, process::CommandExt},
    path::PathBuf,
    process::{Child, Command, Stdio},
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use super::{
    lock, log,
    orders::{Event, Level},
    registry::Orders,
    wire,
};

/// Size of the pipes, bytes. Larger than the system's, so that a large image needs fewer switches.
const PIPE_BYTES: usize = 1 << 20;
/// Longest line on standard error that is logged whole, bytes.
const MAX_LINE_BYTES: u64 = 4096;
/// Time for the process to leave the network.
const FAREWELL: Duration = Duration::from_secs(1);
const EXIT_CHECK: Duration = Duration::from_millis(2);
/// More than the seven numbers of `/proc/PID/statm` take.
const MAX_STATM_BYTES: usize = 160;

/// The program that runs the middleware.
#[derive(Clone, Debug)]
pub(crate) struct WorkerCommand {
    /// Executable.
    pub(crate) program: PathBuf,
    /// Its arguments.
    pub(crate) arguments: Vec<String>,
}

/// The process. Dropping it ends it.
pub(super) struct Link {
    pub(super) orders: Arc<Orders>,
    child: Child,
    /// The process's memory in pages; `None` where the system does not state it.
    statm: Option<File>,
    threads: Vec<JoinHandle<()>>,
    /// True once its events have ended.
    is_silent: Arc<AtomicBool>,
    last_line: Arc<Mutex<String>>,
}

impl Link {
    /// Starts the process. Its events go to `take`, on a thread.
    ///
    /// # Errors
    /// The system cannot start the program or a thread.
    pub(super) fn start(
        command: &WorkerCommand,
        mut take: impl FnMut(Event, Vec<u8>) + Send + 'static,
    ) -> io::Result<Self> {
        let mut child = Command::new(&command.program)
            .args(&command.arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            // Ctrl-C in a terminal is for the node, which still needs the network then.
            .process_group(0)
            .spawn()?;
        let piped = (child.stdin.take(), child.stdout.take(), child.stderr.take());
        let (Some(input), Some(output), Some(errors)) = piped else {
            return Err(io::Error::other("no pipes"));
        };
        // Works with the system's size, too.
        _ = rustix::pipe::fcntl_setpipe_size(&output, PIPE_BYTES);
        _ = rustix::pipe::fcntl_setpipe_size(&input, PIPE_BYTES);
        let orders = Arc::<Orders>::default();
        let mut link = Self {
            orders: Arc::clone(&orders),
            statm: File::open(format!("/proc/{}/statm", child.id())).ok(),
            child,
            threads: Vec::new(),
            is_silent: Arc::default(),
            last_line: Arc::default(),
        };
        link.spawn("to middleware", move || drop(orders.write_to(input)))?;
        let is_silent = Arc::clone(&link.is_silent);
        link.spawn("from middleware", move || {
            let mut output = BufReader::new(output);
            while let Ok(Some((event, payload))) = wire::read(&mut output) {
                take(event, payload);
            }
            is_silent.store(true, Ordering::Release);
        })?;
        let last_line = Arc::clone(&link.last_line);
        link.spawn("middleware errors", move || log_lines(errors, &last_line))?;
        Ok(link)
    }

    fn spawn(&mut self, name: &str, run: impl FnOnce() + Send + 'static) -> io::Result<()> {
        self.threads.push(thread::Builder::new().name(name.to_owned()).spawn(run)?);
        Ok(())
    }

    /// Returns how the process ended, if it did.
    pub(super) fn ended(&mut self) -> Option<String> {
        let status = self.child.try_wait().ok()??;
        let line = lock(&self.last_line).clone();
        Some(if line.is_empty() { status.to_string() } else { format!("{status}: {line}") })
    }

    /// True once no further event comes.
    pub(super) fn is_silent(&self) -> bool {
        self.is_silent.load(Ordering::Acquire)
    }

    /// Resident memory of the process, bytes; `None` if it has ended or the system does not say.
    pub(super) fn resident_bytes(&self) -> Option<u64> {
        let mut statm = [0; MAX_STATM_BYTES];
        let num_bytes = self.statm.as_ref()?.read_at(&mut statm, 0).ok()?;
        let statm = str::from_utf8(&statm[..num_bytes]).ok()?;
        let num_pages: u64 = statm.split_whitespace().nth(1)?.parse().ok()?;
        Some(num_pages * rustix::param::page_size() as u64)
    }

    /// Ends the process at once.
    pub(super) fn kill(&mut self) {
        // Fails if it has ended.
        _ = self.child.kill();
        _ = self.child.wait();
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        // Closes standard input after the last order: the process leaves the network.
        self.orders.close();
        let deadline = Instant::now() + FAREWELL;
        while self.ended().is_none() && Instant::now() < deadline {
            thread::sleep(EXIT_CHECK);
        }
        self.kill();
        for thread in self.threads.drain(..) {
            if thread.thread().id() != thread::current().id() {
                // A thread that panicked has reported it.
                drop(thread.join());
            }
        }
    }
}

/// Logs what the process writes on standard error: panics, and messages of libraries that do not use the log.
fn log_lines(errors: impl Read, last_line: &Mutex<String>) {
    let mut errors = BufReader::new(errors);
    let mut line = Vec::new();
    while let Ok(1..) = errors.by_ref().take(MAX_LINE_BYTES).read_until(b'\n', &mut line) {
        let text = String::from_utf8_lossy(&line).trim_end().to_owned();
        if !text.is_empty() {
            log::log(Level::Error, log::MIDDLEWARE, &text);
            // The standard library's advice behind a panic is no reason.
            if !text.starts_with("note: ") {
                *lock(last_line) = text;
            }
        }
        line.clear();
    }
}
