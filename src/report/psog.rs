//! Facts of a P-SOG as text.

use super::text::align_columns;
use crate::psog::PsogInfo;

/// Its facts, a line each, and the part of each class in the entropy.
pub fn psog_text(info: &PsogInfo) -> String {
    format!("{}\n{}", facts(info), classes(info))
}

/// One fact a line: its name, its value and its meaning.
fn facts(info: &PsogInfo) -> String {
    let [x, y, z] = [0, 1, 2].map(|k| format!("{} to {}", info.min[k], info.max[k]));
    let [nx, ny, nz] = info.shape;
    let [dx, dy, dz] = info.voxel;
    let share = |count: u64| 100.0 * count as f64 / info.voxels as f64;
    let nats = |value: f64| format!("{value:.2} nats");
    let mut facts = vec![
        ("region", format!("x {x}, y {y}, z {z} m")),
        ("voxels", format!("{} = {nx} × {ny} × {nz} of {dx} × {dy} × {dz} m", info.voxels)),
        ("frames", info.frames.to_string()),
        (
            "occupied",
            format!(
                "{} voxels ({:.2} %) in at least one frame",
                info.occupied,
                share(info.occupied)
            ),
        ),
        (
            "informative",
            format!(
                "{} voxels ({:.2} %) not the same in all frames",
                info.informative,
                share(info.informative)
            ),
        ),
        ("entropy", format!("{}, every class for itself", nats(info.entropy_segmentation))),
    ];
    if let (Some(entropy), Some(target)) = (info.entropy_detection, &info.detection_target) {
        facts.push(("", format!("{}, {target} or not", nats(entropy))));
    }
    facts.push(("", format!("{}, occupied or not", nats(info.entropy_bernoulli))));
    facts.push(("memory", format!("{:.1} MiB", info.memory_bytes as f64 / f64::from(1 << 20))));
    if let Some(ties) = info.tie_share {
        facts.push((
            "ties",
            format!("{:.2} % of the votes, which went to the lowest class", 100.0 * ties),
        ));
    }
    facts.iter().map(|(name, value)| format!("{name:<12}{value}\n")).collect()
}

/// The part of each class in the entropy.
fn classes(info: &PsogInfo) -> String {
    let mut rows = vec![["class", "voxels", "nats"].map(str::to_owned).to_vec()];
    rows.extend(info.classes.iter().map(|class| {
        vec![class.name.clone(), class.voxels.to_string(), format!("{:.2}", class.entropy)]
    }));
    rows.push(vec!["(empty)".into(), "–".into(), format!("{:.2}", info.entropy_empty)]);
    align_columns(&rows)
}
