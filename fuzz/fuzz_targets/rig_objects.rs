#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sightline_fuzz::readers::rig_objects(sightline_fuzz::folder(), bytes);
});
