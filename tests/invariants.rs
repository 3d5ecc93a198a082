//! Invariants of every placement, on random problems and on every committed scene.

use std::sync::LazyLock;

use lidar_cast::task::KINDS;
use rand::seq::SliceRandom;
use sightline::audit::{Trial, TrialResult};
use sightline::internals::{
    Atlas, Generations, GridPlacement, GridSearch, Moves, PoseGrid, Spacing, hostile_placements,
};
use sightline::problem::Tally;
use sightline::score::{Objective, Scores};
use sightline::search::{Evaluator, Settings};
use sightline::vehicle::random_placements;

use crate::common::*;
use crate::own_scenes::{AZIMUTH_STEPS, Own, SCENES, description, mirrored, table_7};
use crate::reference::Reference;

/// Built once: several tests look at the same scenes.
static OWN: LazyLock<Vec<(&'static str, Own)>> =
    LazyLock::new(|| SCENES.map(|name| (name, Own::new(&description(name)))).into_iter().collect());

/// Layouts of the paper, placements from the mount, and hostile ones.
fn placements(own: &Own) -> Vec<Placement> {
    let mut all = table_7();
    all.extend(random_placements(&own.constraints, 12, 7));
    all.extend(hostile_placements(own.problem.roi(), 14, 7));
    all
}

fn tally(problem: &Arc<Problem>, placements: &[Placement], range: f32) -> Vec<Tally> {
    cpu(problem).tally(placements, Some(range)).unwrap()
}

fn own_tally(own: &Own, placements: &[Placement]) -> Vec<Tally> {
    tally(&own.problem, placements, own.problem.sensors().table(0).range())
}

/// A problem with the placements that its invariants are tried on.
struct Case {
    name: String,
    problem: Arc<Problem>,
    placements: Vec<Placement>,
}

/// Random problems of both kinds of coverage, and the own scenes.
fn cases() -> Vec<Case> {
    let random = [(71, true), (72, false), (73, true), (74, false)].map(|(seed, ends_at_hits)| {
        let (name, placements) =
            (format!("random {seed}"), crate::common::random_placements(seed, 24, 6.0));
        Case { name, problem: random_problem(seed, ends_at_hits), placements }
    });
    let own = OWN.iter().map(|(name, own)| {
        let problem = own.problem.clone();
        Case { name: (*name).to_owned(), problem, placements: placements(own) }
    });
    random.into_iter().chain(own).collect()
}

#[test]
fn a_sensor_more_never_lowers_the_information() {
    for Case { name, problem, placements } in cases() {
        let mut grew = 0;
        for placement in &placements {
            let parts: Vec<Placement> = (1..=placement.lidars.len())
                .map(|n| Placement { lidars: placement.lidars[..n].to_vec(), ..placement.clone() })
                .collect();
            for pair in tally(&problem, &parts, problem.sensors().table(0).range()).windows(2) {
                let kinds = (0..KINDS).all(|kind| pair[0].entropy[kind] <= pair[1].entropy[kind]);
                assert!(kinds && pair[0].covered <= pair[1].covered, "{name}: {}", placement.name);
                grew += u32::from(pair[0].entropy[0] < pair[1].entropy[0]);
            }
        }
        assert!(grew > 20, "{name}: only {grew} sensors added anything");
    }
}

/// A shorter range never covers more, and for many placements it covers less at every step.
#[test]
fn a_shorter_range_covers_less() {
    for Case { name, problem, placements } in cases() {
        let full = problem.sensors().table(0).range();
        let steps = [0.3, 0.12, 0.04].map(|share| tally(&problem, &placements, share * full));
        for (step, pair) in steps.windows(2).enumerate() {
            let mut fell = 0;
            for ((long, short), placement) in pair[0].iter().zip(&pair[1]).zip(&placements) {
                let amounts = |t: &Tally| [t.covered, t.entropy[0], t.hits];
                let [long, short] = [long, short].map(amounts);
                let falls = (0..3).all(|k| short[k] <= long[k]);
                assert!(falls, "{name}: {}, step {step}: {long:?}, {short:?}", placement.name);
                fell += usize::from(short[0] < long[0]);
            }
            let many = placements.len() / 4;
            assert!(fell > many, "{name}, step {step}: the range changes {fell} placements alone");
        }
    }
}

#[test]
fn the_order_of_sensors_changes_nothing() {
    let mut rng = rng(77);
    for Case { name, problem, placements } in cases() {
        let mut shuffled = placements.clone();
        shuffled.iter_mut().for_each(|placement| placement.lidars.shuffle(&mut rng));
        let changed = placements.iter().zip(&shuffled).filter(|(a, b)| a != b).count();
        assert!(changed > 5, "{name}: only {changed} placements have a new order");
        let scores = |placements: &[Placement]| {
            let tallies = tally(&problem, placements, problem.sensors().table(0).range());
            let scores = tallies.iter().map(|tally| {
                let (content, frames) = (problem.content(), problem.frame_count());
                let mut scores = Scores::new("same", tally, content, frames, true, None);
                scores.unique_share.sort_by(f64::total_cmp);
                let guards = std::mem::take(&mut scores.guards).len();
                (scores, guards)
            });
            scores.collect::<Vec<_>>()
        };
        assert_eq!(scores(&placements), scores(&shuffled), "{name}");
    }
}

/// A shorter range may raise M-SOG, which likes what is blind; what a reader is told first, the score
/// with its guards, it never raises.
#[test]
fn a_shorter_range_never_raises_the_verdict() {
    for (name, own) in OWN.iter() {
        let mut evaluator = own.evaluator();
        let placements = placements(own);
        let whole = evaluator.scores(&placements).unwrap();
        let mut fooled = 0;
        for range in [60.0, 40.0, 25.0, 10.0, 3.0] {
            let short = evaluator.scores_at(&placements, Some(range)).unwrap();
            for (whole, short) in whole.iter().zip(short) {
                let what = format!("{name}: {} at {range} m", whole.name);
                let gain = |s: &Scores| s.segmentation.information_gain.unwrap_or(0.0);
                assert!(gain(&short) <= gain(whole), "{what} gains more");
                assert!(
                    whole.guards.is_empty() || !short.guards.is_empty(),
                    "{what} loses {:?}",
                    whole.guards
                );
                let trial = Trial::new(&what, whole, short);
                assert_ne!(trial.verdict, TrialResult::Fooled, "{what}: {:?}", trial.fooled);
                fooled += usize::from(!trial.fooled.is_empty());
            }
        }
        assert!(fooled > 0, "{name}: no score was fooled, so that no guard was needed");
    }
}

#[test]
fn a_turn_by_one_azimuth_step_changes_nothing() {
    for (name, own) in OWN.iter() {
        let reference = Reference::new(own);
        let placement = random_placements(&own.constraints, 1, 8).remove(0);
        let step = std::f64::consts::TAU / f64::from(AZIMUTH_STEPS);
        // A turn about the vertical is one about the sensor's own axis only where it stands level.
        let mut level = placement;
        level.lidars.iter_mut().for_each(|pose| (pose.roll, pose.pitch) = (0.0, 0.0));
        let mut turned = level.clone();
        turned.lidars.iter_mut().for_each(|pose| pose.yaw += step);
        let [a, b] = [&level, &turned].map(|p| reference.tally(p));
        assert_eq!(a, b, "{name}, in f64");
        let [a, b] = [&level, &turned].map(|p| own_tally(own, std::slice::from_ref(p)).remove(0));
        close(name, &a, &b, 1e-4);
    }
}

#[test]
fn a_mirror_image_has_the_same_scores() {
    for (name, own) in OWN.iter() {
        let image = own.mirrored();
        let placements = random_placements(&own.constraints, 6, 9);
        let mirrored: Vec<Placement> = placements.iter().map(mirrored).collect();
        let (ours, theirs) = (Reference::new(own), Reference::new(&image));
        let (a, b) = (ours.tally(&placements[0]), theirs.tally(&mirrored[0]));
        assert!(a.covered > 5000 && a.hits > 1000, "{name}: {a:?}");
        assert_eq!(a, b, "{name}, in f64");
        // The backends agree with f64, so that its symmetry says something about theirs.
        close(name, &a, &own_tally(own, &placements[..1])[0], 1e-4);
        for (a, b) in own_tally(own, &placements).iter().zip(&own_tally(&image, &mirrored)) {
            close(name, a, b, 1e-5);
        }
    }
}

/// The sums agree to a share of themselves.
fn close(name: &str, a: &Tally, b: &Tally, share: f64) {
    let pairs = [
        ("covered", a.covered, b.covered),
        ("entropy", a.entropy[0], b.entropy[0]),
        ("hits", a.hits, b.hits),
    ];
    for (what, a, b) in pairs {
        let change = (a.abs_diff(b)) as f64 / a as f64;
        assert!(change <= share, "{name}: {what} {a} and {b} differ by {change:e}");
    }
}

/// No search ends with a placement that violates a guard while it has seen one that violates none.
#[test]
fn a_guarded_placement_is_never_preferred() {
    let mut rng = rng(78);
    for (name, own) in OWN.iter() {
        // A mount that tempts: sensors may look at the sky and stand inside the car.
        let constraints = own.constraints.with_regions(|region| {
            (region.lower[2], region.lower[3], region.upper[3]) = (0.3, -3.1, 3.1);
        });
        let backend = Box::new(cpu(&own.problem));
        let mut evaluator = Evaluator::new(mounted(&own.problem, &constraints), backend);
        for objective in ["m_sog", "m_sog_scaled", "information_gain"] {
            let settings = Settings {
                objective: objective.parse().unwrap(),
                evaluations: 48,
                population: Some(12),
                seed: rng.random(),
                ..Settings::default()
            };
            let starts = &settings.baselines;
            let mut search = Generations::new(&settings, &constraints, starts.iter()).unwrap();
            let (mut seen, mut unguarded, mut guarded) = (0, false, 0);
            while search.stopped().is_none() {
                let record =
                    search.step(&mut evaluator, &settings, &mut || true).unwrap().unwrap().record;
                let scored = (search.evaluations() - seen) as usize - record.infeasible;
                seen = search.evaluations();
                unguarded |= scored > record.guarded;
                guarded += record.guarded;
                if unguarded {
                    assert_eq!(search.best().unwrap().standing.guards, 0, "{name}, {objective}");
                }
            }
            assert!(guarded > 0 && unguarded, "{name}: the mount does not tempt");
        }
    }
}

/// Nor does a climb on the grid come to one, and beside a placement that violates none the best blind
/// one does not count.
#[test]
fn a_climb_ends_without_a_violated_guard() {
    let (name, own) = &OWN[0];
    let constraints = own.constraints.with_lidars(2);
    let constraints = constraints.with_regions(|region| {
        (region.lower[3], region.upper[3]) = (-3.0, 3.0);
    });
    let backend = Box::new(cpu(&own.problem));
    let mut evaluator = Evaluator::new(mounted(&own.problem, &constraints), backend);
    let grid = PoseGrid::new(&constraints, Spacing { metres: 0.6, radians: 1.0 }).unwrap();
    let all: Vec<u32> = (0..grid.len()).collect();
    let search = |objective: &str, evaluator: &Evaluator| {
        let objective: Objective = objective.parse().unwrap();
        let atlas = Atlas::new(own.problem.clone(), grid.clone(), objective.needed(), MEMORY);
        GridSearch::new(atlas, objective, evaluator)
    };
    let mut honest = search("information_gain", &evaluator);
    let start = honest.greedy(&mut evaluator, &all).unwrap().unwrap();
    assert!(honest.standing(&mut evaluator, &start).unwrap().is_sound(), "{name}: {start:?}");
    let mut tempted = search("m_sog", &evaluator);
    let blind = tempted.greedy(&mut evaluator, &all).unwrap().unwrap();
    assert!(
        !tempted.standing(&mut evaluator, &blind).unwrap().is_sound(),
        "{name}: M-SOG is not tempted"
    );
    let top = tempted
        .climb(&mut evaluator, &start.poses, Moves::Anywhere, &mut |_| true)
        .unwrap()
        .unwrap();
    assert!(tempted.standing(&mut evaluator, &top).unwrap().is_sound(), "{name}: {top:?}");
    assert!(blind.value > top.value, "{name}: blindness does not pay");
    for pair in [[&blind, &top], [&top, &blind]] {
        let [a, b] = pair.map(GridPlacement::clone);
        assert_eq!(tempted.preferred(&mut evaluator, a, b, &mut |_| true).unwrap(), top, "{name}");
    }
}
