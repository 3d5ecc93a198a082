//! The tables of `score` and of the studies as rows for CSV: titles with units first, numbers in full precision, a row
//! for each thing that was measured.

use super::SceneRecord;
use super::study::lost;
use crate::csv::{csv, number};
use crate::job::{Room, RoomOfSide, Sweep, Tolerance};
use crate::json::{distinct, fixed};
use crate::near_field::{NearField, Standard};
use crate::score::{Guard, HOLDS, NEAR_GAINS, Scores, Seen, percent_down};
use crate::search::Scored;
use crate::shared::{Overlap, Redundancy, SeenBy, SeenByTechnologies};
use crate::study::{REQUIREMENTS, Table, cells_of_losses, titles_of_losses};
use crate::targets::{TargetRow, TargetTable};

/// Between the parts of a cell that holds several.
const BETWEEN: &str = "; ";

pub(crate) type Cells = Vec<String>;

pub(super) fn titles(words: &[&str]) -> Cells {
    words.iter().map(|word| (*word).to_owned()).collect()
}

/// Titles in their order, as a file has them: between commas.
pub(super) fn header(keys: &str) -> Cells {
    keys.split(',').map(str::to_owned).collect()
}

pub(super) fn joined(parts: impl IntoIterator<Item = impl ToString>) -> String {
    parts.into_iter().map(|part| part.to_string()).collect::<Vec<_>>().join(BETWEEN)
}

/// Titles of [`score_rows`] with the same prices.
pub(crate) fn score_titles(prices: &[f64]) -> Cells {
    let mut row: Cells = COLUMNS.iter().map(|(_, key, ..)| (*key).to_owned()).collect();
    row.extend(header(
        "near_ring_share,requirements_met,requirements,requirements_hold_in_share,warnings,broken_rules",
    ));
    row.extend((!prices.is_empty()).then(|| "price".to_owned()));
    row
}

/// A row a placement: every score, whether all requirements are met, each with the share seen and the share required.
/// Then come the share of copies within the mounting tolerance that meet all, the guards and the broken rules in words,
/// and the price. `prices` has one for each placement, or none where no sensor has one.
pub(crate) fn score_rows<'a>(
    all: impl IntoIterator<Item = &'a Scores, IntoIter: 'a>,
    prices: &[f64],
) -> Vec<Cells> {
    let row = |(k, scores): (usize, &Scores)| {
        let mut row: Cells = COLUMNS.iter().map(|(column, ..)| column.plain_cell(scores)).collect();
        let required = &scores.required;
        let met = (!required.is_empty()).then(|| required.iter().all(Seen::is_met).to_string());
        let seen = required.iter().map(|seen| {
            let intact = seen.lost.as_ref().map(|lost| format!(", intact {}", lost.intact));
            let worst = seen.worst_frame.map(|of| format!(", {} in frame {}", of.share, of.frame));
            let more = intact.into_iter().chain(worst).collect::<String>();
            format!("{}: {} of {}{more}", seen.name, seen.share, seen.least)
        });
        row.extend([number(scores.near_ring), met.unwrap_or_default()]);
        row.extend([joined(seen), number(scores.requirements_hold_in)]);
        let guards = joined(scores.guards.iter().map(Guard::keyed));
        row.extend([guards, joined(&scores.broken_rules)]);
        row.extend(prices.get(k).map(|price| number(*price)));
        row
    };
    all.into_iter().enumerate().map(row).collect()
}

/// A row a placement: shares, blind ground, depth of the blind zone, poles seen of all by standard, share of each LiDAR's
/// beams on the own body, ground lost again by side. Last come the frames of the deepest lanes by side, where bodies move.
pub(crate) fn near_field_csv(all: &[NearField]) -> String {
    let mut rows = vec![header(
        "placement,near_field_share,ring_3m_share,blind_area_m2,zone_area_m2,blind_ahead_m,blind_behind_m,blind_left_m,\
         blind_right_m",
    )];
    for (_, name) in Standard::ALL {
        let name = name.replace(' ', "_");
        rows[0].extend([format!("{name}_seen"), format!("{name}_poles")]);
    }
    rows[0].extend(header("own_body_share_by_lidar,lost_again,worst_frames"));
    rows.extend(all.iter().map(|near| {
        let zone = &near.zone;
        let mut row = vec![near.name.clone(), number(near.near_field), number(near.ring)];
        row.extend([near.blind_area, zone.area].map(number));
        // A depth that does not end within 10 m is known to be larger: no empty cell.
        let depth = |(_, depth): (_, Option<f64>)| number(depth.unwrap_or(f64::INFINITY));
        row.extend(zone.depths().map(depth));
        for (standard, _) in Standard::ALL {
            row.extend(super::coverage::seen_of(near, standard).map(|count| count.to_string()));
        }
        row.push(joined(near.beams.iter().map(|beams| beams.own)));
        row.push(joined(zone.lost.iter().map(|lost| format!("{} {}", lost.side, lost.in_words()))));
        row.push(joined(zone.worst_frames.iter().map(|(side, frame)| format!("{side} {frame}"))));
        row
    }));
    csv(rows)
}

