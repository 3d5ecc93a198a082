//! One test binary: a file for each kind of test.

#![allow(clippy::unwrap_used)]

mod cli;
mod cli_errors;
mod cli_optimize;
mod common;
mod cover;
mod gpu_cpu;
mod hits;
mod hostile;
mod invariants;
mod layers;
mod main_job;
mod packets;
mod reference;
