//! Tests of data sets.

mod carla;
mod faults;
mod kitti;
mod kitti_real;
mod nuscenes;
mod nuscenes_fields;
mod nuscenes_set;
