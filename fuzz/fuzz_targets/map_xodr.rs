//! Feeds mutated bytes to the reader of OpenDRIVE maps, which must answer or refuse and never panic.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sightline_fuzz::readers::map_xodr(sightline_fuzz::folder(), bytes);
});
