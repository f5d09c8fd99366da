//! Recordings in a separate process that is killed or whose disk is full.
//!
//! The process is this test binary, which runs one of its tests with a directory in its environment.

use std::{
    env, fs,
    io::{self, BufRead, BufReader, Write},
    path::PathBuf,
    process::{Child, Command, Stdio},
    thread,
};

use super::*;

const CHILD: &str = "LASER_PROFILER_TEST_RECORDS_INTO";

/// Directory to record into; `None` in the parent process.
fn child_directory() -> Option<PathBuf> {
    env::var_os(CHILD).map(PathBuf::from)
}

/// Runs the test of that name in a child process, after a shell command.
fn start_child(test: &str, directory: &Path, limits: &str) -> Child {
    let mut command = Command::new("bash");
    command.arg("-c").arg(format!("{limits}; exec \"$0\" \"$@\"")).arg(env::current_exe().unwrap());
    let name = format!("node::live_recording::tests::process::{test}");
    command.args(["--exact", &name, "--nocapture", "--test-threads", "1"]);
    command.env(CHILD, directory).stdout(Stdio::piped()).spawn().unwrap()
}

/// Prints to standard output directly, because the test harness may capture the print macros.
fn print(text: &str) {
    let mut stdout = io::stdout().lock();
    stdout.write_all(text.as_bytes()).unwrap();
    stdout.flush().unwrap();
}

fn only_bag(directory: &Path) -> PathBuf {
    let mut entries = fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path());
    let bag = entries.next().unwrap();
    assert_eq!(entries.next(), None);
    bag
}

#[test]
fn after_kill_9_everything_older_than_a_second_is_there() {
    if let Some(directory) = child_directory() {
        let (mut recorder, control) = recorder(params(&directory));
        control.start().unwrap();
        for sequence in 1.. {
            send(&mut recorder, CENTERLINE, [sequence]);
            print(&format!("\nsent {sequence}\n"));
            thread::sleep(Duration::from_millis(5));
        }
    }
    let place = tempfile::tempdir().unwrap();
    let mut child =
        start_child("after_kill_9_everything_older_than_a_second_is_there", place.path(), "true");
    let mut sent = Vec::new();
    let lines = BufReader::new(child.stdout.take().unwrap()).lines();
    for line in lines.map(Result::unwrap) {
        let Some(sequence) = line.strip_prefix("sent ") else { continue };
        let now = Instant::now();
        sent.push((now, sequence.parse::<u32>().unwrap()));
        if now.duration_since(sent[0].0) > Duration::from_millis(2300) {
            break;
        }
    }
    child.kill().unwrap();
    let killed = Instant::now();
    child.wait().unwrap();
    let is_old = |at: &Instant| killed.duration_since(*at) >= Duration::from_secs(1);
    let num_old = sent.iter().filter(|(at, _)| is_old(at)).count();
    let bag = only_bag(place.path());
    assert!(!bag.join("metadata.yaml").exists(), "the bag was not closed");
    let found = readable(&bag);
    assert!(num_old > 50, "{num_old} messages are too few for this test");
    assert!(found.len() >= num_old, "{} of {num_old} found", found.len());
    assert_eq!(found, (1..=found.len() as u32).collect::<Vec<_>>());
    assert_eq!(records(&bag, "laser_profiler").len(), 1, "the description is there");
}

/// A file size limit makes a write fail in the middle, as a full disk does, and needs no root.
#[test]
fn a_full_disk_ends_the_recording_with_one_message_and_nothing_else() {
    const TEST: &str = "a_full_disk_ends_the_recording_with_one_message_and_nothing_else";
    if let Some(directory) = child_directory() {
        return record_until_full(&directory);
    }
    let place = tempfile::tempdir().unwrap();
    let child = start_child(TEST, place.path(), "trap '' XFSZ; ulimit -f 400"); // [KiB]
    let ended = child.wait_with_output().unwrap();
    let text = String::from_utf8_lossy(&ended.stdout);
    assert!(ended.status.success(), "{text}");
    let bag = only_bag(place.path());
    let found = readable(&bag);
    assert!(found.len() > 10, "{found:?}");
    let recorded = text.lines().find_map(|line| line.strip_prefix("recorded ")).unwrap();
    let recorded: usize = recorded.parse().unwrap();
    // Half a second of messages counts as missing, although some are there.
    assert!((1..=found.len()).contains(&recorded), "{recorded} of {}", found.len());
    assert_eq!(found, (1..=found.len() as u32).collect::<Vec<_>>(), "flushed messages are there");
}

