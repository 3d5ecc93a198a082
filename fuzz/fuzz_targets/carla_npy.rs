//! Feeds mutated bytes to the reader of CARLA's arrays of records, which must answer or refuse and never panic.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sightline_fuzz::readers::carla_npy(sightline_fuzz::folder(), bytes);
});
