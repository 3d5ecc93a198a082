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

#[test]
fn the_head_has_one_sentence_large_and_blind_places_as_a_list() {
    let verdict = "BLIND: 2 sectors, listed below. No warning.\nBLIND: ahead.\nBLIND: left.";
    let head = heading("street", &[], verdict).into_string();
    let want = "<h1>BLIND: 2 sectors, listed below.</h1><p>No warning.</p>\
                <ul><li>BLIND: ahead.</li><li>BLIND: left.</li></ul>";
    assert!(head.contains(want), "{head}");
    assert!(
        !heading("street", &[], "The placement found. No warning.").into_string().contains("<ul>")
    );
}
