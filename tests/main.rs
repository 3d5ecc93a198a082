//! One test binary: a file for each kind of test.
#![allow(clippy::disallowed_methods)]
#![allow(clippy::unwrap_used)]

#[cfg(feature = "gpu")]
mod atlas;
#[cfg(feature = "cli")]
mod cli;
#[cfg(feature = "cli")]
mod cli_bodies;
#[cfg(feature = "cli")]
mod cli_chart;
#[cfg(feature = "cli")]
mod cli_cones;
#[cfg(feature = "cli")]
mod cli_cones_slabs;
#[cfg(feature = "cli")]
mod cli_counting;
#[cfg(feature = "cli")]
mod cli_counts;
#[cfg(all(unix, feature = "cli"))]
mod cli_csv;
#[cfg(all(unix, feature = "cli"))]
mod cli_drawing;
#[cfg(all(unix, feature = "cli"))]
mod cli_edges;
#[cfg(feature = "cli")]
mod cli_errors;
#[cfg(all(unix, feature = "cli"))]
mod cli_figures;
#[cfg(all(unix, feature = "cli"))]
mod cli_files;
#[cfg(feature = "cli")]
mod cli_gltf;
#[cfg(feature = "cli")]
mod cli_ground;
#[cfg(all(unix, feature = "cli"))]
mod cli_handover;
#[cfg(all(unix, feature = "cli"))]
mod cli_handover_runs;
#[cfg(feature = "cli")]
mod cli_help;
#[cfg(feature = "cli")]
mod cli_inputs;
#[cfg(all(unix, feature = "cli"))]
mod cli_interrupted;
#[cfg(feature = "cli")]
mod cli_limits;
#[cfg(feature = "cli")]
mod cli_messages;
#[cfg(feature = "cli")]
mod cli_mistakes;
#[cfg(feature = "cli")]
mod cli_mixed_rigs;
#[cfg(feature = "cli")]
mod cli_near_field;
#[cfg(feature = "cli")]
mod cli_numbers;
#[cfg(feature = "cli")]
mod cli_optimize;
#[cfg(all(unix, feature = "cli"))]
mod cli_output;
#[cfg(feature = "cli")]
mod cli_overlap;
#[cfg(feature = "cli")]
mod cli_requirements;
#[cfg(feature = "cli")]
mod cli_rig;
#[cfg(feature = "cli")]
mod cli_rules;
#[cfg(feature = "cli")]
mod cli_scan;
#[cfg(feature = "cli")]
mod cli_scan_clouds;
#[cfg(feature = "cli")]
mod cli_scene;
#[cfg(all(unix, feature = "cli"))]
mod cli_scenes;
#[cfg(all(unix, feature = "cli"))]
mod cli_schema;
#[cfg(feature = "cli")]
mod cli_shared;
#[cfg(all(unix, feature = "cli"))]
mod cli_shell;
#[cfg(all(unix, feature = "cli"))]
mod cli_stops;
#[cfg(feature = "cli")]
mod cli_study;
#[cfg(feature = "cli")]
mod cli_study_notes;
#[cfg(feature = "cli")]
mod cli_study_rigs;
#[cfg(feature = "cli")]
mod cli_sweep;
#[cfg(feature = "cli")]
mod cli_tables;
#[cfg(feature = "cli")]
mod cli_targets;
#[cfg(feature = "cli")]
mod cli_vehicle;
#[cfg(all(unix, feature = "cli"))]
mod cli_view;
#[cfg_attr(not(feature = "gpu"), allow(dead_code))]
mod common;
mod conditions;
mod cover;
mod deadlines;
mod docs;
#[cfg(feature = "gpu")]
mod equal_frames;
mod equip;
mod far;
mod fast_stages;
#[cfg(feature = "cli")]
mod front;
#[cfg(feature = "cli")]
mod front_baselines;
#[cfg(feature = "cli")]
mod front_whole;
#[cfg(feature = "gpu")]
mod gpu_cast_closest;
#[cfg(feature = "gpu")]
mod gpu_cover_voxels;
#[cfg(feature = "gpu")]
mod gpu_cpu;
#[cfg(feature = "gpu")]
mod gpu_pipeline;
#[cfg(feature = "gpu")]
mod gpu_scan;
mod grid_search;
mod hits;
#[cfg(feature = "gpu")]
mod hostile;
#[cfg(feature = "gpu")]
mod hostile_driver;
#[cfg(feature = "gpu")]
mod hostile_large;
#[cfg(feature = "gpu")]
mod hostile_shifted;
mod invariants;
#[cfg(feature = "gpu")]
mod lost_device;
#[cfg(feature = "cli")]
mod main_job;
mod mixed;
#[cfg(feature = "cli")]
mod one_job;
mod optimize;
#[cfg(feature = "mesh")]
mod own_mesh;
#[cfg_attr(not(feature = "cli"), allow(dead_code))]
mod own_scenes;
#[cfg(feature = "cli")]
mod program;
mod reference;
mod repeated;
mod round_trip;
#[cfg(feature = "cli")]
mod runs;
mod scenes;
mod walk;
mod ways;
mod world;