/// Beams on targets, a row for each place and frame: all beams, beams of each LiDAR, and at the bearing the farthest
/// distance of detection and every run of distances.
pub(crate) fn targets_csv(table: &TargetTable) -> String {
    let first = header(
        "scene,frame,placement,target,bearing_deg,distance_m,beams,beams_by_lidar,overlaps_body,first_m,detected_m",
    );
    // Both are by scene, placement, target and bearing.
    let key =
        |of: &TargetRow| (of.scene.clone(), of.placement.clone(), of.target.clone(), of.bearing);
    let of_bearings = table.rows.chunk_by(|a, b| key(a) == key(b)).zip(&table.detections);
    let rows = of_bearings.flat_map(|(rows, found)| rows.iter().map(move |row| (row, found)));
    let rows = rows.map(|(of, found)| {
        let frame = of.frame.map_or_else(String::new, |frame| frame.to_string());
        let mut row = vec![of.scene.clone().unwrap_or_default(), frame, of.placement.clone()];
        row.extend([of.target.clone(), number(of.bearing), number(of.distance)]);
        row.extend([
            number(of.beams.map(f64::from)),
            joined(&of.by_lidar),
            of.overlaps.to_string(),
        ]);
        let runs = found.detected.iter().map(|[from, to]| format!("{from} to {to}"));
        row.extend([number(found.first), joined(runs)]);
        row
    });
    csv(std::iter::once(first).chain(rows))
}

/// A row a thing: how many there are, and the shares that no, one, two, three and more LiDARs see; further columns by
/// technology where a vehicle has several.
pub(crate) fn redundancy_csv(all: &[&Redundancy]) -> String {
    let has_technologies = all.iter().any(|of| of.technologies.is_some());
    let mut rows = vec![header(
        "scene,placement,thing,count,seen_by_0_share,seen_by_1_share,seen_by_2_share,seen_by_3_or_more_share,\
         one_model_alone_share",
    )];
    if has_technologies {
        rows[0].extend(header(
            "blind_to_all_share,seen_by_1_technology_share,seen_by_2_technologies_share,\
             seen_by_3_or_more_technologies_share,technology_share",
        ));
    }
    for of in all {
        let mut add = |thing: &str, seen: &SeenBy, technologies: Option<&SeenByTechnologies>| {
            let mut row = titles(&[&of.scene, &of.placement, thing]);
            row.push(number(seen.all));
            row.extend(shares(seen));
            let alone =
                seen.alone.iter().map(|one| format!("{}: {}", one.sensor, number(one.share)));
            row.push(joined(alone));
            if has_technologies {
                row.extend(technology_cells(technologies));
            }
            rows.push(row);
        };
        let by = of.technologies.as_ref();
        add("voxels occupied", &of.occupied, by.map(|by| &by.occupied));
        add("voxels", &of.voxels, None);
        let [near, ring] = [by.map(|by| &by.ground_10m), by.map(|by| &by.ground_3m)];
        let [near, ring] = [near, ring].map(|ground| ground.and_then(Option::as_ref));
        of.ground_3m.iter().for_each(|seen| add("ground to 3 m", seen, ring));
        of.ground_10m.iter().for_each(|seen| add("ground to 10 m", seen, near));
        for (k, target) in of.targets.iter().enumerate() {
            let technologies = by.and_then(|by| by.targets.get(k)).map(|of| &of.seen);
            add(&target.target, &target.seen, technologies);
        }
    }
    csv(rows)
}

fn shares(seen: &SeenBy) -> [String; 4] {
    std::array::from_fn(|k| number(seen.share.map(|share| share[k])))
}

