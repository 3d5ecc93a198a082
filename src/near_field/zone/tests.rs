//! Lanes, outlines and lost ground on small planes of cells.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

/// Middles of some cells from a place on, metres.
fn middles(from: f64, count: i32) -> impl Iterator<Item = f64> {
    (0..count).map(move |k| from + CELL * (f64::from(k) + 0.5))
}

/// A box of 4 by 2 m, and the ground in 8 lanes up to 10 m behind and ahead of it.
fn ground() -> (Footprint, Vec<Cell>) {
    let footprint = Footprint::of([[-2.0, -1.0], [2.0, -1.0], [2.0, 1.0], [-2.0, 1.0]]).unwrap();
    let cell = |x: f64, y: f64| Cell { centre: [x, y], distance: footprint.distance([x, y]) };
    let behind = middles(-12.0, 40).flat_map(|x| middles(-1.0, 8).map(move |y| [x, y]));
    let ahead = middles(2.0, 40).flat_map(|x| middles(-1.0, 8).map(move |y| [x, y]));
    let ground = behind.chain(ahead).map(|[x, y]| cell(x, y)).collect();
    (footprint, ground)
}

#[test]
fn a_wedge_that_does_not_end_has_no_depth_and_the_deepest_lane_counts() {
    let (footprint, ground) = ground();
    // Ahead everything from 1 m on is seen, in one lane from 3 m on. Behind, a lane is not seen at all.
    let is_seen = |cell: &&Cell| match cell.centre {
        [x, y] if x > 0.0 => x > if y.abs() < CELL { 5.0 } else { 3.0 },
        [_, y] => y > -0.75,
    };
    let seen: Vec<Cell> = ground.iter().filter(is_seen).copied().collect();
    let zone = BlindZone::new(&footprint, [&ground, &seen, &[]]);
    assert_eq!(zone.ahead, Some(3.0 + CELL / 2.0));
    assert_eq!((zone.behind, zone.left), (None, None));
    let all = BlindZone::new(&footprint, [&ground, &ground, &[]]);
    assert_eq!((all.ahead, all.behind), (Some(CELL / 2.0), Some(CELL / 2.0)));
}

#[test]
fn ground_lost_again_behind_a_slit_is_told_and_gaps_between_rings_are_not() {
    let (footprint, ground) = ground();
    // Behind a slit of 1.25 m is seen, and all of two lanes. Ahead are rings with gaps of 0.75 m.
    let is_seen = |cell: &&Cell| match cell.centre {
        [x, _] if x > 0.0 => ((x - 2.0) % 1.0) < CELL,
        [x, y] => x > -3.25 || y < -0.5,
    };
    let seen: Vec<Cell> = ground.iter().filter(is_seen).copied().collect();
    let zone = BlindZone::new(&footprint, [&ground, &seen, &[]]);
    assert_eq!((zone.ahead, zone.behind), (Some(CELL / 2.0), Some(CELL / 2.0)));
    let (side, frame) = ("behind", None);
    let want = LostGround { side, from: 1.25, to: 10.0, lanes: 6, of: 8, frame };
    assert_eq!(zone.lost, [want]);
    let words = "unseen again in 6 of 8 lanes, the longest stretch from 1.3 to 10 m";
    assert_eq!(zone.lost_on("behind").unwrap().in_words(), words);
    assert_eq!(zone.lost_on("ahead"), None);
    // A thing of 1 m stands on a lane: the ground in its shadow is not lost by the rig.
    let cells = |thing: bool| -> Vec<(f64, bool)> {
        let all = middles(0.0, 40).map(|metres| (metres, metres < 2.0));
        all.filter(|(metres, _)| !thing || !(2.0..3.0).contains(metres)).collect()
    };
    assert_eq!(lost_stretches(&cells(false)), [[2.0, 10.0]]);
    assert_eq!(lost_stretches(&cells(true)), [[0.0; 2]; 0]);
}

#[test]
fn more_ground_seen_never_makes_the_kept_depth_worse() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let depth = |cells: &[(f64, bool)], metres| {
        kept_depth(cells.iter().copied(), metres).unwrap_or(f64::INFINITY)
    };
    let (mut lost, mut better) = (0, 0);
    for _ in 0..20_000 {
        // Things leave gaps in the ground, and seen cells come in runs, too.
        let mut runs = |likely: f64| -> Vec<bool> {
            let mut is_set = rng.random_bool(likely);
            let turned = |_| {
                is_set ^= rng.random_bool(0.25);
                is_set
            };
            (0..40).map(turned).collect()
        };
        let (ground, few, added) = (runs(0.9), runs(0.3), runs(0.3));
        let lane = |seen: &dyn Fn(usize) -> bool| -> Vec<(f64, bool)> {
            let cells = middles(0.0, 40).enumerate().filter(|(k, _)| ground[*k]);
            cells.map(|(k, metres)| (metres, seen(k))).collect()
        };
        let (less, more) = (lane(&|k| few[k]), lane(&|k| few[k] || added[k]));
        for metres in [0.5, 1.0, 2.0, 3.3, 6.0, 9.5] {
            let [with_less, with_more] = [depth(&less, metres), depth(&more, metres)];
            assert!(with_more <= with_less, "{metres}: {less:?} {more:?}");
            let nearest = less.iter().find(|cell| cell.1).map_or(f64::INFINITY, |cell| cell.0);
            lost += usize::from(with_less > nearest);
            better += usize::from(with_more < with_less);
        }
    }
    assert!(lost > 100 && better > 100, "{lost} {better}");
    // Ground seen right behind a thing, and none beyond: as good as without that ground.
    let behind_a_thing = |is_seen: bool| -> Vec<(f64, bool)> {
        let ground = middles(0.0, 40).filter(|metres| !(0.5..1.0).contains(metres));
        ground.map(|metres| (metres, metres < 0.5 || (is_seen && metres < 1.5))).collect()
    };
    let both = [false, true].map(|is_seen| depth(&behind_a_thing(is_seen), 2.0));
    assert_eq!(both, [CELL / 2.0; 2]);
    // The first cell seen and lost ground behind it: the lane does not end.
    let slit: Vec<(f64, bool)> = middles(0.0, 40).map(|metres| (metres, metres < 1.0)).collect();
    assert_eq!(depth(&slit, 2.0), f64::INFINITY);
}

