//! Feeds mutated bytes to the reader of the arguments of the program, which must answer or refuse and never panic.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sightline_fuzz::readers::options(sightline_fuzz::folder(), bytes);
});
