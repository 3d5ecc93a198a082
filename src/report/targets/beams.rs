//! Distances of detection of a study as text; where there are few distances, the beams at each.

use super::{bearing_in_words, by_placement, heading, runs_in_words};
use crate::json::{counted, distinct};
use crate::report::columns::align_columns;
use crate::report::svg::trimmed;
use crate::targets::{Detection, TargetRow, TargetTable};

/// Most distances at which beams are shown at each of them, in place of the distances of detection.
const FEW: usize = 4;

/// Rows of a placement, and its detections in their order.
struct OfPlacement<'a> {
    detections: &'a [Detection],
    rows: &'a [TargetRow],
}

/// Words on the frames in which a target must be met: ` in 7 frames or more`; empty where one frame is looked at.
pub(crate) fn in_frames(table: &TargetTable, of_frames: usize) -> String {
    let scenes = table.rows.chunk_by(|a, b| a.scene == b.scene);
    let counts = scenes.map(|rows| distinct(rows.iter().map(|row| row.frame)).len());
    match counts.max() {
        None | Some(0 | 1) => String::new(),
        Some(most) if of_frames >= most => " in every frame".to_owned(),
        _ => format!(" in {} or more", counted(of_frames, "frame")),
    }
}

/// A block a placement: distances of detection, or the beams at each distance where there are at most four. Where a target
/// is not detected at a bearing, how near the best came; `needed` beams in so many frames count. `reach` is the range of the
/// sensors in metres, where distances go to it.
pub(crate) fn targets_text(
    table: &TargetTable,
    needed: (u32, usize),
    reach: Option<f32>,
) -> String {
    let (beams, of_frames) = needed;
    let mut distances: Vec<f64> = table.rows.iter().map(|row| row.distance).collect();
    distances.sort_by(f64::total_cmp);
    distances.dedup();
    // Both lists stand by placement: rows of one placement are neighbours.
    let rows = table.rows.chunk_by(|a, b| (&a.scene, &a.placement) == (&b.scene, &b.placement));
    let of = |(detections, rows): (&&[Detection], &[TargetRow])| {
        let of = OfPlacement { detections, rows };
        let block = match distances.len() <= FEW {
            true => of.beams_at(&distances, beams),
            false => of.distances(needed),
        };
        format!("{}\n{block}", heading(&detections[0]))
    };
    let blocks = by_placement(table).iter().zip(rows).map(of).collect::<Vec<_>>().join("\n");
    let last = distances.last().filter(|_| distances.len() > FEW);
    let ends = |last: &&f64| {
        table.detections.iter().any(|of| of.detected.last().is_some_and(|run| run[1] == **last))
    };
    let to = reach.map_or(String::new(), |range| format!("; the sensors reach {range} m"));
    let ends = last.filter(|last| reach.is_some() || ends(last)).map_or(String::new(), |last| {
        format!("{} m is the farthest distance looked at{to} (--distances).\n", trimmed(*last, 2))
    });
    let within = in_frames(table, of_frames);
    let counts = match !within.is_empty() && distances.len() <= FEW {
        true => format!(
            "fewest–most beams of a frame; a target is detected with {beams} or more{within}\n"
        ),
        false => String::new(),
    };
    blocks + &counts + &ends
}

