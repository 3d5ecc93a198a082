//! Tests of the near field.
