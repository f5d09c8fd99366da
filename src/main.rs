//! The `laser_profiler` executable: see `laser_profiler --help`.
fn main() {}
