#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sightline_fuzz::readers::carla_ply(sightline_fuzz::folder(), bytes);
});
