//! Feeds mutated bytes to the reader of SemanticKITTI's scans, which must answer or refuse and never panic.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sightline_fuzz::readers::kitti_bin(sightline_fuzz::folder(), bytes);
});
