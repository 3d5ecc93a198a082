//! Studies, sweeps and tolerances as text and figures.

use super::columns::{align_columns, table_text};
use super::plot::{Axis, Change, Plot, Series};
use super::svg::trimmed;
use super::tables::ScoreColumn;
use crate::job::{Room, RoomOfCopies, RoomOfLidar, RoomOfSide, RoomOfTilt, Sweep, SweepRow};
use crate::json::fixed;
use crate::score::{Guard, HOLDS, MOST_SELF_HITS, Scores, percent_down, percent_up};
use crate::search::{COPIES, error_of_share};
use crate::study::{Row, Table, TablePlot};
use crate::targets::RangeCard;

pub(crate) fn study_plot(table: &Table) -> Plot {
    let number = |row: &Row, column: usize| row.values[column].unwrap_or(f64::NAN);
    let rows = || table.rows.iter();
    let (x_title, y_title, x, series) = match &table.drawing {
        TablePlot::ByCase { columns, y_title, line } => {
            let points =
                |column| (0..).map(f64::from).zip(rows().map(move |row| number(row, column)));
            let series = columns.iter().map(|&column| Series {
                name: table.columns[column + 1].clone(),
                points: points(column).collect(),
                line: *line,
                ..Series::default()
            });
            let names = Axis::Names(rows().map(Row::marked).collect());
            (&table.columns[0], y_title, names, series.collect())
        }
        TablePlot::ByColumn { columns, x_title, y_title } => {
            let place = |column: &usize| columns.iter().position(|of| of == column);
            let series = rows().map(|row| Series {
                name: row.marked(),
                points: (0..).map(f64::from).zip(columns.iter().map(|&k| number(row, k))).collect(),
                hollow: row.unmet_at.iter().filter_map(place).collect(),
                ..Series::default()
            });
            // The unit stands at the axis.
            let name = |&column: &usize| {
                let name = &table.columns[column + 1];
                name.strip_suffix(" %").unwrap_or(name).to_owned()
            };
            let names = Axis::Names(columns.iter().map(name).collect());
            (x_title, y_title, names, series.collect())
        }
        TablePlot::Against { column, x_title, y_title } => {
            let series = Series {
                name: format!("by {}", table.columns[0]),
                points: rows().map(|row| (number(row, 0), number(row, *column))).collect(),
                labels: rows().map(Row::marked).enumerate().collect(),
                ..Series::default()
            };
            (x_title, y_title, Axis::Numbers, vec![series])
        }
    };
    let has_hollow = rows().any(|row| !row.unmet_at.is_empty());
    let hollow = if has_hollow { " (hollow: a requirement is not met)" } else { "" };
    let [title, x_title] = [&table.title, x_title].map(String::clone);
    Plot { title, x_title, y_title: format!("{y_title}{hollow}"), x, series }
}

const COLUMNS: [ScoreColumn; 3] =
    [ScoreColumn::NearGain, ScoreColumn::GainShare, ScoreColumn::Hits];
/// Scores that are drawn, with their names; requirements are drawn beside them.
const DRAWN: [(ScoreColumn, &str); 2] =
    [(ScoreColumn::NearGain, "near gain"), (ScoreColumn::GainShare, "gain")];
/// Requirements that are drawn at most: more would hide each other.
const MOST_DRAWN: usize = 6;

/// Width of the sectors in which a car is lost, degrees; see [`RangeCard::blind_between`].
pub(super) fn lost(scores: &Scores) -> f64 {
    let of = |guard: &Guard| match guard {
        Guard::BlindSector(sector) => sector.degrees(),
        _ => 0.0,
    };
    // A sum of nothing is −0.
    0.0 + scores.guards.iter().map(of).sum::<f64>()
}

fn head(sweep: &Sweep, k: usize) -> String {
    let row = &sweep.rows[k];
    let given = if row.as_given { " as given" } else { "" };
    format!("{} {}{given}", fixed(row.value, 3), sweep.unit)
}

