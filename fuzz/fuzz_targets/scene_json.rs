//! Feeds mutated bytes to the reader of scene files, which must answer or refuse and never panic.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sightline_fuzz::readers::scene_json(sightline_fuzz::folder(), bytes);
});
