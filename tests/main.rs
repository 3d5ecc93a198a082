//! One test binary: a file for each kind of test.

mod common;
mod cover;
mod gpu_cpu;
mod hits;
