//! Tests of `page`.

use super::*;
use crate::report::view::tests::yard;

#[test]
fn losses_are_left_out_where_a_run_is_to_end() {
    let (scene, _, [two, _]) = yard();
    let job = Job::new(scene);
    let suite = job.suite().unwrap();
    let looks = |goes_on: bool| Looks::new(&job, &suite, &two, &[], &mut || goes_on).unwrap();
    assert!(looks(true).several.losses.is_some());
    let late = looks(false);
    assert!(late.several.losses.is_none() && late.several.redundancy.is_some());
}
