//! Sensors of several models side by side, and phases: every engine, the same bits.

use lidar_cast::cover::BitOrder;
use lidar_cast::engine::ReferenceBackend;
use sightline::vehicle::{SensorModel, SensorName, Sensors, SpinPhase};

use crate::common::*;

fn model(name: &str, table: BeamTable, phase: SpinPhase) -> SensorModel {
    SensorModel { name: SensorName::new(name).unwrap(), phase, ..SensorModel::plain(table) }
}

/// A spinning sensor of 7 × 45 beams, a solid-state one of 5 × 21 and a list of 40 directions, each of
/// another range.
fn models(phase: SpinPhase) -> Vec<SensorModel> {
    let channels: Vec<(f64, f64)> = (0..7).map(|k| (-30.0 + 10.0 * f64::from(k), 0.3)).collect();
    let spinning = BeamTable::spinning(&channels, 45, 12.0).unwrap();
    let sector = BeamTable::sector(&channels[1..6], [-60.0, 6.0], 21, 9.0).unwrap();
    let list = (0..40).map(|k| {
        let (a, e) = (2.4 * f64::from(k), 0.03 * f64::from(k) - 0.6);
        glam::DVec3::new(e.cos() * a.cos(), e.cos() * a.sin(), e.sin())
    });
    let list = BeamTable::from_directions(list, 6.0).unwrap();
    vec![
        model("spinning", spinning, phase),
        model("sector", sector, SpinPhase::Locked(0.0)),
        model("list", list, SpinPhase::Locked(0.4)),
    ]
}

fn mixed_problem(seed: u64, ends_at_hits: bool, phase: SpinPhase) -> Arc<Problem> {
    let problem = Arc::unwrap_or_clone(random_problem(seed, ends_at_hits));
    Arc::new(problem.with_sensors(Sensors::new(models(phase)).unwrap()))
}

/// Placements of 1 to 4 sensors of the models in turn; the first names none.
fn mixed_placements(seed: u64, count: usize) -> Vec<Placement> {
    let mut placements = random_placements(seed, count, 5.0);
    let names = ["", "sector", "list", "spinning", "sector"];
    let lidars = placements.iter_mut().flat_map(|p| &mut p.lidars);
    for (lidar, name) in lidars.zip(names.iter().cycle()) {
        lidar.sensor = SensorName::new(name).unwrap_or_default();
    }
    placements
}

#[test]
fn engines_agree_on_mixed_rigs_to_the_bit() {
    for (seed, ends_at_hits, phase) in [
        (61, true, SpinPhase::Free),
        (62, true, SpinPhase::Locked(0.02)),
        (63, false, SpinPhase::Free),
    ] {
        let problem = mixed_problem(seed, ends_at_hits, phase);
        let placements = mixed_placements(seed, 30);
        let mut reference = ReferenceBackend::new(problem.task().clone());
        let want = reference.tally(&placements, None).unwrap();
        assert!(want.iter().all(|tally| tally.covered > 0 && tally.beams > 0));
        let shorter = reference.tally(&placements, Some(3.0)).unwrap();
        assert_ne!(want, shorter);
        for mut engine in engines(&problem) {
            let name = engine.name();
            assert_eq!(engine.tally(&placements, None).unwrap(), want, "{name}");
            assert_eq!(engine.tally(&placements, Some(3.0)).unwrap(), shorter, "{name}");
            for placement in &placements[..6] {
                for frame in 0..2 {
                    let hits = bits(&reference.hits(&placement.lidars, frame).unwrap());
                    assert_eq!(bits(&engine.hits(&placement.lidars, frame).unwrap()), hits);
                }
                let covered = reference.covered(placement, 0).unwrap();
                assert_eq!(engine.covered(placement, 0).unwrap(), covered, "{name}");
            }
        }
    }
}

