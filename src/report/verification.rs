//! A verification as text.

use super::text::align_columns;
use crate::scan::conditions::under;
use crate::verify::Verification;

/// Differences of a GPU from the CPU reference, and of that from `f64`, a line each.
pub fn verification_text(scene: &str, conditions: &[String], found: &Verification) -> String {
    let lines = |rows: &[(&str, String)]| {
        let row = |(name, value): &(&str, String)| vec![format!("  {name}"), value.clone()];
        align_columns(&rows.iter().map(row).collect::<Vec<_>>())
    };
    let (gpu, reference) = (&found.gpu_against_cpu, &found.cpu_against_f64);
    let mut text = format!(
        "{scene}: {} placements × {} frame(s){}\nGPU ({}) against the CPU reference:\n",
        found.placements,
        found.frames,
        under(conditions),
        found.adapter
    );
    text += &lines(&[
        ("beams", gpu.beams.to_string()),
        ("differing triangle ids", gpu.triangles.to_string()),
        ("differing distances", gpu.distances.to_string()),
        ("largest distance between answers, m", gpu.largest_distance.to_string()),
        ("covered voxels", gpu.voxels.to_string()),
        ("differing voxels", gpu.differing_voxels.to_string()),
        ("scores", gpu.scores.to_string()),
        ("differing scores", gpu.differing_scores.to_string()),
    ]);
    for cause in &found.causes {
        text += &format!("  cause: {cause}\n");
    }
    text += "CPU reference against all triangles in f64:\n";
    let grazing = format!("differing, grazing (an edge within {} m)", found.edge_tolerance);
    text += &lines(&[
        ("beams", reference.beams.to_string()),
        (&grazing, reference.grazing.to_string()),
        ("differing, tie", reference.tie.to_string()),
        ("differing, unexplained", reference.unexplained.to_string()),
    ]);
    text + if found.passed { "passed\n" } else { "FAILED\n" }
}