fn record_until_full(directory: &Path) {
    let uncompressed = RecordingParams { compression: Compression::None, ..params(directory) };
    let (mut recorder, control) = recorder(uncompressed);
    control.start().unwrap();
    let mut sequence = 0;
    wait_until("the disk is full", || {
        sequence += 1;
        recorder.write(&message(CENTERLINE, sequence, 1000)).unwrap();
        !control.status().results.is_recording
    });
    let error = control.status().results.last_error;
    wait_until("the bag is closed", || !control.status().results.is_ending);
    let status = control.status().results;
    let text = status.last_error.unwrap_or_default();
    for part in ["_0.mcap", "File too large", "free the disk"] {
        assert!(text.contains(part), "{text}");
    }
    assert!(error.is_none_or(|first| first == text), "one message: {text}");
    // The last one may still be on its way.
    assert_eq!(status.messages + status.dropped, u64::from(sequence));
    // The node continues, and what is missing is counted.
    send(&mut recorder, CENTERLINE, sequence..sequence + 100);
    assert_eq!(control.status().results.dropped, status.dropped + 100);
    recorder.finish().unwrap();
    print(&format!("\nrecorded {}\n", status.messages));
}

/// On a small, nearly full file system, the minimum free space keeps the bag complete.
#[test]
fn on_a_small_disk_the_bag_is_whole() {
    const TEST: &str = "on_a_small_disk_the_bag_is_whole";
    if let Some(directory) = child_directory() {
        let mounted = Command::new("mount")
            .args(["-t", "tmpfs", "-o", "size=4m", "tmpfs"])
            .arg(&directory)
            .status();
        assert!(mounted.is_ok_and(|status| status.success()));
        return fill_small_disk(&directory);
    }
    let can_mount = Command::new("unshare").args(["--mount", "--map-root-user", "true"]).output();
    if !can_mount.as_ref().is_ok_and(|output| output.status.success()) {
        let text = format!("SKIPPED {TEST}: no namespace for a small disk: {can_mount:?}\n");
        io::stderr().write_all(text.as_bytes()).unwrap();
        assert!(env::var_os("CI").is_none(), "CI skips nothing: {text}");
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let limits = "exec unshare --mount --map-root-user \"$0\" \"$@\"";
    let ended = start_child(TEST, place.path(), limits).wait_with_output().unwrap();
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stdout));
}

fn fill_small_disk(directory: &Path) {
    let (mut recorder, control) = recorder(RecordingParams {
        compression: Compression::None,
        min_free_bytes: 1 << 20,
        ..params(directory)
    });
    let bag = control.start().unwrap().remove(0);
    let mut sequence = 0;
    wait_until("the disk is nearly full", || {
        for _ in 0..20 {
            sequence += 1;
            recorder.write(&message(CENTERLINE, sequence, 1000)).unwrap();
        }
        !control.status().results.is_recording
    });
    wait_until("the bag is closed", || !control.status().results.is_ending);
    let status = control.status().results;
    assert!(status.last_error.unwrap().contains("recording.min_free_bytes 1048576"));
    assert!(open(&bag).is_indexed() && bag.join("metadata.yaml").exists());
    let free_bytes = free_bytes(directory).unwrap();
    assert!((1 << 20..2 << 20).contains(&free_bytes), "{free_bytes} bytes are left of 4 MiB");
    let found = sequences(&bag, "/centerline");
    assert_eq!(found.len() as u64, status.messages);
    assert!(found.len() > 1000 && found.windows(2).all(|pair| pair[1] == pair[0] + 1));
    recorder.finish().unwrap();
}