#[test]
fn a_mixed_placement_is_its_sensors_side_by_side() {
    let problem = mixed_problem(64, true, SpinPhase::Locked(0.0));
    let placements = mixed_placements(64, 12);
    let mut mixed = cpu(&problem);
    for placement in &placements {
        let all = mixed.hits(&placement.lidars, 1).unwrap();
        let mut alone = Vec::new();
        for pose in &placement.lidars {
            let model = problem.sensors().number(pose).unwrap();
            let table = problem.sensors().models()[model].clone();
            let single = SensorModel { name: SensorName::default(), ..table };
            let single = Sensors::new(vec![single]).unwrap();
            let single = Arc::new(Problem::clone(&problem).with_sensors(single));
            let pose = SensorPose { sensor: SensorName::default(), ..*pose };
            alone.extend(cpu(&single).hits(&[pose], 1).unwrap());
        }
        assert_eq!(bits(&all), bits(&alone));
        let each = placement.lidars.iter().flat_map(|lidar| {
            let one = Placement { name: "one".into(), lidars: vec![*lidar] };
            mixed.covered(&one, 1).unwrap()
        });
        let mut each: Vec<u64> = each.collect();
        each.sort_unstable();
        each.dedup();
        assert_eq!(mixed.covered(placement, 1).unwrap(), each);
    }
}

#[test]
fn a_phase_is_a_yaw_of_a_level_sensor() {
    let turned = mixed_problem(65, true, SpinPhase::Locked(0.05));
    let still = mixed_problem(65, true, SpinPhase::Locked(0.0));
    let pose = SensorPose { yaw: 0.2, ..SensorPose::at(0.3, -0.2, 0.1) };
    let by_yaw = SensorPose { yaw: 0.25, ..pose };
    let a = cpu(&turned).hits(&[pose], 0).unwrap();
    let b = cpu(&still).hits(&[by_yaw], 0).unwrap();
    let near = a.iter().zip(&b).filter(|(a, b)| (a.t - b.t).abs() < 1e-4).count();
    assert!(near as f64 >= 0.99 * a.len() as f64, "{near} of {}", a.len());
    assert_ne!(bits(&a), bits(&cpu(&still).hits(&[pose], 0).unwrap()));
}

#[test]
fn free_phases_differ_by_frame_and_not_by_what_else_is_asked() {
    let problem = mixed_problem(66, true, SpinPhase::Free);
    let placements = mixed_placements(66, 20);
    assert_eq!(problem.distinct_frames(), [(0, 1), (1, 1)]);
    let whole = cpu(&problem).tally(&placements, None).unwrap();
    // One placement alone, the other order, a frame of its own: the same phases.
    for (placement, want) in placements.iter().zip(&whole).rev() {
        let one = std::slice::from_ref(placement);
        assert_eq!(&cpu(&problem).tally(one, None).unwrap()[0], want);
        let mut sum = cpu(&problem.over(&[1]).into()).tally(one, None).unwrap().remove(0);
        sum += &cpu(&problem.over(&[0]).into()).tally(one, None).unwrap()[0];
        assert_eq!(&sum, want);
    }
    let sensors = problem.sensors().with_seed(9);
    let other = Arc::new(Problem::clone(&problem).with_sensors(sensors));
    assert_ne!(cpu(&other).tally(&placements, None).unwrap(), whole);
    let bitmaps = cpu(&problem).bitmaps(&placements[3].lidars, 0).unwrap();
    assert_eq!(bitmaps.order, BitOrder::rows(problem.roi()));
}

#[test]
fn an_unknown_sensor_is_refused_by_every_engine() {
    let problem = mixed_problem(67, true, SpinPhase::Free);
    let sensor = SensorName::new("nobody's").unwrap();
    let pose = SensorPose { sensor, ..SensorPose::at(0.0, 0.0, 0.0) };
    let placement = [Placement { name: "x".into(), lidars: vec![pose] }];
    for mut engine in engines(&problem) {
        let sums = engine.tally(&placement, None).err();
        for error in [sums, engine.hits(&[pose], 0).err(), engine.bitmaps(&[pose], 0).err()] {
            let error = error.expect("a refusal").to_string();
            assert!(error.contains("nobody's") && error.contains("`sector`"), "{error}");
        }
    }
}
