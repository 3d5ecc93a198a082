#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sightline_fuzz::readers::sensor_file(sightline_fuzz::folder(), bytes);
});
