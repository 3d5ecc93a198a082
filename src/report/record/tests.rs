//! Tests of `record`.

use super::*;

#[test]
fn a_line_stands_where_the_frames_change_and_a_curve_goes_on() {
    let record = |generation: u64| GenerationRecord {
        generation,
        evaluations: 10 * generation,
        best: Some(1.0),
        median: Some(0.5),
        best_so_far: Some(1.0 + generation as f64),
        missing: None,
        infeasible: 0,
        guarded: 0,
        step_size: 0.3,
    };
    let history: Vec<GenerationRecord> = (1..=4).map(record).collect();
    let svg = convergence_svg(&history, "near_gain", &[], None, &[(0, 1), (2, 6), (4, 24)]);
    assert!(svg.contains(">6 frames<") && !svg.contains(">24 frames<"), "{svg}");
    // Two curves of two parts each: values over other frames are not joined.
    let parts = |svg: &str| svg.matches("<polyline").count();
    assert_eq!(parts(&svg), 4, "{svg}");
    // 20 evaluations of 10 to 40, with 6 % of margin: a third of the way.
    let x = 90.0 + 560.0 * (0.06 + 1.0 / 3.0) / 1.12;
    assert!(svg.contains(&format!("d=\"M{x:.1} 50V350\"")), "{x} {svg}");
    let of = |history: &[GenerationRecord]| convergence_svg(history, "near_gain", &[], None, &[]);
    assert!(!of(&history).contains(" frames<") && parts(&of(&history)) == 2);
    // Rigs that miss requirements are a curve of their own.
    assert!(!of(&history).contains("misses requirements"));
    let mut missing = history;
    missing[..2].iter_mut().for_each(|record| record.missing = Some(0.1));
    assert!(of(&missing).contains("best that misses requirements"));
    assert!(of(&missing).contains(">best so far<"));
}
