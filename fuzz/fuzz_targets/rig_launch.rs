//! Feeds mutated bytes to the reader of rigs as ROS 2 launch files, which must answer or refuse and never panic.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sightline_fuzz::readers::rig_launch(sightline_fuzz::folder(), bytes);
});
