//! Scans of CARLA.
