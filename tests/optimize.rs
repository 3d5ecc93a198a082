//! The main job as a library function: observed, interrupted, out of time, resumed by value.

use std::time::Duration;

use sightline::internals::{Spacing, Standing};
use sightline::search::{
    Event, FrameChoice, GenerationsStop, Method, Outcome, Phase, Run, Settings, State, Stopped,
    TimeLimit, Work, optimize,
};
use sightline::{EngineChoice, SensorPose};

use crate::common::*;

/// Six frames that differ, and a mount of two LiDARs.
fn problem() -> Arc<Problem> {
    let roi = Roi::new([-6.0, -5.0, -3.25], [0.5, 0.5, 0.5], [24, 20, 13]).unwrap();
    let channels: Vec<(f64, f64)> = (0..7).map(|k| (-30.0 + 10.0 * f64::from(k), 0.3)).collect();
    let table = BeamTable::spinning(&channels, 45, 12.0).unwrap();
    let frames = (0..6).map(|t| Arc::new(Bvh::build(&random_soup(40 + t, 200, 6.0), 12.0)));
    let constraints = Constraints {
        min_distance: 0.5,
        ..Constraints::in_box([-2.0, -2.0, -1.0, -0.3, 0.0, 0.0], [2.0, 2.0, 1.0, 0.3, 0.0, 0.0], 2)
    };
    let content = random_content(9, &roi);
    let problem = Problem::from(Task::new(roi, content, table, frames.collect::<Vec<_>>(), true));
    Arc::new(problem.with_constraints(constraints))
}

fn baseline(name: &str, x: f64) -> Placement {
    let pose = |x| SensorPose { x, y: 0.0, z: 0.5, ..SensorPose::default() };
    Placement { name: name.into(), lidars: vec![pose(x), pose(-x)] }
}

pub(crate) fn settings() -> Settings {
    Settings {
        evaluations: 48,
        baselines: vec![baseline("near", 0.5), baseline("far", 1.5)],
        engine: EngineChoice { memory: Some(1 << 28), ..EngineChoice::cpu() },
        ..Settings::default()
    }
}

/// All of an outcome but engine and times.
pub(crate) fn bits(outcome: &Outcome) -> String {
    let Outcome { best, baselines, methods, certificate, findings, frames_used, .. } = outcome;
    let parts = (best, baselines, methods, certificate, findings, frames_used);
    let rest = (outcome.search_frames, &outcome.history, outcome.evaluations, &outcome.ended);
    serde_json::to_string(&(parts, rest, &outcome.active_bounds)).unwrap()
}

fn saved(run: &Run) -> String {
    serde_json::to_string(run.state()).unwrap()
}

/// Runs to the end; the state after each step, and the outcome.
pub(crate) fn finish(mut run: Run, on: &mut dyn FnMut(&Event) -> bool) -> (Vec<String>, Outcome) {
    let mut states = vec![saved(&run)];
    loop {
        let outcome = run.step(&mut |event: &Event| on(event)).unwrap();
        states.push(saved(&run));
        if let Some(outcome) = outcome {
            return (states, outcome);
        }
    }
}

/// A saved state, to go on with on the engine of the tests.
pub(crate) fn loaded(problem: &Arc<Problem>, text: &str) -> Run {
    let state: State = serde_json::from_str(text).unwrap();
    let mut run = Run::resume(problem.clone(), state);
    run.open_with(settings().engine, None, None);
    run
}

#[test]
fn a_run_resumed_after_any_step_gives_the_same_bits() {
    let problem = problem();
    for (objective, method) in [
        ("information_gain", Method::Both),
        ("m_sog_scaled", Method::Both),
        ("information_gain", Method::Swaps),
    ] {
        let delta = (method == Method::Swaps).then_some(Spacing { metres: 1.0, radians: 0.3 });
        let settings =
            Settings { objective: objective.parse().unwrap(), method, delta, ..settings() };
        let run = Run::new(problem.clone(), &settings).unwrap();
        let (states, whole) = finish(run, &mut |_| true);
        assert!(!whole.stopped.is_unfinished() && whole.best.is_some());
        let mut phases = Vec::new();
        for (step, state) in states.iter().enumerate() {
            let run = loaded(&problem, state);
            let phase = run.state().phase();
            // Some of many generations will do.
            if phases.contains(&phase) && step % 6 > 0 {
                continue;
            }
            phases.push(phase);
            let (after, resumed) = finish(run, &mut |_| true);
            assert_eq!(bits(&resumed), bits(&whole), "{objective}, resumed in {phase:?}");
            assert_eq!(after.last(), states.last(), "{objective}, resumed in {phase:?}");
            assert_eq!(resumed.stopped, whole.stopped);
        }
        let all = [
            Phase::Frames,
            Phase::Finalists,
            Phase::Swaps,
            Phase::Refine,
            Phase::Bounds,
            Phase::Confirm,
        ];
        assert!(all.iter().all(|phase| phases.contains(phase)), "{phases:?}");
        assert_eq!(phases.contains(&Phase::Generations), method == Method::Both);
    }
}

