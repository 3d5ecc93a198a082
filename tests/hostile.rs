//! Geometry and poses that methods fail at, on both backends: the same bits, and a stated result.

use lidar_cast::bvh::NO_HIT;

use crate::common::*;

const AHEAD: [f64; 3] = [1.0, 0.0, 0.0];

/// One line a case: a soup, a sensor, the beams in its frame, and what they must hit.
struct Case {
    name: &'static str,
    /// Corners, three a triangle.
    triangles: Vec<[[f32; 3]; 3]>,
    sensor: [f64; 3],
    directions: Vec<[f64; 3]>,
    range: f64,
    /// (distance, triangle) of each beam; the distance to a share of 10⁻⁶.
    want: Vec<(f32, u32)>,
}

/// A square with corners (x, ±half, ±half) in two triangles.
fn square(x: f32, half: f32) -> Vec<[[f32; 3]; 3]> {
    let corner = |y: f32, z: f32| [x, y * half, z * half];
    let (a, b, c, d) = (corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0));
    vec![[a, b, c], [a, c, d]]
}

fn scaled(triangles: Vec<[[f32; 3]; 3]>, scale: f32) -> Vec<[[f32; 3]; 3]> {
    triangles.into_iter().map(|t| t.map(|c| c.map(|v| v * scale))).collect()
}

