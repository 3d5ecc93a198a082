//! Runs over many frames whose time is over, or whose observer says stop: few frames more are scored, and a resumed run
//! gives the bits of one that never stopped.

use std::time::Duration;

use sightline::internals::Spacing;
use sightline::search::{
    Event, FrameChoice, Method, Outcome, Phase, Run, Settings, State, Stopped, TimeLimit, Work,
};

use crate::common::*;
use crate::optimize::{bits, finish, loaded, settings};

/// More than a run scores whatever the time.
const FRAMES: usize = 40;
/// Most that a run is confirmed over where the time is over, by the same measure.
const FEW: usize = 32;

fn problem() -> Arc<Problem> {
    problem_over(FRAMES, 60)
}

/// Frames that differ, of so many triangles, and a mount of two LiDARs.
fn problem_over(frames: usize, triangles: usize) -> Arc<Problem> {
    let roi = Roi::new([-6.0, -5.0, -3.25], [1.0; 3], [12, 10, 7]).unwrap();
    let channels: Vec<(f64, f64)> = (0..4).map(|k| (-30.0 + 15.0 * f64::from(k), 0.3)).collect();
    let table = BeamTable::spinning(&channels, 24, 12.0).unwrap();
    let tree = |frame| Arc::new(Bvh::build(&random_soup(40 + frame as u64, triangles, 6.0), 12.0));
    let frames: Vec<Arc<Bvh>> = (0..frames).map(tree).collect();
    let rules =
        Constraints::in_box([-2.0, -2.0, -1.0, -0.3, 0.0, 0.0], [2.0, 2.0, 1.0, 0.3, 0.0, 0.0], 2);
    let problem = Problem::from(Task::new(roi, random_content(9, &roi), table, frames, true));
    Arc::new(problem.with_constraints(rules))
}

/// Ways to search, over few frames and over all.
fn ways() -> [Settings; 4] {
    let way = |method, frames, evaluations| {
        let delta = (method == Method::Swaps).then_some(Spacing { metres: 2.0, radians: 0.3 });
        Settings { method, frames, evaluations, delta, ..settings() }
    };
    [
        way(Method::Both, FrameChoice::OnDemand, 24),
        way(Method::Swaps, FrameChoice::OnDemand, 10),
        way(Method::Cma, FrameChoice::All, 12),
        way(Method::Both, FrameChoice::Count(36), 12),
    ]
}

fn whole(problem: &Arc<Problem>, settings: &Settings) -> (Vec<String>, Outcome) {
    let (states, outcome) = finish(Run::new(problem.clone(), settings).unwrap(), &mut |_| true);
    assert!(!outcome.stopped.is_unfinished());
    assert_eq!(outcome.confirmed_frames, FRAMES);
    (states, outcome)
}

#[test]
fn a_run_out_of_time_scores_few_frames_and_goes_on() {
    let problem = problem();
    for settings in ways() {
        let way = format!("{:?} over {:?}", settings.method, settings.frames);
        let (_, whole) = whole(&problem, &settings);
        let time = Some(TimeLimit::from_now(Duration::ZERO));
        let late = Settings { time, ..settings };
        let (states, outcome) = finish(Run::new(problem.clone(), &late).unwrap(), &mut |_| true);
        assert_eq!(outcome.stopped, Stopped::Time, "{way}");
        assert!(outcome.best.is_some(), "{way}: something to go on with");
        assert!(outcome.confirmed_frames <= FEW, "{way}: {}", outcome.confirmed_frames);
        assert!(outcome.search_frames <= FEW, "{way}: {}", outcome.search_frames);
        assert!(outcome.history.len() <= 1, "{way}");
        let (_, resumed) = finish(loaded(&problem, states.last().unwrap()), &mut |_| true);
        assert_eq!(bits(&resumed), bits(&whole), "{way}");
    }
}

#[test]
fn a_run_that_is_told_to_stop_begins_little_more() {
    let problem = problem();
    for settings in ways() {
        let way = format!("{:?} over {:?}", settings.method, settings.frames);
        let (states, whole) = whole(&problem, &settings);
        let mut events = 0;
        finish(Run::new(problem.clone(), &settings).unwrap(), &mut |_| {
            events += 1;
            true
        });
        let (mut cut, mut phases) = (0, Vec::new());
        for stop_at in (0..events).step_by((events / 5).max(1)) {
            let (mut seen, mut after) = (0, Vec::new());
            let run = Run::new(problem.clone(), &settings).unwrap();
            let (broken, outcome) = finish(run, &mut |event: &Event| {
                seen += 1;
                if seen > stop_at {
                    after.push(format!("{event:?}"));
                }
                seen <= stop_at
            });
            let last = broken.last().unwrap();
            assert_eq!(outcome.stopped, Stopped::Interrupted, "{way}, event {stop_at}");
            // Each part begun is an event: the few frames at the end, and what tells of the rest.
            assert!(after.len() < 60, "{way}, event {stop_at} of {events}: {after:#?}");
            let is_few = outcome.confirmed_frames <= FEW;
            assert!(is_few || outcome.confirmed_frames == FRAMES, "{way}, event {stop_at}");
            assert!(states.contains(last), "{way}, event {stop_at}: a state of no whole run");
            let state: State = serde_json::from_str(last).unwrap();
            phases.push(state.phase());
            cut += usize::from(is_few);
            let (_, resumed) = finish(loaded(&problem, last), &mut |_| true);
            assert_eq!(bits(&resumed), bits(&whole), "{way}, event {stop_at}");
        }
        assert!(cut > 2, "{way}: {cut} runs were too short for all frames");
        assert!(phases.iter().any(|phase| *phase != Phase::Frames), "{way}: {phases:?}");
    }
}

#[test]
fn swaps_alone_that_are_cut_at_their_first_pose_go_on_over_few_frames() {
    let problem = problem_over(1100, 4);
    let spacing = Some(Spacing { metres: 2.0, radians: 0.3 });
    let at = |x: f64| SensorPose::at(x, 0.0, 0.0);
    let baselines = vec![Placement { name: "given".into(), lidars: vec![at(-2.0), at(2.0)] }];
    let (method, frames) = (Method::Swaps, FrameChoice::All);
    let settings = Settings { method, frames, delta: spacing, baselines, ..settings() };
    let (mut swaps, mut notes) = (0, Vec::new());
    let (_, outcome) = finish(Run::new(problem, &settings).unwrap(), &mut |event| {
        match event {
            Event::Progress { work: Work::Swaps, .. } => swaps += 1,
            Event::Note(note) => notes.push((*note).to_owned()),
            _ => {}
        }
        swaps == 0
    });
    assert_eq!(outcome.stopped, Stopped::Interrupted);
    assert!(outcome.best.is_some(), "{notes:?}");
    assert!(notes.iter().any(|note| note.contains("of 1100 frames, spread evenly")), "{notes:?}");
    assert!(swaps < 60, "{swaps} questions after the first");
}
