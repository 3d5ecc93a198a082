//! The result of a run as text: words first, then the table.

use std::path::Path;

use super::by_scene::by_scene;
use super::record::RunRecord;
use super::targets::range_card_text;
use super::text::{align_columns, findings_text, poses_text, scores_text_by};
use super::words::{
    broken_in_words, certificate_in_words, methods_in_words, spread_in_words, verdict,
};
use crate::scan::conditions::under;
use crate::search::Scored;

/// Result of a run and its folder as text: words first, then the table.
pub fn record_text(record: &RunRecord, folder: &Path) -> String {
    let mut text = String::new();
    let mut rows: Vec<_> = record.best.iter().map(|best| best.scores.clone()).collect();
    rows.extend(record.baselines.iter().map(|baseline| baseline.scores.clone()));
    text += &format!("{}\n\n", verdict(record.best.as_ref(), &record.baselines, &record.objective));
    if let Some(words) = spread_in_words(record) {
        text += &format!("{words}\n\n");
    }
    text += &format!(
        "{}: maximizing {} over {} frame(s){}\n",
        record.scene,
        record.objective,
        record.frames,
        under(&record.conditions)
    );
    text += &scores_text_by(&rows, &record.objective);
    // Guards stand in the table.
    let broken = broken_in_words(&record.baselines);
    if !broken.is_empty() {
        text +=
            "\nbaselines that break rules of the mount, with which the result is not compared:\n";
        broken.iter().for_each(|line| text += &format!("  {line}\n"));
    }
    if let Some(rows) = by_scene(record) {
        text += "\nscene by scene\n";
        text += &align_columns(&rows);
    }
    if let Some(words) = &record.equipment {
        text += &format!("\nequipment: {words}\n");
    }
    text += &match &record.best {
        Some(best) => best_text(best, record),
        None => {
            let objective = &record.objective;
            format!(
                "\nno candidate both kept the rules of the mount and had a value of {objective}\n"
            )
        }
    };
    if let Some(frames) = &record.fidelity {
        text += &format!("\n{}\n", frames.words);
    }
    text + &format!(
        "\nstopped: {}, after {} evaluations in {:.1} s ({:.1} placements × frames/s on {}); report: \
         {}\n",
        record.stopped,
        record.evaluations,
        record.timings.total,
        record.rate,
        record.backend,
        folder.join("report.html").display()
    )
}

/// Poses, range card, requirements and certificate of the placement found.
fn best_text(best: &Scored, record: &RunRecord) -> String {
    let mut text = String::new();
    text += "\noptimized placement (m, rad):\n";
    text += &poses_text(&best.placement, &record.mounts);
    if let Some(card) = &best.scores.range_card {
        text += &format!("\n{}\n", range_card_text(card));
    }
    if let Some(phases) = &record.phases {
        text += &format!("\n{}\n", phases.words);
    }
    for seen in &best.scores.required {
        text += &format!("  requirement: {seen}\n");
    }
    if let Some(words) = best.scores.holds_in_words() {
        text += &format!("  {words}\n");
    }
    for bound in &record.active_bounds {
        text += &format!("  active: {bound}\n");
    }
    if !record.constraints.is_empty() {
        text += &format!("\nrules kept: {}\n", record.constraints.join("; "));
    }
    text += &format!("\nfound by: {}\n", methods_in_words(record));
    text += &format!("certificate: {}\n", certificate_in_words(record));
    text += &format!("\n{}\n", findings_text(&record.findings));
    text
}
