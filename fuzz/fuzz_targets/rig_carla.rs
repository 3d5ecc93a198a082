//! Feeds mutated bytes to the reader of rigs as CARLA's transforms, which must answer or refuse and never panic.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sightline_fuzz::readers::rig_carla(sightline_fuzz::folder(), bytes);
});