/// The cells of [`redundancy_csv`] on technologies; empty ones for things that are not looked at.
fn technology_cells(seen: Option<&SeenByTechnologies>) -> [String; 5] {
    let Some(seen) = seen else { return Default::default() };
    let each = seen.each.iter().map(|of| format!("{}: {}", of.technology, number(of.share)));
    let [none, one, two, more] = shares(&seen.number);
    [none, one, two, more, joined(each)]
}

/// A row a pair of LiDARs, and one of each with itself: voxels and directions of the sphere that both see.
pub(crate) fn overlap_csv(all: &[Overlap]) -> String {
    let mut rows = vec![header(
        "scene,placement,lidar,other,model,other_model,shared_voxels,overlap,shared_sphere_share,all_connected",
    )];
    for of in all {
        for a in 0..of.lidars.len() {
            for b in a..of.lidars.len() {
                let mut row = vec![of.scene.clone(), of.placement.clone()];
                row.extend([a, b].map(|k| k.to_string()));
                row.extend([a, b].map(|k| of.lidars[k].to_string()));
                row.extend(
                    [of.shared_voxels[a][b], of.overlap[a][b], of.shared_directions[a][b]]
                        .map(number),
                );
                row.push(of.connected.to_string());
                rows.push(row);
            }
        }
    }
    csv(rows)
}

/// A row a value of the field: scores, width of the sectors in which a car is lost, rules that are broken.
pub(crate) fn sweep_csv(all: &[Sweep]) -> String {
    let mut first = header("lidar,field,value,unit,as_given");
    first.extend(score_titles(&[]));
    first.push("car_lost_deg".to_owned());
    let rows = all.iter().flat_map(|sweep| {
        sweep.rows.iter().map(|at| {
            // The scores have a column for the rules.
            let scores = Scores { broken_rules: at.broken_rules.clone(), ..at.scores.clone() };
            let mut row = vec![sweep.lidar.to_string(), sweep.field.to_owned(), number(at.value)];
            row.extend([sweep.unit.to_owned(), at.as_given.to_string()]);
            row.extend(score_rows([&scores], &[]).concat());
            row.push(number(at.scores.range_card.as_ref().map(|_| lost(&at.scores))));
            row
        })
    });
    csv(std::iter::once(first).chain(rows))
}

/// A row a field of a LiDAR: how far it holds to either side and what breaks; of a placement that misses
/// requirements as it is, a row first that names them: the others leave them out. Last stand the boxes of all fields at once,
/// a row of millimetres and a row of degrees.
pub(crate) fn room_csv(all: &[Room]) -> String {
    let mut rows = vec![header(
        "placement,lidar,field,unit,minus_holds_to,minus_breaks_at,minus_breaks,plus_holds_to,plus_breaks_at,plus_breaks,\
         missed_as_it_is,minus_self_hit_at,plus_self_hit_at",
    )];
    let width = rows[0].len();
    for room in all {
        if room.fields.is_empty() || !room.missed.is_empty() {
            let mut row = vec![String::new(); width];
            row[0].clone_from(&room.placement);
            row[10] = joined(&room.missed);
            rows.push(row);
        }
        rows.extend(room.fields.iter().map(|of| {
            let side = |side: &RoomOfSide| {
                let words = side.breaks.clone().unwrap_or_default();
                [number(side.holds_to), number(side.breaks_at), words]
            };
            let mut row = vec![room.placement.clone(), of.lidar.to_string()];
            row.extend(titles(&[of.field, of.unit]));
            row.extend(side(&of.down).into_iter().chain(side(&of.up)));
            row.push(String::new());
            row.extend([&of.down, &of.up].map(|side| number(side.self_hit_at)));
            row
        }));
        rows.extend(room.tilt.iter().flat_map(|tilt| &tilt.directions).map(|of| {
            let mut row = vec![String::new(); width];
            row[0].clone_from(&room.placement);
            (row[2], row[3]) = (of.direction.to_owned(), "deg".to_owned());
            (row[7], row[8]) = (number(of.side.holds_to), number(of.side.breaks_at));
            row[9] = of.side.breaks.clone().unwrap_or_default();
            row
        }));
        rows.extend(boxes(room).into_iter().flat_map(|(lidar, ends, breaks)| {
            let [within, next] = ends.map(|of| of.map(|of| of.small()));
            ["mm", "deg"].into_iter().enumerate().map(move |(k, unit)| {
                let mut row = vec![String::new(); width];
                row[0].clone_from(&room.placement);
                row[1].clone_from(&lidar);
                (row[2], row[3]) = ("all fields".to_owned(), unit.to_owned());
                let holds = number(within.map_or(0.0, |of| of[k]));
                let side =
                    [holds, number(next.map(|of| of[k])), breaks.clone().unwrap_or_default()];
                row[4..7].clone_from_slice(&side);
                row[7..10].clone_from_slice(&side);
                row
            })
        }));
    }
    csv(rows)
}

