//! Feeds mutated bytes to the reader of SemanticKITTI's labels, which must answer or refuse and never panic.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sightline_fuzz::readers::kitti_label(sightline_fuzz::folder(), bytes);
});
