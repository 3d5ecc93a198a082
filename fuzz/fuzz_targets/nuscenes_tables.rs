//! Feeds mutated bytes to the reader of tables of nuScenes, which must answer or refuse and never panic.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sightline_fuzz::readers::nuscenes_tables(sightline_fuzz::folder(), bytes);
});
