//! Feeds mutated bytes to the reader of rigs as URDF, which must answer or refuse and never panic.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sightline_fuzz::readers::rig_urdf(sightline_fuzz::folder(), bytes);
});
