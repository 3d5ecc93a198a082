//! What the paper measured downstream, to compare rankings with.

/// Placement, mean mIoU of four segmentation models, mean car mAP and mean pedestrian mAP of four
/// detectors, in per cent: Place3D, NeurIPS 2024. "Ours" is Ours-seg for segmentation and Ours-det for
/// detection.
pub const PUBLISHED: [(&str, f64, f64, f64); 8] = [
    ("Center", 69.1, 52.5, 26.9),
    ("Line", 63.9, 49.7, 28.9),
    ("Pyramid", 66.6, 52.2, 28.2),
    ("Square", 65.8, 50.0, 28.4),
    ("Trapezoid", 63.8, 50.9, 29.3),
    ("Line-roll", 64.0, 51.0, 28.3),
    ("Pyramid-roll", 67.6, 52.1, 28.2),
    ("Ours", 71.1, 53.4, 30.0),
];

/// Tasks of [`PUBLISHED`], each with its column and the placement that "Ours" stands for.
pub const TASKS: [(&str, usize, &str); 3] =
    [("mIoU", 0, "Ours-seg"), ("car mAP", 1, "Ours-det"), ("pedestrian mAP", 2, "Ours-det")];

/// Results of one task by placement, "Ours" under its name in Table 7.
pub fn results_of(task: usize) -> Vec<(&'static str, f64)> {
    let (_, column, ours) = TASKS[task];
    PUBLISHED
        .iter()
        .map(|&(name, seg, car, pedestrian)| {
            (if name == "Ours" { ours } else { name }, [seg, car, pedestrian][column])
        })
        .collect()
}
