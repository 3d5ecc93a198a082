//! Samples of each format, written by hand, and the tables of real sensors.

mod real;
mod samples;