/// Boxes of a placement within which enough copies meet all: all LiDARs off together, as `all`, and each alone, by number. Each
/// has the largest tolerance that holds, the next, and the requirement that breaks first there.
fn boxes(room: &Room) -> Vec<(String, [Option<Tolerance>; 2], Option<String>)> {
    let holds = room.copies.iter().take_while(|of| of.holds_in >= HOLDS).count();
    let within = holds.checked_sub(1).map(|last| room.copies[last].tolerance);
    let next = room.copies.get(holds);
    let all = (!room.copies.is_empty()).then(|| {
        let breaks = next.and_then(|of| of.breaks.clone());
        ("all".to_owned(), [within, next.map(|of| of.tolerance)], breaks)
    });
    let alone = room
        .alone
        .iter()
        .map(|of| (of.lidar.to_string(), [of.holds_within, of.breaks_within], of.breaks.clone()));
    all.into_iter().chain(alone).collect()
}

/// A study's cases; of several tables all, each row with the title of its own, the columns of all beside each other.
pub(crate) fn studies_csv(tables: &[&Table]) -> String {
    if let [table] = tables {
        return table.csv();
    }
    let columns: Vec<&String> = distinct(tables.iter().flat_map(|table| &table.columns[1..]));
    let case = tables.first().map_or("case", |table| &*table.columns[0]);
    let mut rows = vec![titles(&["table", case])];
    rows[0].extend(columns.iter().map(|column| (*column).clone()));
    let requires = tables.iter().any(|table| table.has_requirements());
    rows[0].extend(requires.then(|| titles(&REQUIREMENTS)).into_iter().flatten());
    let of_losses = titles_of_losses(tables.iter().flat_map(|table| &table.rows));
    rows[0].extend(of_losses.iter().cloned());
    for table in tables {
        rows.extend(table.rows.iter().map(|row| {
            let value = |column: &&String| {
                let place = table.columns[1..].iter().position(|of| of == *column);
                place.map_or_else(String::new, |place| number(row.values[place]))
            };
            let start = [table.title.clone(), row.name.clone()];
            let last = requires.then(|| row.requirements()).into_iter().flatten();
            let after_loss = cells_of_losses(row, &of_losses);
            let values = columns.iter().map(value);
            start.into_iter().chain(values).chain(last).chain(after_loss).collect()
        }));
    }
    csv(rows)
}

/// A score as it is shown to people: title and cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ScoreColumn {
    Name,
    Gain,
    GainShare,
    NearGain,
    NearGain2,
    NearGain3,
    NearField,
    MSog,
    MSogScaled,
    Detection,
    SMig,
    Covered,
    Hits,
}

/// Reads a score; `None` where it does not exist.
type ScoreGetter = fn(&Scores) -> Option<f64>;

/// Every column, in the order in which they are declared: title in CSV with its unit last, title for people, factor and
/// decimals of their cell, and the score, which the name has none of.
const COLUMNS: [(ScoreColumn, &str, &str, f64, usize, ScoreGetter); 13] = {
    use ScoreColumn as Of;
    [
        (Of::Name, "placement", "placement", 1.0, 0, |_| None),
        (Of::Gain, "information_gain_nats", "gain nats", 1.0, 0, |s| {
            s.segmentation.information_gain
        }),
        (Of::GainShare, "information_gain_share", "gain %", 100.0, 2, |s| {
            s.segmentation.information_gain_share
        }),
        (Of::NearGain, "near_gain_share", "near gain %", 100.0, 2, |s| s.near_gain),
        (Of::NearGain2, "near_gain_2_share", "near gain ×2 %", 100.0, 2, |s| s.near_gain_2),
        (Of::NearGain3, "near_gain_3_share", "near gain ×3 %", 100.0, 2, |s| s.near_gain_3),
        (Of::NearField, "near_field_share", "near field %", 100.0, 1, |s| s.near_field),
        (Of::MSog, "m_sog", "M-SOG", 1.0, 4, |s| s.segmentation.m_sog),
        (Of::MSogScaled, "m_sog_scaled", "M-SOG/N ×1e-6", 1e6, 3, |s| s.segmentation.m_sog_scaled),
        (Of::Detection, "detection_m_sog_scaled", "det ×1e-6", 1e6, 3, |s| {
            s.detection?.m_sog_scaled
        }),
        (Of::SMig, "s_mig_nats", "S-MIG", 1.0, 0, |s| s.s_mig),
        (Of::Covered, "covered_voxels", "covered", 1.0, 0, |s| Some(s.covered)),
        (Of::Hits, "hit_share", "hits %", 100.0, 1, |s| s.hit_share),
    ]
};