fn cases() -> Vec<Case> {
    // From the origin, up to 10 m.
    let case = |name, triangles, directions: &[[f64; 3]], want: &[(f32, u32)]| Case {
        name,
        triangles,
        sensor: [0.0; 3],
        directions: directions.to_vec(),
        range: 10.0,
        want: want.to_vec(),
    };
    let none = (10.0, NO_HIT);
    let two = || [square(5.0, 1.0), square(5.0, 1.0)].concat();
    let sliver = vec![[[5.0, -1.0, 0.0], [5.0, 1.0, 0.0], [5.0, 1.0, 1e-6]]];
    let flat = vec![[[5.0, -1.0, 0.0], [5.0, 1.0, 0.0], [5.0, 0.0, 0.0]]];
    let point = vec![[[5.0, 0.0, 0.0]; 3]];
    let floor = vec![[[-9.0, -9.0, 0.0], [9.0, -9.0, 0.0], [0.0, 9.0, 0.0]]];
    let down = [0.0, 0.0, -1.0];
    // Classes differ: each triangle of a case has its own.
    let overlapping = vec![
        [[5.0, -2.0, -1.0], [5.0, 1.0, -1.0], [5.0, 1.0, 2.0]],
        [[5.0, -1.0, -1.0], [5.0, 2.0, -1.0], [5.0, -1.0, 2.0]],
    ];
    let around: Vec<_> = [-1.0, 1.0].into_iter().flat_map(|x| square(x, 1.0)).collect();
    vec![
        case(
            "overlapping triangles of two classes in one plane",
            overlapping,
            &[AHEAD, [5.0, 1.5, -0.9], [5.0, -1.5, -0.9]],
            &[(5.0, 0), (28.06_f32.sqrt(), 1), (28.06_f32.sqrt(), 0)],
        ),
        Case {
            sensor: [0.5, 0.0, 0.0],
            ..case(
                "between the walls of a solid",
                around,
                &[AHEAD, [-1.0, -0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]],
                &[(0.5, 2), (1.5, 0), none, none],
            )
        },
        case(
            "one zero component, of either sign",
            square(5.0, 1.0),
            &[[5.0, 0.5, 0.0], [5.0, 0.5, -0.0], [5.0, 0.0, 0.5], [5.0, -0.0, 0.5]],
            &[
                (25.25_f32.sqrt(), 0),
                (25.25_f32.sqrt(), 0),
                (25.25_f32.sqrt(), 1),
                (25.25_f32.sqrt(), 1),
            ],
        ),
        Case {
            sensor: [0.0, 0.0, -9999.0],
            range: 1e4,
            ..case("from far below", floor.clone(), &[[0.0, 0.0, 1.0]], &[(9999.0, 0)])
        },
        case("minus zero components", square(5.0, 1.0), &[[1.0, -0.0, -0.0]], &[(5.0, 0)]),
        case(
            "towards a shared edge",
            square(5.0, 1.0),
            &[[5.0, 0.5, 0.5]],
            &[(25.5_f32.sqrt(), 0)],
        ),
        case(
            "towards a shared corner",
            square(5.0, 1.0),
            &[[5.0, 1.0, 1.0]],
            &[(27.0_f32.sqrt(), 0)],
        ),
        case("just beside the rim", square(5.0, 1.0), &[[5.0, 1.001, 0.0]], &[none]),
        case(
            "the same square twice",
            two(),
            &[AHEAD, [5.0, 0.3, -0.7]],
            &[(5.0, 0), (25.58_f32.sqrt(), 0)],
        ),
        Case {
            sensor: [5.0, -3.0, 0.0],
            ..case("in the plane of the square", square(5.0, 1.0), &[[0.0, 1.0, 0.0]], &[none])
        },
        Case {
            sensor: [5.0, 0.0, 0.0],
            ..case(
                "starting on the square",
                square(5.0, 1.0),
                &[AHEAD, [-1.0, 0.0, 0.0]],
                &[none, none],
            )
        },
        Case {
            sensor: [6.0, 0.2, 0.1],
            ..case(
                "starting behind it",
                square(5.0, 1.0),
                &[AHEAD, [-1.0, 0.0, 0.0]],
                &[none, (1.0, 0)],
            )
        },
        Case {
            range: 5.0,
            ..case("a range that ends on it", square(5.0, 1.0), &[AHEAD], &[(5.0, 0)])
        },
        Case {
            range: 4.9999,
            ..case("a range that ends before it", square(5.0, 1.0), &[AHEAD], &[(4.9999, NO_HIT)])
        },
        case(
            "a sliver, above and below",
            sliver,
            &[[5.0, 0.9, 1e-3], [5.0, 0.9, -1e-3]],
            &[none, none],
        ),
        case("no area", flat, &[AHEAD, [5.0, 0.5, 0.0]], &[none, none]),
        case("a single point", point, &[AHEAD], &[none]),
        case(
            "no area before a square",
            [vec![[[3.0, 0.0, 0.0]; 3]], square(5.0, 1.0)].concat(),
            &[AHEAD],
            &[(5.0, 1)],
        ),
        Case {
            sensor: [0.0, 0.0, 2.5],
            ..case("straight down on a floor", floor.clone(), &[down], &[(2.5, 0)])
        },
        Case {
            sensor: [0.0, 0.0, -2.5],
            ..case(
                "from below the floor",
                floor.clone(),
                &[down, [0.0, 0.0, 1.0]],
                &[none, (2.5, 0)],
            )
        },
        Case {
            sensor: [0.0, 0.0, 9999.0],
            range: 1e4,
            ..case("from far above", floor, &[down], &[(9999.0, 0)])
        },
        case("a hundredth of the size", scaled(square(5.0, 1.0), 0.01), &[AHEAD], &[(0.05, 0)]),
        Case {
            range: 1e4,
            ..case(
                "a thousand times the size",
                scaled(square(5.0, 1.0), 1e3),
                &[AHEAD],
                &[(5000.0, 0)],
            )
        },
    ]
}

fn problem(case: &Case) -> Arc<Problem> {
    let mut soup = TriangleSoup::default();
    for (face, corners) in case.triangles.iter().enumerate() {
        soup.vertices.extend(corners);
        let first = 3 * face as u32;
        soup.faces.push([first, first + 1, first + 2]);
        soup.face_class.push(face as u16);
    }
    // Faces of voxels on whole metres, the sensor mostly on their corners.
    let roi = Roi::new([-8.0, -4.0, -4.0], [1.0; 3], [16, 8, 8]).unwrap();
    let directions = case.directions.iter().map(|&d| d.into());
    let table = BeamTable::from_directions(directions, case.range).unwrap();
    let bvh = Bvh::build(&soup, case.range as f32);
    bvh.validate().unwrap();
    let content = random_content(1, &roi);
    Arc::new(Problem::from(Task::new(roi, content, table, vec![Arc::new(bvh)], true)))
}

