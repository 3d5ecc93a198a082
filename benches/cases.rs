//! Closest hits of the sets of sensors that are cast in practice, against Embree.

#![allow(clippy::unwrap_used)]

use lidar_cast::bvh::Bvh;
use lidar_cast::cast::{Caster, cast_closest};
use serde_json::Value;
use sightline::geom::TriangleSoup;
use sightline::vehicle::BeamTable;

use crate::peer::{Peer, Rays};
use crate::row::{Rival, Row, print, same_bits};
use crate::setup::{self, RANGE};
use crate::{Args, REFERENCE};

/// Roll and pitch of turned sensors, in radians.
const TURN: f64 = 0.3;

/// A set of sensors.
struct Case {
    name: &'static str,
    /// Four sensors each; of the first one alone where `one` is set.
    placements: usize,
    one: bool,
    turn: f64,
    table: BeamTable,
}

fn cases() -> Vec<Case> {
    let case = |name, placements, turn, table| Case { name, placements, one: false, turn, table };
    let table = || setup::table(720);
    vec![
        case("1 placement of 4 x 16 x 720, turned", 1, TURN, table()),
        case("12 placements, turned", 12, TURN, table()),
        case("1 placement of 4 x 16 x 250, turned", 1, TURN, setup::table(250)),
        Case { one: true, ..case("1 sensor of 128 x 2048, turned", 1, TURN, dense_table()) },
        case("256 placements, turned", 256, TURN, table()),
        case("256 placements of one rotation", 256, 0.0, table()),
    ]
}

/// 128 channels from −25° to 15°.
fn dense_table() -> BeamTable {
    let channels: Vec<(f64, f64)> =
        (0..128).map(|k| (-25.0 + 40.0 * f64::from(k) / 127.0, 0.0)).collect();
    BeamTable::spinning(&channels, 2048, f64::from(RANGE)).unwrap()
}

/// A table for each set of sensors.
pub(crate) fn casting(args: &Args, soup: &TriangleSoup, bvh: &Bvh) -> Vec<Value> {
    let roi = setup::roi(0.2);
    let stages = cases().into_iter().map(|case| {
        let batch = setup::placements(case.placements, case.turn, args.seed);
        let mut poses = setup::poses(&batch, &roi);
        poses.truncate(if case.one { 1 } else { poses.len() });
        let beams = poses.len() * case.table.directions().len();
        let rays = Rays::write(soup, &poses, &case.table).expect("room for the rays");
        let peer = Peer::embree(args.embree.as_deref(), &rays, args.threads);
        let mut embree = Rival::new("Embree 4, 16-wide coherent", peer);
        let (caster, mut ours) = (Caster::new(&case.table), Row::new("Caster"));
        let mut hits = Vec::new();
        // Small sets are timed more often.
        let rounds = args.rounds * (256 / case.placements).clamp(1, 8);
        for round in 0..rounds + 1 {
            ours.time(beams, || caster.closest_hits(&poses, bvh, RANGE, &mut hits));
            let found = hits.iter().filter(|hit| hit.is_hit()).count();
            embree.pass(beams, found);
            // The first round warms up.
            if round == 0 {
                ours.runs.clear();
                embree.row.runs.clear();
                let few = &poses[..poses.len().min(4 * REFERENCE)];
                let want = cast_closest(few, &case.table, bvh, RANGE);
                assert!(same_bits(&want, &hits), "the hits differ");
            }
        }
        print(case.name, &[&embree.row, &ours], "million rays a second", |s| 1e-6 / s)
    });
    stages.collect()
}