fn table(sweep: &Sweep) -> String {
    let requirements = sweep.rows.first().map_or(0, |row| row.scores.required.len());
    let mut titles = vec![sweep.field.to_owned()];
    titles.extend(COLUMNS.iter().map(|column| column.title().to_owned()));
    titles.extend((1..=requirements).map(|k| format!("req {k} %")));
    titles.extend(["car lost °", "rules"].map(str::to_owned));
    let mut lines = vec![titles];
    for (k, row) in sweep.rows.iter().enumerate() {
        let mut line = vec![head(sweep, k)];
        line.extend(COLUMNS.iter().map(|column| column.cell(&row.scores)));
        line.extend(row.scores.required.iter().map(|seen| {
            let share = percent_down(seen.share);
            format!("{}{}", if seen.is_met() { "" } else { "!" }, fixed(share, 1))
        }));
        line.push(match row.scores.range_card {
            Some(_) => trimmed(lost(&row.scores), 1),
            None => "–".to_owned(),
        });
        line.push(if row.broken_rules.is_empty() { "kept" } else { "BROKEN" }.to_owned());
        lines.push(line);
    }
    align_columns(&lines)
}

/// Rows of a sweep that have faults, and the faults of the first of them; empty where none has.
fn first_of(sweep: &Sweep, title: &str, faults: impl Fn(&SweepRow) -> Vec<String>) -> String {
    let all: Vec<Vec<String>> = sweep.rows.iter().map(faults).collect();
    let Some(first) = all.iter().position(|faults| !faults.is_empty()) else {
        return String::new();
    };
    let count = all.iter().filter(|faults| !faults.is_empty()).count();
    let faults: String = all[first].iter().map(|fault| format!("  {fault}\n")).collect();
    format!("{title} in {count} of {} rows; at {}:\n{faults}", all.len(), head(sweep, first))
}

/// A table a placement: scores, requirements, width of the sectors in which a car is lost, and rules at each value.
pub(crate) fn sweep_text(all: &[Sweep]) -> String {
    let of = |sweep: &Sweep| {
        let Sweep { placement, lidar, mirrored_lidar, field, .. } = sweep;
        let mirrored = mirrored_lidar.map_or(String::new(), |image| {
            format!("; LiDAR {image}, its mirror image, moves with it, as the vehicle is symmetric")
        });
        let mut text = format!("{placement}: {field} of LiDAR {lidar}{mirrored}\n{}", table(sweep));
        let Some(first) = sweep.rows.first() else { return text };
        for (k, seen) in first.scores.required.iter().enumerate() {
            let least = percent_up(seen.least);
            text += &format!("req {}: {}, {least:.1} % required\n", k + 1, seen.title());
        }
        if sweep.rows.iter().flat_map(|row| &row.scores.required).any(|seen| !seen.is_met()) {
            text += "! = not met\n";
        }
        if let Some(card) = &first.scores.range_card {
            let between = RangeCard::between_in_words(Some(card));
            text += &format!(
                "car lost °: width of the sectors of 30° in which a car is lost somewhere {between}\n"
            );
        }
        text += &first_of(sweep, "rules broken", |row| row.broken_rules.clone());
        text + &first_of(sweep, "a LiDAR looks at the own vehicle", |row| {
            let guards = row.scores.guards.iter();
            guards.filter(|of| matches!(of, Guard::SelfHit { .. })).map(Guard::to_string).collect()
        })
    };
    all.iter().map(of).collect::<Vec<_>>().join("\n")
}

/// Scores and shares of requirements over the values, among them the value as it is given where it lies within.
pub(crate) fn sweep_plot(sweep: &Sweep) -> String {
    let values = || sweep.rows.iter().filter(|row| !row.as_given).map(|row| row.value);
    let [low, high] = [f64::min, f64::max].map(|of| values().reduce(of).unwrap_or_default());
    let given = sweep.rows.iter().find(|row| row.as_given).map(|row| row.value);
    let given = given.filter(|at| (low..=high).contains(at));
    let is_extra = given.is_some_and(|given| values().all(|value| value != given));
    let mut drawn: Vec<_> = sweep.rows.iter().filter(|row| !row.as_given || is_extra).collect();
    drawn.sort_by(|a, b| a.value.total_cmp(&b.value));
    let series = |name: String, of: &dyn Fn(&Scores) -> Option<f64>| {
        let points = drawn.iter().filter_map(|row| Some((row.value, 100.0 * of(&row.scores)?)));
        Series { name, points: points.collect(), line: true, ..Series::default() }
    };
    let scores = DRAWN.map(|(column, name)| series(name.to_owned(), &|of| column.value(of)));
    let required = sweep.rows.first().map_or(&[][..], |row| &row.scores.required[..]);
    let required = required.iter().take(MOST_DRAWN).enumerate().map(|(k, seen)| {
        series(seen.title(), &|scores| scores.required.get(k).map(|seen| seen.share))
    });
    let all = scores.into_iter().chain(required);
    let plot = Plot {
        title: format!("{}: {} of LiDAR {}", sweep.placement, sweep.field, sweep.lidar),
        x_title: format!("{}, {}", sweep.field, sweep.unit),
        y_title: "%".to_owned(),
        x: Axis::Numbers,
        series: all.filter(|series| !series.points.is_empty()).collect(),
    };
    let change = given.map(|at| Change { at, name: "as given".to_owned(), ends_curves: false });
    plot.svg_with(&[], change.as_slice())
}

