//! Feeds mutated bytes to the reader of target files, which must answer or refuse and never panic.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sightline_fuzz::readers::target_json(sightline_fuzz::folder(), bytes);
});
