//! Feeds mutated bytes to the reader of STL meshes, which must answer or refuse and never panic.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sightline_fuzz::readers::mesh_stl(sightline_fuzz::folder(), bytes);
});