impl OfPlacement<'_> {
    /// Targets and bearings, each once, in order.
    fn names(&self) -> (Vec<&str>, Vec<f64>) {
        let targets = distinct(self.detections.iter().map(|of| &*of.target));
        (targets, distinct(self.detections.iter().map(|of| of.bearing)))
    }

    fn at<'b>(&'b self, target: &'b str, bearing: f64) -> impl Iterator<Item = &'b TargetRow> {
        let is_there = move |row: &&TargetRow| row.target == target && row.bearing == bearing;
        self.rows.iter().filter(is_there)
    }

    /// A line a bearing, a column a target and distance: its beams, over several frames the fewest and the most.
    fn beams_at(&self, distances: &[f64], beams: u32) -> String {
        let (targets, bearings) = self.names();
        let of_target = |target| distances.iter().map(move |&metres| (target, metres));
        let columns: Vec<(&str, f64)> = targets.into_iter().flat_map(of_target).collect();
        // The targets on a line of their own, the distances below: in wide tables, too, titles are broken alike.
        let mut rows = vec![vec![String::new()], vec![format!("beams, {beams} needed")]];
        rows[0].extend(columns.iter().map(|(target, _)| (*target).to_owned()));
        rows[1].extend(columns.iter().map(|(_, metres)| format!("{} m", trimmed(*metres, 2))));
        for bearing in bearings {
            let mut row = vec![bearing_in_words(bearing)];
            row.extend(columns.iter().map(|(target, metres)| {
                let there = || self.at(target, bearing).filter(|row| row.distance == *metres);
                if there().any(|row| row.overlaps) {
                    return "in the body".to_owned();
                }
                let counts = || there().filter_map(|row| row.beams);
                match (counts().min(), counts().max()) {
                    (Some(least), Some(most)) if least == most => most.to_string(),
                    (Some(least), Some(most)) => format!("{least}–{most}"),
                    _ => "no ground".to_owned(),
                }
            }));
            rows.push(row);
        }
        align_columns(&rows)
    }

    /// A line a bearing, a column a target: distances of detection.
    fn distances(&self, needed: (u32, usize)) -> String {
        let (targets, bearings) = self.names();
        let mut rows = vec![vec!["bearing".to_owned()]];
        rows[0].extend(targets.iter().map(|target| format!("{target} m")));
        for bearing in bearings {
            let mut row = vec![bearing_in_words(bearing)];
            row.extend(targets.iter().map(|target| {
                let mut all = self.detections.iter();
                let of = all.find(|of| of.target == *target && of.bearing == bearing);
                match of.map_or(&[][..], |of| &of.detected) {
                    [] => self.nearest_miss(target, bearing, needed),
                    runs => runs_in_words(runs),
                }
            }));
            rows.push(row);
        }
        align_columns(&rows)
    }

    /// The most beams on a target that is detected nowhere at a bearing, and the first distance that has them; a dash
    /// where no beam meets it. The beams at a distance are as many as the frames needed have, as for a detection: of all
    /// frames the fewest.
    fn nearest_miss(&self, target: &str, bearing: f64, needed: (u32, usize)) -> String {
        let (beams, of_frames) = needed;
        let mut by_frame: Vec<(Vec<u32>, f64)> = Vec::new();
        for row in self.at(target, bearing).filter(|row| !row.overlaps) {
            let Some(beams) = row.beams else { continue };
            match by_frame.iter_mut().find(|(_, distance)| *distance == row.distance) {
                Some((known, _)) => known.push(beams),
                None => by_frame.push((vec![beams], row.distance)),
            }
        }
        let reached = by_frame.into_iter().filter_map(|(mut beams, metres)| {
            beams.sort_unstable_by(|a, b| b.cmp(a));
            let frames = of_frames.clamp(1, beams.len());
            Some((*beams.get(frames - 1)?, metres))
        });
        let more = |best: (u32, f64), at: (u32, f64)| if at.0 > best.0 { at } else { best };
        let best = reached.fold((0, 0.0), more);
        match best {
            (0, _) => "–".to_owned(),
            (most, metres) => format!("– ({most} beams at {}, {beams} needed)", trimmed(metres, 2)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(bearing: f64, distance: f64, beams: Option<u32>, overlaps: bool) -> TargetRow {
        let (scene, placement, target) = (None, "rig".to_owned(), "tyre".to_owned());
        let (frame, by_lidar) = (None, Vec::new());
        TargetRow { scene, placement, target, distance, bearing, frame, beams, by_lidar, overlaps }
    }

    #[test]
    fn few_distances_have_their_beams_and_a_miss_how_near_it_came() {
        let detection = |bearing: f64, detected: &[[f64; 2]]| Detection {
            scene: None,
            placement: "rig".to_owned(),
            target: "tyre".to_owned(),
            bearing,
            first: None,
            detected: detected.to_vec(),
        };
        let mut table = TargetTable {
            rows: vec![
                row(0.0, 5.0, Some(9), true),
                row(0.0, 60.0, Some(4), false),
                row(90.0, 5.0, None, false),
                row(90.0, 60.0, Some(0), false),
            ],
            detections: vec![detection(0.0, &[]), detection(90.0, &[])],
        };
        let lines_in = |table: &TargetTable, of_frames: usize| -> Vec<String> {
            let text = targets_text(table, (5, of_frames), None);
            text.lines().map(|l| l.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
        };
        let lines = |table: &TargetTable| lines_in(table, 2);
        assert_eq!(
            lines(&table),
            [
                "rig",
                "tyre tyre",
                "beams, 5 needed 5 m 60 m",
                "ahead 0° in the body 4",
                "left 90° no ground 0"
            ]
        );
        // Two frames: the table says which numbers it has, and how many frames a detection needs.
        let mut twice = table.clone();
        twice.rows.push(TargetRow { frame: Some(1), ..row(0.0, 60.0, Some(7), false) });
        let last = |of_frames| lines_in(&twice, of_frames).pop();
        let says = "fewest–most beams of a frame; a target is detected with 5 or more";
        assert_eq!(last(1), Some(format!("{says} in 1 frame or more")));
        assert_eq!(last(2), Some(format!("{says} in every frame")));
        assert_eq!(lines(&twice)[3], "ahead 0° in the body 4–7");
        table.rows.extend([10.0, 20.0, 30.0].map(|m| row(0.0, m, Some(3), false)));
        assert_eq!(
            lines(&table),
            ["rig", "bearing tyre m", "ahead 0° – (4 beams at 60, 5 needed)", "left 90° –"]
        );
        // In another frame fewer beams meet the tyre at 60 m.
        table.rows.push(TargetRow { frame: Some(1), ..row(0.0, 60.0, Some(2), false) });
        assert_eq!(lines(&table)[2], "ahead 0° – (3 beams at 10, 5 needed)");
        // One frame is enough.
        assert_eq!(lines_in(&table, 1)[2], "ahead 0° – (4 beams at 60, 5 needed)");
        table.detections[0].detected = vec![[10.0, 30.0]];
        assert_eq!(lines(&table)[2..], ["ahead 0° 10–30", "left 90° –"]);
        let text = targets_text(&table, (5, 2), Some(62.5));
        let words =
            "60 m is the farthest distance looked at; the sensors reach 62.5 m (--distances).";
        assert_eq!(text.lines().last(), Some(words));
        table.detections[0].detected = vec![[10.0, 60.0]];
        assert_eq!(lines(&table)[4], "60 m is the farthest distance looked at (--distances).");
    }
}
