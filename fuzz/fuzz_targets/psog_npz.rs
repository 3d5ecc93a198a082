//! Feeds mutated bytes to the reader of P-SOG files, which must answer or refuse and never panic.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sightline_fuzz::readers::psog_npz(sightline_fuzz::folder(), bytes);
});
