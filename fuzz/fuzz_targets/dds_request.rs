#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| laser_profiler::fuzzing::dds_request(data));
