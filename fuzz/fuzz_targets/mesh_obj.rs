//! Feeds mutated bytes to the reader of OBJ meshes, which must answer or refuse and never panic.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sightline_fuzz::readers::mesh_obj(sightline_fuzz::folder(), bytes);
});
