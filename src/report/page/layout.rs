//! The placement: its drawing, its poses, and the gain of each LiDAR.

use maud::{Markup, html};

use super::figures::Figures;
use super::parts::{bar, figure, table, text};
use super::subject::Subject;
use crate::json::fixed;
use crate::report::RunRecord;
use crate::report::text::{mount_text, phase_text};
use crate::vehicle::millimetres;

/// Titles of poses in small units.
const SMALL: [&str; 7] = ["LiDAR", "x mm", "y mm", "z mm", "roll °", "pitch °", "yaw °"];

/// Poses of the result, and for each LiDAR its gain alone and the gain that only it has.
pub(super) fn layout(subject: &Subject<'_>, figures: &Figures, run: Option<&RunRecord>) -> Markup {
    let Some(best) = subject.result else { return html! {} };
    let poses = &best.placement.lidars;
    let named = poses.iter().any(|pose| !pose.sensor.is_none());
    let mut titles = vec!["LiDAR", "x m", "y m", "z m", "roll rad", "pitch rad", "yaw rad"];
    let mounts = &figures.mounts;
    titles.extend((!mounts.is_empty()).then_some("mount"));
    titles.extend(named.then_some("sensor"));
    let phased = poses.iter().any(|pose| pose.phase.is_some());
    titles.extend(phased.then_some("phase rad"));
    let rows: Vec<_> = (0..poses.len())
        .map(|index| {
            let mut row = vec![text(index.to_string())];
            row.extend(poses[index].fields().map(|(_, value)| text(fixed(value, 3))));
            row.extend((!mounts.is_empty()).then(|| text(mount_text(mounts, index))));
            row.extend(named.then(|| text(poses[index].sensor.to_string())));
            row.extend(phased.then(|| text(phase_text(&poses[index]))));
            (false, row)
        })
        .collect();
    let small = poses.iter().enumerate().map(|(index, pose)| {
        let numbers = millimetres(pose).map(|(_, value)| text(value.to_string()));
        (false, std::iter::once(text(index.to_string())).chain(numbers).collect())
    });
    let small: Vec<_> = small.collect();
    let active = run.map_or(&[][..], |run| &run.active_bounds);
    html! {
        section aria-labelledby="placement" {
            h2 #placement { "The placement" }
            @if let Some(svg) = &figures.placement { (figure(svg, "The placement on the vehicle")) }
            (table("Poses in the vehicle's frame: x forward, y left, z up", &titles, &rows))
            (table("In millimetres and degrees", &SMALL, &small))
            @if !active.is_empty() {
                p { "On a bound or a rule of the mount: " (active.join("; ")) "." }
            }
            (each_lidar(subject, figures))
        }
    }
}

/// Gain of each LiDAR alone, and the loss without it.
fn each_lidar(subject: &Subject<'_>, figures: &Figures) -> Markup {
    let unique = subject.result.map_or(&[][..], |best| &best.scores.unique_share);
    let gains = figures.views.first().map(|view| view.gains());
    let whole = gains.map_or(0.0, |gains| gains.gained()).max(f64::MIN_POSITIVE);
    let rows = unique.iter().enumerate().map(|(index, only)| {
        let alone = gains.and_then(|gains| gains.alone.get(index)).map(|nats| nats / whole);
        let mut row = vec![text(index.to_string())];
        row.push(text(alone.map_or("–".into(), |share| format!("{:.1}", 100.0 * share))));
        row.push(text(format!("{:.1}", 100.0 * only)));
        row.push(bar(alone.unwrap_or(0.0), Some(*only)));
        (false, row)
    });
    let rows: Vec<_> = rows.collect();
    html! {
        h3 { "What each LiDAR gives" }
        (table(
            "Per cent of the placement's gain that a LiDAR reaches alone, and that only it reaches",
            &["LiDAR", "alone %", "only it %", ""],
            &rows,
        ))
        p.small {
            "Bar: alone"
            @if figures.views.len() > 1 { ", in the first scene" }
            "; mark: only it, which is lost with that LiDAR."
        }
    }
}
