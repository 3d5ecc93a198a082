//! Voxels, ground and targets that cones see, against slabs in `f64` by brute force.

use crate::cli::*;
use crate::cli_cones::{counts, f64s, rig};
use crate::cli_shared::{cells, yard};

/// Metres before a thing within which a surface does not hide it, as documented.
const SLACK: f64 = 0.01;

/// A cone as the test reads it.
struct Cone {
    technology: String,
    at: [f64; 3],
    turned: [f64; 3],
    fov: [f64; 2],
    range: f64,
}

impl Cone {
    fn all(others: &Value) -> Vec<Self> {
        let of = |sensor: &Value| {
            let number = |key: &str| sensor.get(key).map_or(0.0, |v| v.number());
            Self {
                technology: sensor["technology"].text().to_owned(),
                at: ["x", "y", "z"].map(number),
                turned: ["roll", "pitch", "yaw"].map(number),
                fov: f64s(&sensor["fov"]),
                range: number("range"),
            }
        };
        others.list().iter().map(of).collect()
    }

    /// Turns back one axis after the other: yaw, pitch, roll.
    fn holds(&self, point: [f64; 3]) -> bool {
        let [mut x, mut y, mut z]: [f64; 3] = std::array::from_fn(|k| point[k] - self.at[k]);
        let [roll, pitch, yaw] = self.turned.map(f64::sin_cos);
        (x, y) = (yaw.1 * x + yaw.0 * y, yaw.1 * y - yaw.0 * x);
        (x, z) = (pitch.1 * x - pitch.0 * z, pitch.1 * z + pitch.0 * x);
        (y, z) = (roll.1 * y + roll.0 * z, roll.1 * z - roll.0 * y);
        let across = y.atan2(x).to_degrees().abs();
        let up = (z / (x * x + y * y + z * z).sqrt()).asin().to_degrees().abs();
        x.hypot(y).hypot(z) <= self.range && across <= self.fov[0] / 2.0 && up <= self.fov[1] / 2.0
    }

    /// True if the box is seen between solid boxes: by its middle, or the middle of a face that is turned here.
    fn sees(&self, thing: &[[f64; 3]; 2], solids: &[[[f64; 3]; 2]]) -> bool {
        let middle: [f64; 3] = std::array::from_fn(|k| (thing[0][k] + thing[1][k]) / 2.0);
        let mut points = vec![middle];
        for axis in 0..3 {
            let face = [thing[0][axis], thing[1][axis]];
            let turned = [self.at[axis] < face[0], self.at[axis] > face[1]];
            for (face, _) in face.into_iter().zip(turned).filter(|(_, turned)| *turned) {
                let mut point = middle;
                point[axis] = face;
                points.push(point);
            }
        }
        points.into_iter().any(|point| {
            let way: [f64; 3] = std::array::from_fn(|k| point[k] - self.at[k]);
            let length = way.iter().map(|v| v * v).sum::<f64>().sqrt();
            let enters = slabs(self.at, way, thing).unwrap_or(1.0).min(1.0);
            let free = |solid: &[[f64; 3]; 2]| {
                slabs(self.at, way, solid).is_none_or(|t| t * length >= enters * length - SLACK)
            };
            self.holds(point) && solids.iter().all(free)
        })
    }
}

/// Share of a way at which it first meets the surface of a box; `None` where it never does.
fn slabs(from: [f64; 3], way: [f64; 3], [low, high]: &[[f64; 3]; 2]) -> Option<f64> {
    let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
    for k in 0..3 {
        let [a, b] = [(low[k] - from[k]) / way[k], (high[k] - from[k]) / way[k]];
        (near, far) = (near.max(a.min(b)), far.min(a.max(b)));
    }
    // From inside the far side is met.
    let first = if near >= 0.0 { near } else { far };
    (near <= far && first >= 0.0).then_some(first)
}

/// Solids of the yard in frame 0, the ground last.
const YARD: [[[f64; 3]; 2]; 5] = [
    [[-2.0, -0.9, 0.2], [2.0, 0.9, 1.6]],
    [[-40.0, 13.13, 0.0], [40.0, 14.0, 4.0]],
    [[-40.0, -14.0, 0.0], [40.0, -13.13, 4.0]],
    [[39.5, 1.0, 0.0], [40.5, 3.0, 2.0]],
    [[-60.0, -60.0, -1.0], [60.0, 60.0, 0.0]],
];