/// A deviation up to which a side holds; below the first step that was looked at it is not known.
fn holds_to(side: &RoomOfSide, digits: usize) -> String {
    match side.breaks_at {
        Some(at) if side.holds_to == 0.0 => format!("< {}", fixed(at, digits)),
        Some(_) => fixed(side.holds_to, digits),
        None => format!("≥ {}", fixed(side.holds_to, digits)),
    }
}

/// A name, then the deviation of each side with the requirement that breaks beyond it.
fn row<const N: usize>(name: String, sides: [&RoomOfSide; N], digits: usize) -> Vec<String> {
    let cells =
        |side: &RoomOfSide| [holds_to(side, digits), side.breaks.clone().unwrap_or_default()];
    std::iter::once(name).chain(sides.into_iter().flat_map(cells)).collect()
}

/// A sentence on the direction of tilt that holds least, and a table of all.
fn tilt_text(tilt: &RoomOfTilt) -> String {
    let [x, y] = tilt.about;
    let least = &tilt.least;
    let (holds, direction) = (holds_to(&least.side, 2), least.direction);
    let end = match &least.side.breaks {
        Some(breaks) if least.side.holds_to == 0.0 => format!(
            "{holds}°: {breaks} breaks at the first step looked at ({direction}); more --steps look at smaller tilts"
        ),
        Some(breaks) => format!("{holds}°, then {breaks} breaks ({direction})"),
        None => format!("{}° and more in every direction", fixed(least.side.holds_to, 2)),
    };
    let rows = tilt.directions.iter().map(|of| row(of.direction.to_owned(), [&of.side], 2));
    let table = table_text(&["tilt, deg", "holds to", "then breaks"], rows);
    format!("{table}the vehicle tilted about the ground at x = {x} m, y = {y} m holds to {end}\n")
}

/// Sentences on LiDARs that a moved field brings into the own body, or before it.
fn self_hits_text(room: &Room) -> String {
    let sides = room.fields.iter().flat_map(|of| [(of, '−', &of.down), (of, '+', &of.up)]);
    let told = sides.filter_map(|(of, sign, side)| {
        let at = side.self_hit_at.filter(|at| *at > 0.0)?;
        let (at, most) = (fixed(at, if of.unit == "deg" { 2 } else { 1 }), 100.0 * MOST_SELF_HITS);
        let place = format!("{} {sign} {at} {} LiDAR {}", of.field, of.unit, of.lidar);
        Some(format!(
            "! self_hit: at {place} ends more than {most:.0} % of its beams at the own vehicle\n"
        ))
    });
    told.collect()
}

/// Sentences on copies: all LiDARs off together within each tolerance, then each LiDAR alone.
fn copies_text(room: &Room) -> String {
    let all = if room.missed.is_empty() { "all" } else { "all other" };
    let mut text = String::new();
    for copies in &room.copies {
        let [share, error] = [copies.holds_in, copies.error].map(|share| 100.0 * share);
        let first = copies.breaks.iter().map(|name| format!("; {name} breaks first"));
        text += &format!(
            "all LiDARs off together by up to {}: {share:.0} % of {COPIES} copies meet {all} requirements (± {error:.0}, two \
             standard errors){}\n",
            copies.tolerance.in_words(),
            first.collect::<String>()
        );
    }
    // Fewer draws than copies count only where there are few LiDARs.
    let all_drawn = |of: &RoomOfCopies| of.error <= error_of_share(of.holds_in, COPIES) + 1e-9;
    if !room.copies.iter().all(all_drawn) {
        text += &format!(
            "± counts 15 draws a LiDAR, not {COPIES} copies: where areas, ground or overlap are required, copies draw from \
             15 poses of each\n"
        );
    }
    let least = 100.0 * HOLDS;
    for RoomOfLidar { lidar, holds_within, breaks_within, breaks } in &room.alone {
        let smallest = || room.copies.first().map(|copies| copies.tolerance);
        let [fewer, more] =
            if holds_within.is_some() { ["", " or more"] } else { ["fewer than ", ""] };
        let within = holds_within.or_else(smallest).unwrap_or_default().in_words();
        let next = breaks_within.filter(|_| holds_within.is_some());
        let next = next.map(|next| format!("by up to {}, ", next.in_words())).unwrap_or_default();
        let first = breaks.iter().map(|name| format!("; {next}{name} breaks first"));
        let first = first.collect::<String>();
        text += &format!(
            "LiDAR {lidar} alone off in all fields by up to {within}: {fewer}{least:.0} %{more} of {COPIES} copies meet {all} \
             requirements{first}\n"
        );
    }
    text
}

