//! One test binary: a file for each kind of test.

#![allow(clippy::unwrap_used)]

mod atlas;
mod cli;
mod cli_chart;
#[cfg(unix)]
mod cli_edges;
mod cli_errors;
mod cli_inputs;
mod cli_optimize;
#[cfg(unix)]
mod cli_output;
mod cli_rules;
mod cli_scene;
mod cli_study;
mod common;
mod cover;
mod equal_frames;
mod fast_stages;
mod gpu_cover;
mod gpu_cpu;
mod gpu_flow;
mod gpu_packets;
mod grid_search;
mod hits;
mod hostile;
mod hostile_large;
mod hostile_shifted;
mod invariants;
mod invariants_own;
mod layers;
mod lost_device;
mod main_job;
mod own_scenes;
mod packets;
mod reference;
