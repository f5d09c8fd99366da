#![no_main]

use std::{path::PathBuf, sync::LazyLock};

/// A directory of this process in memory.
static SCRATCH: LazyLock<PathBuf> = LazyLock::new(|| {
    let scratch = PathBuf::from(format!("/dev/shm/fuzzed-{}", std::process::id()));
    std::fs::create_dir_all(&scratch).expect("/dev/shm is writable");
    scratch
});

libfuzzer_sys::fuzz_target!(|data: &[u8]| laser_profiler::fuzzing::bag(data, &SCRATCH));