/// Counts by the number of technologies, for cones and the LiDAR's own count of things left out.
fn by_hand(cones: &[Cone], things: &[[[f64; 3]; 2]], solids: &[[[f64; 3]; 2]]) -> [f64; 4] {
    let mut found = [0.0; 4];
    for thing in things {
        let seen = |word: &str| {
            let mut of = cones.iter().filter(|cone| cone.technology == word);
            usize::from(of.any(|cone| cone.sees(thing, solids)))
        };
        found[seen("camera") + 2 * seen("radar")] += 1.0;
    }
    found
}

/// Placements of a LiDAR that sees nothing: it looks at the sky.
fn looks_up(dir: &Path) {
    let lidar = json!({ "x": 0, "y": 0, "z": 2.4, "pitch": -1.5, "sensor": "front" });
    write_rig(dir, "up.json", "up", [lidar]);
}

/// Boxes of the occupied voxels of the yard.
fn occupied(dir: &Path) -> Vec<[[f64; 3]; 2]> {
    printed(dir, "psog build yard.json --out y.npz");
    let file = fs::File::open(dir.join("y.npz")).unwrap();
    let occupied: Vec<u64> = array(&mut zip::ZipArchive::new(file).unwrap(), "index");
    let voxel = |index: &u64| {
        let at = [index / 9 / 80, index / 9 % 80, index % 9].map(|k| k as f64 * 0.4);
        let low: [f64; 3] = std::array::from_fn(|k| at[k] + [-16.0, -16.0, -0.3][k]);
        [low, low.map(|v| v + 0.4)]
    };
    occupied.iter().map(voxel).collect()
}

#[test]
fn voxels_ground_and_targets_are_those_of_slabs_in_f64() {
    let dir = yard();
    let dir = dir.path();
    change(dir, "cart.json", |cart| cart["other_sensors"] = rig());
    looks_up(dir);
    let cones = Cone::all(&rig());
    let told = stderr(dir, "study redundancy yard.json up.json --backend cpu --frames 1");
    told.says("the own body blocks 100 % of the view of `radar 4`");
    assert_eq!(told.matches("the own body blocks").count(), 1, "{told}");
    let found = ok(dir, "study redundancy yard.json up.json --backend cpu --frames 1");
    let of = &found["rows"][0]["technologies"];
    let is = |seen: &Value, things: &[[[f64; 3]; 2]], solids: &[[[f64; 3]; 2]], off: f64| {
        let [none, camera, radar, both] = by_hand(&cones, things, solids);
        let (by, each) = counts(seen);
        assert_eq!(each[0], 0.0, "the LiDAR looks up");
        let wanted = [none, camera + radar, both, 0.0, camera + both, radar + both];
        let found = [by[0], by[1], by[2], by[3], each[1], each[2]];
        let worst = found.iter().zip(wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst <= off, "{seen}: {found:?} {wanted:?}");
        assert!([none, camera, both].iter().all(|count| *count > 3.0), "{wanted:?}");
    };
    let voxels = occupied(dir);
    // Things on the border of a cone or of the slack are rounded to either side.
    is(&of["occupied"], &voxels, &YARD, 4.0);
    let [half_x, half_y] = [2.0, 0.9];
    for (key, within) in [("ground_3m", 3.0), ("ground_10m", 10.0)] {
        let near = cells([half_x, half_y]).into_iter().filter(|(_, distance)| *distance <= within);
        let points: Vec<_> = near.map(|([x, y], _)| [[x, y, 0.0]; 2]).collect();
        is(&of[key], &points, &YARD, 2.0);
    }
    let targets = found["targets"].list();
    for (target, seen) in targets.iter().zip(of["targets"].list()) {
        assert_eq!(target["name"], seen["target"]);
        let [length, width, height] = f64s(&target["size"]);
        let places = (0..160).map(|k| {
            let (distance, bearing) = (5.0 * f64::from(k / 16 + 1), f64::from(k % 16) * 22.5);
            let (sin, cos) = bearing.to_radians().sin_cos();
            let [x, y] = [distance * cos, distance * sin];
            [[x - length / 2.0, y - width / 2.0, 0.0], [x + length / 2.0, y + width / 2.0, height]]
        });
        let beside = places.filter(|[low, high]| {
            low[0] >= half_x || high[0] <= -half_x || low[1] >= half_y || high[1] <= -half_y
        });
        is(seen, &beside.collect::<Vec<_>>(), &YARD[..1], 0.0);
    }
    assert_eq!(targets.len(), 4);
}