#[test]
fn the_outline_is_as_deep_as_each_side_is_said_to_be_and_holds_no_seen_cell() {
    let (low, high) = ([-2.1, -0.9], [2.3, 0.95]);
    let footprint = Footprint::of([low, [high[0], low[1]], high, [low[0], high[1]]]).unwrap();
    let steps = (-40..40).map(|k| CELL * (f64::from(k) + 0.5));
    let cells = steps.clone().flat_map(|x| steps.clone().map(move |y| [x, y]));
    let is_out = |c: &[f64; 2]| (0..2).any(|k| c[k] < low[k] || c[k] > high[k]);
    let cell = |centre| Cell { centre, distance: footprint.distance(centre) };
    let ground: Vec<Cell> = cells.filter(is_out).map(cell).collect();
    // Seen on the left at once, ahead behind a slanted line, behind from 2 m on, on the right nowhere.
    let is_seen = |cell: &&Cell| match cell.centre {
        [x, y] if x > high[0] => x - high[0] > 1.0 + 0.8 * (y + 1.0),
        [x, _] if x < low[0] => low[0] - x > 2.0,
        [_, y] => y > 0.0,
    };
    let seen: Vec<Cell> = ground.iter().filter(is_seen).copied().collect();
    let zone = BlindZone::new(&footprint, [&ground, &seen, &[]]);
    let within = |of: &dyn Fn(&[f64; 2]) -> bool| -> Vec<[f64; 2]> {
        zone.polygon.iter().copied().filter(|corner| of(corner)).collect()
    };
    let most = |points: Vec<[f64; 2]>, depth: &dyn Fn(&[f64; 2]) -> f64| {
        points.iter().map(depth).fold(0.0, f64::max)
    };
    let ahead = within(&|[x, y]| *x > high[0] && (low[1]..=high[1]).contains(y));
    assert!((most(ahead, &|c| c[0] - high[0]) - zone.ahead.unwrap()).abs() < 1e-12);
    let left = within(&|[x, y]| *y > high[1] && (low[0]..=high[0]).contains(x));
    assert!((most(left, &|c| c[1] - high[1]) - zone.left.unwrap()).abs() < 1e-12);
    assert_eq!((zone.left.unwrap() < CELL, zone.right), (true, None));
    // Point in polygon by the parity of crossings, and the area by Gauss's formula.
    let ends = || zone.polygon.iter().zip(zone.polygon.iter().cycle().skip(1));
    let holds = |[x, y]: [f64; 2]| {
        let crosses = |(a, b): &(&[f64; 2], &[f64; 2])| {
            (a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
        };
        ends().filter(crosses).count() % 2 == 1
    };
    let just_before = |cell: &Cell| holds(cell.centre.map(|v| v + 1e-6 * v.signum()));
    assert!(seen.iter().all(|cell| !just_before(cell)), "{:?}", zone.polygon);
    let sum: f64 = ends().map(|(a, b)| 0.5 * (a[0] * b[1] - b[0] * a[1])).sum();
    let body = (high[0] - low[0]) * (high[1] - low[1]);
    assert!((sum - body - zone.area).abs() < 1e-9, "{sum} {body} {}", zone.area);
}

#[test]
fn ground_under_own_bodies_is_no_part_of_the_blind_area() {
    let (footprint, ground) = ground();
    // Nothing is seen behind; ahead all from 3 m on. A trailer that bends stands over two lanes, from 1 to 4 m ahead and from
    // 2 to 4 m behind.
    let under = |cell: &&Cell| {
        let [x, y] = cell.centre;
        y > 0.5 && ((3.0..6.0).contains(&x) || (-6.0..-4.0).contains(&x))
    };
    let own: Vec<Cell> = ground.iter().filter(under).copied().collect();
    let ground: Vec<Cell> = ground.iter().filter(|cell| !under(cell)).copied().collect();
    let seen: Vec<Cell> = ground.iter().filter(|cell| cell.centre[0] > 5.0).copied().collect();
    let zone = BlindZone::new(&footprint, [&ground, &seen, &own]);
    // Ahead six lanes end at 3.125 m, two at 4.125 m after 1 m and before 3 m of the trailer. Behind all reach 10 m.
    let want = 0.25 * (6.0 * 3.125 + 2.0 * (4.125 - 3.0) + 8.0 * 10.0 - 2.0 * 2.0);
    assert!((zone.area - want).abs() < 1e-9, "{} is not {want}", zone.area);
    assert_eq!((zone.ahead, zone.behind), (Some(4.125), None));
    let json = serde_json::to_value(&zone.lanes).unwrap();
    let own: Vec<&serde_json::Value> =
        json.as_array().unwrap().iter().filter_map(|lane| lane.get("own_body")).collect();
    assert_eq!(own, [3.0, 3.0, 2.0, 2.0]);
}