#[test]
fn an_interrupted_run_has_an_outcome_and_goes_on_from_before_the_cut() {
    let problem = problem();
    let (states, whole) = finish(Run::new(problem.clone(), &settings()).unwrap(), &mut |_| true);
    let mut events = 0;
    optimize(&problem, &settings(), &mut |_: &Event| {
        events += 1;
        true
    })
    .unwrap();
    let mut unfinished = 0;
    for stop_at in (0..events).step_by(events / 9) {
        let mut seen = 0;
        let run = Run::new(problem.clone(), &settings()).unwrap();
        let (broken, outcome) = finish(run, &mut |_| {
            seen += 1;
            seen <= stop_at
        });
        assert_eq!(outcome.stopped, Stopped::Interrupted, "at event {stop_at}");
        let last = broken.last().unwrap();
        assert!(states.contains(last), "event {stop_at}: a state that a whole run never is in");
        unfinished += usize::from(states.last() != Some(last));
        let (_, resumed) = finish(loaded(&problem, last), &mut |_| true);
        assert_eq!(bits(&resumed), bits(&whole), "at event {stop_at}");
    }
    assert!(unfinished > 6, "{unfinished} of the interruptions cut something short");
}

#[test]
fn a_run_out_of_time_does_one_generation_and_goes_on() {
    let problem = problem();
    let (_, whole) = finish(Run::new(problem.clone(), &settings()).unwrap(), &mut |_| true);
    let time = Some(TimeLimit::from_now(Duration::ZERO));
    let late = Settings { time, ..settings() };
    let (states, outcome) = finish(Run::new(problem.clone(), &late).unwrap(), &mut |_| true);
    assert_eq!((outcome.stopped, outcome.history.len()), (Stopped::Time, 1));
    assert!(outcome.best.is_some() && outcome.evaluations < settings().evaluations);
    let (_, resumed) = finish(loaded(&problem, states.last().unwrap()), &mut |_| true);
    assert_eq!(bits(&resumed), bits(&whole));
}

#[test]
fn a_run_that_goes_on_with_less_time_ends_with_nothing_worse() {
    let problem = problem();
    let (states, whole) = finish(Run::new(problem.clone(), &settings()).unwrap(), &mut |_| true);
    let earlier = whole.best.clone().unwrap().placement;
    let late = |state: &str, kept: Option<&Placement>| {
        let mut run = loaded(&problem, state);
        run.open_with(settings().engine, Some(TimeLimit::from_now(Duration::ZERO)), None);
        kept.into_iter().for_each(|kept| run.keep(kept.clone()));
        finish(run, &mut |_| true).1
    };
    let objective = settings().objective;
    let standing = |outcome: &Outcome| {
        outcome.best.as_ref().map(|best| Standing::of(&best.scores, &objective)).unwrap()
    };
    let (mut worse, best) = (0, standing(&whole));
    for state in states.iter().step_by(3) {
        let outcome = late(state, Some(&earlier));
        assert!(!best.beats(&standing(&outcome)), "{best:?}: {:?}", outcome.methods);
        let is_worse = best.beats(&standing(&late(state, None)));
        let won = outcome.methods.iter().find(|method| method.won).unwrap();
        assert!(!is_worse || won.method == "earlier sitting", "{:?}", outcome.methods);
        worse += usize::from(is_worse);
    }
    assert!(worse > 0, "each sitting found as much in no time");
    // One that comes to its end gives the bits of a whole run; a rig of other LiDARs is passed over.
    let mut run = loaded(&problem, &states[1]);
    run.keep(baseline("far", 1.5));
    assert_eq!(bits(&finish(run, &mut |_| true).1), bits(&whole));
    let three =
        Placement { lidars: [&earlier.lidars[..], &earlier.lidars[..1]].concat(), ..earlier };
    assert_eq!(bits(&late(&states[1], Some(&three))), bits(&late(&states[1], None)));
}

