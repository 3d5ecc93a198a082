//! Feeds mutated bytes to the reader of sensor files of the vendors, which must answer or refuse and never panic.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sightline_fuzz::readers::sensor_file(sightline_fuzz::folder(), bytes);
});
