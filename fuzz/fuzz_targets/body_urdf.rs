//! Feeds mutated bytes to the reader of robots in URDF as bodies, which must answer or refuse and never panic.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sightline_fuzz::readers::body_urdf(sightline_fuzz::folder(), bytes);
});
