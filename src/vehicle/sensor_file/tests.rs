//! Samples of each format.
