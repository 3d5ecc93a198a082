//! Feeds mutated bytes to the reader of CARLA's tables of transforms, which must answer or refuse and never panic.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sightline_fuzz::readers::carla_poses(sightline_fuzz::folder(), bytes);
});
