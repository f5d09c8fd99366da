//! Everything that is tested through the public interface, in one binary: it links once.
#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "tests fail by panicking and say on stderr what they skip"
)]

mod accuracy;
mod allocation;
mod launch_configs;
