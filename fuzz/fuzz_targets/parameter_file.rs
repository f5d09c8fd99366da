#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| laser_profiler::fuzzing::parameter_file(data));
