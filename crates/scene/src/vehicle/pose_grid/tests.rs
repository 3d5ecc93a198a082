//! Tests of grids of sensor poses.

use super::*;

fn constraints() -> Constraints {
    Constraints {
        min_distance: 0.2,
        ..Constraints::in_box([-0.6, -0.6, 2.2, -0.3, 0.0, 0.0], [0.6, 0.6, 2.8, 0.3, 0.0, 0.0], 4)
    }
}

#[test]
fn table_7_lies_on_the_grid_of_the_paper() {
    let grid = PoseGrid::new(&constraints(), Spacing { metres: 0.1, radians: 0.1 }).unwrap();
    assert_eq!(grid.len(), 13 * 13 * 7 * 7);
    let pose = SensorPose { roll: 0.1, ..SensorPose::at(-0.4, 0.3, 2.7) };
    assert_eq!(grid.pose(grid.nearest(0, &pose)), pose, "to the bit");
    for number in (0..grid.len()).step_by(97) {
        assert_eq!(grid.nearest(0, &grid.pose(number)), number);
    }
    let corner = grid.along(0, 1);
    assert_eq!(corner.len(), 5, "itself, and one step along each of four free fields");
    assert!(corner.is_sorted() && corner[0] == 0);
    let number = grid.nearest(0, &pose);
    // Two steps down and one up along z, four ways along the other free fields, and itself.
    assert_eq!(grid.along(number, 2).len(), 4 + 4 + 3 + 4 + 1);
}

#[test]
fn some_poses_are_spread_over_every_field() {
    let grid = PoseGrid::new(&constraints(), Spacing { metres: 0.1, radians: 0.1 }).unwrap();
    assert_eq!(grid.spread(8281), (0..8281).collect::<Vec<u32>>(), "all where there are no more");
    let some = grid.spread(810);
    assert_eq!(some.len(), 810);
    assert!(some.is_sorted() && some.windows(2).all(|two| two[0] < two[1]));
    let value = |number: u32| {
        let SensorPose { x, y, z, roll, .. } = grid.pose(number);
        [x, y, z, roll].map(|value| (value * 10.0).round() as i64)
    };
    for (field, levels) in [13, 13, 7, 7].into_iter().enumerate() {
        let mut poses_at = std::collections::BTreeMap::new();
        some.iter().for_each(|&pose| *poses_at.entry(value(pose)[field]).or_insert(0) += 1);
        assert_eq!(poses_at.len(), levels, "every value of field {field} occurs");
        let (least, most) = (poses_at.values().min().unwrap(), poses_at.values().max().unwrap());
        assert!(10 * most <= 13 * least, "field {field}: {least} to {most} poses a value");
    }
    let pairs: BTreeSet<_> = some.iter().map(|&pose| [value(pose)[2], value(pose)[3]]).collect();
    assert_eq!(pairs.len(), 7 * 7, "every height occurs with every roll");
}

#[test]
fn a_spacing_that_makes_no_grid_is_refused() {
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let spacing = Spacing { metres: 0.1, radians: bad };
        let error = PoseGrid::new(&constraints(), spacing).unwrap_err().to_string();
        assert!(error.contains("rad"), "{error}");
    }
    let fine = Spacing { metres: 1e-4, radians: 1e-3 };
    let error = PoseGrid::new(&constraints(), fine).unwrap_err();
    assert!(matches!(error, PoseGridError::TooManyPoses { .. }));
    for metres in [1e-40, f64::MIN_POSITIVE] {
        let none = Spacing { metres, radians: metres };
        let error = PoseGrid::new(&constraints(), none).unwrap_err();
        assert!(matches!(error, PoseGridError::TooManyPoses { .. }));
    }
    let wide = Spacing { metres: 9.0, radians: 9.0 };
    assert_eq!(PoseGrid::new(&constraints(), wide).unwrap().len(), 1, "the lower corner");
}

#[test]
fn a_grid_with_both_ends_has_them_whatever_the_spacing() {
    let Region { lower, upper, .. } = &*constraints().slots[0].region;
    for (spacing, poses) in [(9.0, 2 * 2 * 2 * 2), (0.4, 4 * 4 * 2 * 2), (0.1, 13 * 13 * 7 * 7)] {
        let spacing = Spacing { metres: spacing, radians: spacing };
        let grid = PoseGrid::with_both_ends(&constraints(), spacing).unwrap();
        assert_eq!(grid.len(), poses, "{spacing:?}");
        let ends = [grid.pose(0), grid.pose(poses - 1)].map(|pose| pose.values());
        assert_eq!(ends, [*lower, *upper]);
    }
    // In pairs: the plane of symmetry, and both sides of it.
    let mut tied = constraints();
    tied.ties.symmetric = true;
    let grid = PoseGrid::with_both_ends(&tied, Spacing { metres: 9.0, radians: 9.0 }).unwrap();
    assert_eq!(grid.len(), 2 * 3 * 2 * 3);
    let image = grid.pose(grid.mirrored(0));
    assert_eq!([image.y, image.roll, image.x], [0.6, 0.3, -0.6]);
}