/// A column is found by its number.
const _: () = {
    let mut number = 0;
    while number < COLUMNS.len() {
        assert!(COLUMNS[number].0 as usize == number);
        number += 1;
    }
};

impl ScoreColumn {
    /// The columns that an objective can name.
    pub(crate) const METRICS: [Self; 6] =
        [Self::Gain, Self::NearGain, Self::MSog, Self::MSogScaled, Self::Detection, Self::SMig];

    /// Columns to show of some scores: all, the near field only where it was looked for, and near gains of several LiDARs
    /// only where an objective names them.
    pub(crate) fn shown<'a>(
        all: impl IntoIterator<Item = &'a Scores>,
        objective: &str,
    ) -> Vec<Self> {
        let looked = all.into_iter().any(|scores| scores.near_field.is_some());
        let is_shown = |column: &Self| match column {
            Self::NearField => looked,
            Self::NearGain2 => objective.contains(NEAR_GAINS[1]),
            Self::NearGain3 => objective.contains(NEAR_GAINS[2]),
            _ => true,
        };
        COLUMNS.iter().map(|(column, ..)| *column).filter(is_shown).collect()
    }

    /// Share that results are compared by where an objective was maximized: each near gain for itself, else the gain.
    pub(crate) fn argued(objective: &str) -> Self {
        let of = [Self::NearGain, Self::NearGain2, Self::NearGain3];
        let named = NEAR_GAINS.iter().position(|name| *name == objective);
        named.map_or(Self::GainShare, |named| of[named])
    }

    pub(crate) fn title(self) -> &'static str {
        COLUMNS[self as usize].2
    }

    /// The score; `None` for the name, and where the score does not exist.
    pub(crate) fn value(self, scores: &Scores) -> Option<f64> {
        COLUMNS[self as usize].5(scores)
    }

    /// The cell of a placement in CSV: full precision, no percent; empty where the score does not exist.
    fn plain_cell(self, scores: &Scores) -> String {
        match self {
            Self::Name => scores.name.clone(),
            _ => number(self.value(scores)),
        }
    }

    /// The cell of a placement; – where the score does not exist.
    pub(crate) fn cell(self, scores: &Scores) -> String {
        let (.., factor, decimals, _) = COLUMNS[self as usize];
        match self {
            Self::Name => scores.name.clone(),
            Self::NearField => optional(self.value(scores).map(percent_down), decimals),
            _ => optional(self.value(scores).map(|value| value * factor), decimals),
        }
    }
}

/// A number, or – where there is none.
pub(crate) fn optional(value: Option<f64>, decimals: usize) -> String {
    value.map_or("–".into(), |v| fixed(v, decimals))
}

/// A row of titles, then a row a placement: its name, its gain, or near gain where that was maximized, in per cent over
/// all scenes and in each; `None` where there is one scene.
pub(crate) fn rows_by_scene(
    scenes: &[SceneRecord],
    best: Option<&Scored>,
    baselines: &[Scored],
    objective: &str,
) -> Option<Vec<Vec<String>>> {
    if scenes.is_empty() {
        return None;
    }
    let column = ScoreColumn::argued(objective);
    let names = scenes.iter().map(|scene| scene.name.clone());
    let titles = [column.title(), "all"].map(str::to_owned).into_iter().chain(names);
    let row = |scored: &Scored| {
        let each = scored.by_scene.iter().map(|scene| &scene.scores);
        let cells = std::iter::once(&scored.scores).chain(each);
        let cells = cells.map(|scores| column.cell(scores));
        std::iter::once(scored.placement.name.clone()).chain(cells).collect()
    };
    let rows = best.into_iter().chain(baselines).map(row);
    Some(std::iter::once(titles.collect()).chain(rows).collect())
}
