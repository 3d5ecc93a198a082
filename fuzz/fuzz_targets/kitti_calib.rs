#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sightline_fuzz::readers::kitti_calib(sightline_fuzz::folder(), bytes);
});