fn placement([x, y, z]: [f64; 3]) -> Placement {
    let pose = SensorPose { x, y, z, ..SensorPose::default() };
    Placement { name: "hostile".into(), lidars: vec![pose] }
}

#[test]
fn hostile_geometry_has_a_stated_result_on_both_backends() {
    for case in cases() {
        let problem = problem(&case);
        let placement = placement(case.sensor);
        let [mut cpu, mut gpu] = both(&problem);
        let hits = cpu.hits(&placement.lidars, 0).unwrap();
        assert_eq!(bits(&hits), bits(&gpu.hits(&placement.lidars, 0).unwrap()), "{}", case.name);
        assert_eq!(hits.len(), case.want.len(), "{}", case.name);
        for (hit, (t, prim)) in hits.iter().zip(&case.want) {
            assert_eq!(hit.prim, *prim, "{}: {hit:?}", case.name);
            assert!((hit.t - t).abs() <= 1e-6 * t, "{}: {hit:?} is not at {t}", case.name);
        }
        let covered = cpu.covered(&placement, 0).unwrap();
        assert_eq!(covered, gpu.covered(&placement, 0).unwrap(), "{}", case.name);
        let placements = [placement];
        let range = case.range as f32;
        let tally = cpu.tally(&placements, Some(range)).unwrap();
        assert_eq!(tally, gpu.tally(&placements, Some(range)).unwrap(), "{}", case.name);
    }
}

/// Regions of odd shapes around a sensor on a voxel corner: both backends cover the same, and a level
/// beam covers exactly the row ahead of it.
#[test]
fn regions_of_odd_shapes_are_covered_alike() {
    let shapes: [([f64; 3], f64, [u32; 3]); 6] = [
        ([0.0, 0.0, 0.0], 1.0, [1, 1, 1]),
        ([-5.0, -5.0, 0.0], 1.0, [10, 10, 1]),
        ([-5.0, 0.0, 0.0], 0.5, [20, 1, 1]),
        ([0.0, -5.0, -5.0], 1.0, [1, 10, 10]),
        ([-0.05, -0.05, -0.05], 0.01, [10, 10, 10]),
        ([-5000.0, -5000.0, -50.0], 100.0, [100, 100, 1]),
    ];
    for (min, voxel, shape) in shapes {
        let roi = Roi::new(min, [voxel; 3], shape).unwrap();
        let content = random_content(2, &roi);
        let channels: Vec<(f64, f64)> = (-3..=3).map(|k| (f64::from(k) * 15.0, 0.0)).collect();
        let table = BeamTable::spinning(&channels, 16, 1e4).unwrap();
        let problem = Arc::new(Problem::from(Task::new(roi, content, table, vec![], false)));
        let [mut cpu, mut gpu] = both(&problem);
        for sensor in [[0.0; 3], [min[0], min[1], min[2]], roi.max(), [1e5, 0.0, 0.0]] {
            let placement = placement(sensor);
            let covered = cpu.covered(&placement, 0).unwrap();
            assert_eq!(covered, gpu.covered(&placement, 0).unwrap(), "{shape:?} {sensor:?}");
            if sensor == [0.0; 3] {
                let [_, j, k] = [0, 1, 2].map(|axis| (-min[axis] / voxel).floor() as u32);
                let first = (-min[0] / voxel).floor() as u32;
                for i in first..shape[0] {
                    let voxel = roi.linear([i, j, k]);
                    assert!(covered.binary_search(&voxel).is_ok(), "{shape:?} lacks {i} {j} {k}");
                }
            }
        }
    }
}