/// Tables of a placement: how far each field holds to either side and what breaks first; the same for the tilt of the
/// body; then copies within tolerances.
pub(crate) fn room_text(all: &[Room]) -> String {
    let of = |room: &Room| {
        let mut text = format!("{}\n", room.placement);
        let guards = room.guards.iter().map(Guard::to_string);
        for told in room.missed.iter().cloned().chain(guards) {
            text += &format!("  ! {told}\n");
        }
        if !room.missed.is_empty() && room.fields.is_empty() {
            return text + "  missed as it is: there is no room\n";
        }
        if !room.missed.is_empty() {
            text += "  missed as it is and left out; below are the requirements that it meets\n";
        }
        let titles = ["LiDAR field", "− holds to", "− then breaks", "+ holds to", "+ then breaks"];
        let rows = room.fields.iter().map(|of| {
            let name = format!("{} {}, {}", of.lidar, of.field, of.unit);
            row(name, [&of.down, &of.up], if of.unit == "deg" { 2 } else { 1 })
        });
        text += &table_text(&titles, rows);
        text += &self_hits_text(room);
        text += &room.tilt.as_ref().map(tilt_text).unwrap_or_default();
        text + &copies_text(room)
    };
    all.iter().map(of).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::{TiltedTo, Tolerance};

    fn table(drawing: TablePlot) -> Table {
        let row = |name: &str, values: [Option<f64>; 2]| Row {
            name: name.into(),
            values: values.to_vec(),
            ..Row::default()
        };
        Table {
            title: "t".into(),
            columns: ["case", "a", "b"].map(str::to_owned).to_vec(),
            rows: vec![row("x", [Some(1.0), None]), row("y", [Some(2.0), Some(3.0)])],
            notes: vec![],
            drawing,
        }
    }

    #[test]
    fn a_table_is_drawn_by_case_by_column_or_one_column_against_the_other() {
        let by_column = |columns: &[usize]| {
            let [x_title, y_title] = ["u", "v"].map(str::to_owned);
            TablePlot::ByColumn { columns: columns.to_vec(), x_title, y_title }
        };
        let by_case = TablePlot::ByCase { columns: vec![1], y_title: "v".to_owned(), line: true };
        let by_case = study_plot(&table(by_case));
        assert_eq!((by_case.x_title.as_str(), by_case.y_title.as_str()), ("case", "v"));
        assert_eq!(by_case.series.len(), 1);
        assert_eq!(by_case.series[0].name, "b");
        assert!(by_case.series[0].points[0].1.is_nan());
        assert_eq!(by_case.series[0].points[1], (1.0, 3.0));
        let mut all = table(by_column(&[0, 1]));
        let both = study_plot(&all);
        assert_eq!((both.series.len(), both.series[1].name.as_str()), (2, "y"));
        assert_eq!(both.series[1].points, [(0.0, 2.0), (1.0, 3.0)]);
        // A column of another unit is left out, and a value beside a requirement that fails is hollow.
        all.drawing = by_column(&[1]);
        (all.columns[2], all.rows[1].unmet_at) = ("b %".into(), vec![0, 1]);
        let one = study_plot(&all);
        let second = &one.series[1];
        assert_eq!((&second.points[..], &second.hollow[..]), (&[(0.0, 3.0)][..], &[0][..]));
        assert!(matches!(&one.x, Axis::Names(names) if names[..] == ["b"]), "{:?}", one.x);
        assert!(one.y_title.starts_with("v (hollow"), "{}", one.y_title);
        let (x_title, y_title) = ("u".to_owned(), "v".to_owned());
        let against = study_plot(&table(TablePlot::Against { column: 1, x_title, y_title }));
        assert_eq!(against.series[0].points[1], (2.0, 3.0));
        assert_eq!(against.series[0].labels[1], (1, "y".to_owned()));
    }

    #[test]
    fn a_field_that_breaks_at_the_first_step_holds_to_less_than_it() {
        let side_of = |steps: f64, breaks: bool| RoomOfSide {
            holds_to: 1.25 * steps,
            breaks_at: breaks.then_some(1.25 * (steps + 1.0)),
            breaks: breaks.then(|| "near".to_owned()),
            self_hit_at: None,
        };
        let words = |steps: f64, breaks: bool| holds_to(&side_of(steps, breaks), 2);
        assert_eq!(
            [words(0.0, true), words(1.0, true), words(4.0, false)],
            ["< 1.25", "1.25", "≥ 5.00"]
        );
        let side = side_of(0.0, true);
        let least = TiltedTo { direction: "rear down", side };
        let text = |least: &TiltedTo| {
            let directions = vec![least.clone()];
            tilt_text(&RoomOfTilt { about: [0.0, 0.0], least: least.clone(), directions })
        };
        let limit = "holds to < 1.25°: near breaks at the first step looked at (rear down); more --steps look at smaller \
                     tilts\n";
        assert!(text(&least).ends_with(limit), "{}", text(&least));
        let later = TiltedTo { side: side_of(1.0, true), ..least.clone() };
        let limit_later = "holds to 1.25°, then near breaks (rear down)\n";
        assert!(text(&later).ends_with(limit_later), "{}", text(&later));
    }

    #[test]
    fn each_lidar_alone_names_the_requirement_that_breaks_first() {
        let [some, next] = [0.005, 0.01].map(|metres| Tolerance { metres, radians: 0.0 });
        let alone = |holds_within, breaks_within, breaks: Option<&str>| {
            let breaks = breaks.map(str::to_owned);
            RoomOfLidar { lidar: 4, holds_within, breaks_within, breaks }
        };
        let copies = |tolerance, holds_in, breaks: Option<&str>| {
            let breaks = breaks.map(str::to_owned);
            RoomOfCopies { tolerance, holds_in, error: 0.02, breaks }
        };
        let room = Room {
            copies: vec![copies(some, 1.0, None), copies(next, 0.5, Some("kerb"))],
            alone: vec![
                alone(Some(some), Some(next), Some("tyre")),
                alone(None, Some(some), Some("ring")),
                alone(Some(next), None, None),
            ],
            ..Room::default()
        };
        let text = copies_text(&room);
        let ends = [
            "standard errors)",
            "standard errors); kerb breaks first",
            "requirements; by up to 10 mm and 0°, tyre breaks first",
            "fewer than 95 % of 200 copies meet all requirements; ring breaks first",
            "by up to 10 mm and 0°: 95 % or more of 200 copies meet all requirements",
        ];
        let lines: Vec<&str> = text.lines().filter(|line| !line.starts_with('±')).collect();
        assert_eq!(lines.len(), ends.len(), "{text}");
        assert!(lines.iter().zip(ends).all(|(line, end)| line.ends_with(end)), "{text}");
    }

    #[test]
    fn the_value_as_given_is_a_point_of_the_curve() {
        let row = |value: f64, as_given: bool| {
            let scores = Scores { near_gain: Some(0.1 * value), ..Scores::default() };
            SweepRow { value, as_given, broken_rules: Vec::new(), scores }
        };
        let svg = |given: f64| {
            let rows = vec![row(given, true), row(1.0, false), row(2.0, false), row(3.0, false)];
            let (placement, [field, unit]) = ("rig".to_owned(), ["z", "m"]);
            sweep_plot(&Sweep { placement, lidar: 0, mirrored_lidar: None, field, unit, rows })
        };
        let drawn = |svg: &str| (svg.matches("<polyline").count(), svg.matches("r=\"4\"").count());
        assert_eq!(drawn(&svg(2.5)), (1, 4));
        assert_eq!(drawn(&svg(2.0)), (1, 3), "once where it is one of the values");
        assert_eq!(drawn(&svg(5.0)), (1, 3), "not beyond them");
        assert!(svg(2.5).contains(">as given<") && !svg(5.0).contains(">as given<"));
    }
}