#[test]
fn progress_rises_and_the_history_is_told() {
    let problem = problem();
    let (mut told, mut last) = (Vec::new(), None);
    let mut notes = Vec::new();
    let outcome = optimize(&problem, &settings(), &mut |event: &Event| {
        match *event {
            Event::Generation(record) => told.push(record.clone()),
            Event::Progress { work, done, total } => {
                let rises = last.is_none_or(|(w, d)| w != work || d <= done);
                assert!(rises && done <= total, "{work:?}: {done} of {total} after {last:?}");
                last = Some((work, done));
            }
            Event::Note(note) => notes.push(note.to_owned()),
            _ => {}
        }
        true
    })
    .unwrap();
    assert_eq!(told, outcome.history);
    assert!(matches!(last, Some((Work::Confirming { frames: 6 }, _))), "{last:?}");
    assert!(notes[0].starts_with("computing on cpu"), "{notes:?}");
    assert_eq!(outcome.stopped, Stopped::Generations(GenerationsStop::Budget));
}

#[test]
fn a_target_ends_the_generations_and_spares_the_swaps() {
    let problem = problem();
    let whole = optimize(&problem, &settings(), &mut |_: &Event| true).unwrap();
    let reached = whole.best.unwrap().objective.unwrap();
    let target = Settings { target: Some(0.8 * reached), ..settings() };
    let outcome = optimize(&problem, &target, &mut |_: &Event| true).unwrap();
    assert_eq!(outcome.stopped, Stopped::Generations(GenerationsStop::Target));
    assert!(outcome.best.unwrap().objective.unwrap() >= 0.8 * reached);
    assert!(outcome.evaluations < settings().evaluations && outcome.methods.len() == 1);
    assert!(outcome.certificate.is_none());
}

#[test]
fn a_search_over_some_frames_is_confirmed_over_all() {
    let problem = problem();
    let over = |frames| {
        let settings = Settings { frames, ..settings() };
        optimize(&problem, &settings, &mut |_: &Event| true).unwrap()
    };
    let (all, two) = (over(FrameChoice::All), over(FrameChoice::Count(2)));
    assert_eq!((all.search_frames, two.search_frames), (6, 2));
    assert!(all.frames_used.is_none() && two.frames_used.is_none());
    assert_eq!(all.baselines, two.baselines, "scored over all frames by both");
    for outcome in [&all, &two] {
        let best = outcome.best.clone().unwrap();
        let mut evaluator = sightline::Evaluator::on_cpu(problem.clone());
        let scores = evaluator.scores(&[best.placement]).unwrap().remove(0);
        assert_eq!(scores, best.scores);
        let won: Vec<_> = outcome.methods.iter().filter(|m| m.won).collect();
        assert_eq!((won.len(), won[0].objective), (1, best.objective));
    }
    let used = over(FrameChoice::OnDemand).frames_used.unwrap();
    assert_eq!(used.levels.last(), Some(&6));
}

#[test]
fn no_layout_that_was_given_is_better_than_the_result() {
    let problem = problem();
    let best = optimize(&problem, &settings(), &mut |_: &Event| true).unwrap().best.unwrap();
    let given = Placement { name: "given".into(), ..best.placement };
    let mut won = 0;
    // Searches over one frame end elsewhere than the best over all six.
    for seed in 1..=2 {
        for (baselines, starts) in [(vec![given.clone()], vec![]), (vec![], vec![given.clone()])] {
            let (frames, method) = (FrameChoice::Count(1), Method::Swaps);
            let delta = Some(Spacing { metres: 0.5, radians: 0.3 });
            let settings =
                Settings { seed, frames, method, baselines, starts, delta, ..settings() };
            let outcome = optimize(&problem, &settings, &mut |_: &Event| true).unwrap();
            let found = outcome.best.unwrap();
            assert!(found.objective >= best.objective, "{seed}: {:?}", found.objective);
            assert_eq!(found.placement.name, "optimized");
            let by = outcome.methods.iter().find(|method| method.won).unwrap();
            won += usize::from(by.method == "layout given");
        }
    }
    assert!(won > 0, "each search found something better");
}
