//! The front of two or three objectives: `result.json`, a table, a drawing.
//!
//! | file | holds |
//! |---|---|
//! | `text` | the front in words, and its table as text |

mod text;

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::plot::{Axis, Plot, Series};
use super::study::lost;
use super::svg::trimmed;
use super::tables::{optional, score_rows, score_titles};
use crate::csv::{csv, number};
use crate::job::{Front, FrontObjective, FrontPoint};
use crate::score::{percent_down, percent_up};
use crate::targets::RangeCard;

pub(crate) use text::front_text;
pub(super) use text::{front_verdict, refined_in_words};
use text::{met_in_words, names_in_words};

/// Title of the column of requirements.
const REQUIRED: &str = "requirements";

/// All of `result.json` of a front.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrontRecord {
    /// Version of the program.
    pub sightline: &'static str,
    /// Name of the scene; all names where there are several.
    pub scene: String,
    /// Files and options behind the result.
    pub settings: Value,
    /// Command line that repeats the search but for its engine; empty where no program ran.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub command: String,
    /// Weather and faults, as they are written; empty in clear air.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub conditions: Vec<String>,
    /// `cpu` or `gpu`.
    pub backend: String,
    /// Device as reported.
    pub adapter: String,
    /// Name of each objective, and `less` or `more`: the better side.
    pub objectives: Value,
    /// Points in the order of the first objective, the best first.
    pub front: Vec<Value>,
    /// Named points: `pick`, and the `name` of its placement.
    pub picks: Vec<Value>,
    /// Placements to compare with, with the keys of points; empty where none were given.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub baselines: Vec<Value>,
    /// Placements scored over all frames.
    pub scored: usize,
    /// Why the search ended: a name, and after a colon its meaning.
    pub stopped: String,
    /// Wall time of the search in seconds.
    pub seconds: f64,
    /// Most memory that the program held, bytes; `None` where the system does not tell.
    pub peak_memory: Option<u64>,
}

impl FrontRecord {
    /// The record of a front. Scene, settings, command, weather and seconds, which the front does not hold, are left empty.
    pub fn new(front: &Front) -> Self {
        let objectives = front.objectives.all().iter().map(|objective| {
            let better = if objective.is_cost() { "less" } else { "more" };
            json!({ "name": objective.to_string(), "better": better })
        });
        let picks = front.picks.iter().map(
            |(pick, point)| json!({ "pick": pick, "name": front.points[*point].placement.name }),
        );
        Self {
            sightline: env!("CARGO_PKG_VERSION"),
            scene: String::new(),
            settings: Value::Null,
            command: String::new(),
            conditions: Vec::new(),
            backend: front.backend.clone(),
            adapter: front.adapter.clone(),
            objectives: objectives.collect(),
            front: front.points.iter().map(|point| point_json(front, point)).collect(),
            picks: picks.collect(),
            baselines: front.baselines.iter().map(|point| point_json(front, point)).collect(),
            scored: front.scored,
            stopped: front.stopped.to_string(),
            seconds: 0.0,
            peak_memory: super::record::peak_memory(),
        }
    }

    /// The record with its version first.
    pub fn json(&self) -> Value {
        json!(self)
    }
}

/// A point as `result.json` lists it.
fn point_json(front: &Front, point: &FrontPoint) -> Value {
    let names = front.objectives.names().into_iter();
    let values: Map<String, Value> =
        names.zip(point.values.iter().map(|value| json!(value))).collect();
    json!({
        "name": point.placement.name,
        "objectives": values,
        "price": point.price,
        "sensors": point.placement.lidars.len(),
        "equipment": point.equipment,
        "requirements_met": point.meets,
        "copies_that_meet_all": copies(point),
        "car_blind_deg": blind(point),
        "placement": point.placement,
        "scores": point.scores,
    })
}

/// Share of copies mounted a little off that meet all requirements; `None` for a point that misses one, and where nobody
/// looked.
fn copies(point: &FrontPoint) -> Option<f64> {
    point.scores.requirements_hold_in.filter(|_| point.meets && !point.scores.required.is_empty())
}

/// Width of the sectors in which a car is lost, degrees, as `study loss` has it; `None` where nobody looked.
fn blind(point: &FrontPoint) -> Option<f64> {
    point.scores.range_card.as_ref().map(|_| lost(&point.scores))
}

/// Meaning of the column of blind sectors, with the distances that were looked at.
pub(super) fn blind_in_words(front: &Front) -> String {
    let card = front.points.iter().find_map(|point| point.scores.range_card.as_ref());
    format!(
        "blind °: width of the sectors of 30° in which a car is lost somewhere {}",
        RangeCard::between_in_words(card)
    )
}

/// A value of an objective as tables and drawings show it: gains and missing shares that are shares in per cent.
pub(super) fn shown(objective: &FrontObjective, value: f64) -> String {
    match objective {
        FrontObjective::Price | FrontObjective::Sensors => trimmed(value, 2),
        // Rounded up, as the share that is seen is rounded down.
        FrontObjective::Requirements => format!("{:.1}", percent_up(value)),
        FrontObjective::Score(score) if score.is_share() => format!("{:.2}", 100.0 * value),
        FrontObjective::Score(_) if value.abs() < 1.0 => format!("{value:.4}"),
        FrontObjective::Score(_) => trimmed(value, 2),
    }
}

/// Title of an objective's column or axis.
pub(super) fn title(objective: &FrontObjective) -> String {
    match objective {
        FrontObjective::Requirements => "points missing".to_owned(),
        FrontObjective::Score(score) if score.is_share() => format!("{score} %"),
        other => other.to_string(),
    }
}

/// Picks of a point in words, as `knee, best price`.
pub(super) fn picks_of(front: &Front, point: usize) -> String {
    let picks = front.picks.iter().filter(|(_, of)| *of == point);
    picks.map(|(pick, _)| pick.to_string()).collect::<Vec<_>>().join(", ")
}

/// Points, then placements to compare with.
pub(super) fn all_shown(front: &Front) -> impl Iterator<Item = &FrontPoint> {
    front.points.iter().chain(&front.baselines)
}

/// Picks of a placement of [`all_shown`] in words, or that it is a baseline.
fn role_of(front: &Front, number: usize) -> String {
    if number < front.points.len() { picks_of(front, number) } else { "baseline".to_owned() }
}

/// True if any point misses a requirement or meets one, so that the vehicle has some.
pub(super) fn has_requirements(front: &Front) -> bool {
    front.points.iter().any(|point| !point.scores.required.is_empty())
}

/// True if copies of any point were looked at: a search whose time is over looks at none.
pub(super) fn has_copies(front: &Front) -> bool {
    all_shown(front).any(|point| copies(point).is_some())
}

pub(super) fn front_rows(front: &Front) -> Vec<Vec<String>> {
    let (all, requires) = (front.objectives.all(), has_requirements(front));
    let by_number = all.contains(&FrontObjective::Sensors);
    let mut titles = vec!["placement".to_owned()];
    titles.extend(all.iter().map(title));
    titles.extend((!by_number).then(|| "sensors".to_owned()));
    titles.extend(requires.then(|| REQUIRED.to_owned()));
    let has_copies = has_copies(front);
    let has_blind = all_shown(front).any(|point| blind(point).is_some());
    titles.extend(has_copies.then(|| "copies %".to_owned()));
    titles.extend(has_blind.then(|| "blind °".to_owned()));
    titles.push("pick".to_owned());
    let row = |(k, point): (usize, &FrontPoint)| {
        let mut cells = vec![point.placement.name.clone()];
        cells.extend(
            all.iter().zip(&point.values).map(|(objective, value)| shown(objective, *value)),
        );
        cells.extend((!by_number).then(|| point.placement.lidars.len().to_string()));
        cells.extend(requires.then(|| met_in_words(point)));
        cells.extend(has_copies.then(|| optional(copies(point).map(percent_down), 1)));
        cells.extend(has_blind.then(|| blind(point).map_or("–".to_owned(), |of| trimmed(of, 1))));
        cells.push(role_of(front, k));
        cells
    };
    std::iter::once(titles).chain(all_shown(front).enumerate().map(row)).collect()
}

/// A row a point, then a row a baseline: objectives, price, sensors, whether it meets all requirements, its picks or
/// `baseline`, then its scores.
pub(crate) fn front_csv(front: &Front) -> String {
    // Scores have columns of the same names.
    let mut first: Vec<String> =
        front.objectives.names().iter().map(|name| format!("objective_{name}")).collect();
    first.extend(["price", "sensors", "meets", "pick"].map(str::to_owned));
    first.extend(score_titles(&[]));
    let rows = all_shown(front).enumerate().map(|(k, point)| {
        let mut row: Vec<String> = point.values.iter().map(|value| number(*value)).collect();
        row.extend([number(point.price), point.placement.lidars.len().to_string()]);
        row.extend([point.meets.to_string(), role_of(front, k)]);
        row.extend(score_rows([&point.scores], &[]).concat());
        row
    });
    csv(std::iter::once(first).chain(rows))
}

/// Pixels of the radius of points with the least and the most of a third objective.
const SIZES: [f64; 2] = [3.5, 7.0];

/// Radius of points by their third objective, and lines of the legend that tell the least and the most of it; `None` of two
/// objectives, and where all points have as much.
fn third_drawn(front: &Front) -> Option<(impl Fn(&FrontPoint) -> f64, [Series; 2])> {
    let third = front.objectives.all().get(2)?;
    let values = || all_shown(front).map(|point| point.values[2]).filter(|value| value.is_finite());
    let [least, most] = [values().reduce(f64::min)?, values().reduce(f64::max)?];
    let size = move |point: &FrontPoint| {
        let part = ((point.values[2] - least) / (most - least)).clamp(0.0, 1.0);
        ((SIZES[0] + part * (SIZES[1] - SIZES[0])) * 10.0).round() / 10.0
    };
    let key = |(size, value): (f64, f64)| Series {
        name: format!("size: {} {}", title(third), shown(third, value)),
        sizes: vec![size],
        ..Series::default()
    };
    let keys = [(SIZES[0], least), (SIZES[1], most)].map(key);
    (most > least).then_some((size, keys))
}

/// Chart of the first two objectives. A third one is the size of the points, and its value stands beside each pick. Baselines are
/// diamonds with their names.
pub(crate) fn front_plot(front: &Front) -> Plot {
    let all = front.objectives.all();
    let scale = |objective: &FrontObjective, value: f64| match objective {
        FrontObjective::Requirements => 100.0 * value,
        FrontObjective::Score(score) if score.is_share() => 100.0 * value,
        _ => value,
    };
    let at =
        |point: &FrontPoint| (scale(&all[0], point.values[0]), scale(&all[1], point.values[1]));
    let requires = has_requirements(front);
    let third = third_drawn(front);
    let sizes = |points: &[&FrontPoint]| -> Vec<f64> {
        third.iter().flat_map(|(size, _)| points.iter().copied().map(size)).collect()
    };
    let series = [(true, "meets all requirements"), (false, "misses a requirement")].map(
        |(meets, words)| {
            let of: Vec<(usize, &FrontPoint)> =
                front.points.iter().enumerate().filter(|(_, point)| point.meets == meets).collect();
            let labels = of.iter().enumerate().filter_map(|(number, (k, point))| {
                let picks = picks_of(front, *k).replace("knee", "best trade-off (knee)");
                let third = all.get(2).map_or(String::new(), |third| {
                    format!(" ({} {})", title(third), shown(third, point.values[2]))
                });
                (!picks.is_empty()).then(|| (number, picks + &third))
            });
            Series {
                name: if requires { words.to_owned() } else { "front".to_owned() },
                points: of.iter().map(|(_, point)| at(point)).collect(),
                labels: labels.collect(),
                sizes: sizes(&of.iter().map(|(_, point)| *point).collect::<Vec<_>>()),
                ..Series::default()
            }
        },
    );
    let unit = |objective: &FrontObjective| match objective {
        FrontObjective::Requirements => "points missing of the requirements".to_owned(),
        other => title(other),
    };
    let [x_title, y_title] = [0, 1].map(|k| unit(&all[k]));
    let title = format!("Placements by {}", names_in_words(front));
    let mut baselines = baselines_drawn(front, at);
    baselines.sizes = sizes(&front.baselines.iter().collect::<Vec<_>>());
    let series = series.into_iter().chain([baselines]);
    let series = series.filter(|series| !series.points.is_empty());
    let series = series.chain(third.iter().flat_map(|(_, keys)| keys.clone())).collect();
    Plot { title, x_title, y_title, x: Axis::Numbers, series }
}

/// Baselines in the drawing, each with its name; hollow where they miss a requirement.
fn baselines_drawn(front: &Front, at: impl Fn(&FrontPoint) -> (f64, f64)) -> Series {
    let all = || front.baselines.iter().enumerate();
    let hollow: Vec<usize> =
        all().filter(|(_, point)| !point.meets).map(|(number, _)| number).collect();
    let words = if hollow.is_empty() { "" } else { " (hollow: misses a requirement)" };
    Series {
        name: format!("baseline{words}"),
        points: front.baselines.iter().map(at).collect(),
        labels: all().map(|(number, point)| (number, point.placement.name.clone())).collect(),
        hollow,
        diamonds: true,
        ..Series::default()
    }
}

#[cfg(test)]
mod tests {
    use super::text::front_table;
    use super::*;
    use crate::job::{FrontStopped, Pick};
    use crate::report::words::tests::planted;
    use crate::score::Seen;

    #[test]
    fn missing_points_are_rounded_up_as_on_the_page() {
        let missing = |value| shown(&FrontObjective::Requirements, value);
        assert_eq!([0.0651, 0.065, 0.0].map(missing), ["6.6", "6.5", "0.0"]);
    }

    /// A front of one point, `only`.
    fn single() -> Front {
        let only = planted("only", -1.0, 500.0);
        let point = FrontPoint {
            placement: only.placement,
            values: vec![3.0, 0.5],
            price: 3.0,
            equipment: String::new(),
            meets: true,
            scores: only.scores,
            by_scene: Vec::new(),
        };
        Front {
            objectives: "price,near_gain".parse().unwrap(),
            points: vec![point],
            picks: Vec::new(),
            baselines: Vec::new(),
            scored: 1,
            is_whole: false,
            stopped: FrontStopped::Complete,
            backend: String::new(),
            adapter: String::new(),
        }
    }

    #[test]
    fn a_single_point_is_the_best_in_each_objective() {
        let mut front = single();
        let words = "One placement is the best in each of price, near_gain";
        assert_eq!(front_verdict(&front), words);
        let three = Front { points: vec![front.points[0].clone(); 3], ..front.clone() };
        let words =
            "3 placements by price and near gain. No other placement found is better in both";
        assert_eq!(front_verdict(&three), words);
        let knee = Front { picks: vec![(Pick::Knee, 0)], ..front.clone() };
        let knee_drawn = front_plot(&knee).svg();
        assert!(
            knee_drawn.contains("best trade-off (knee)") && knee_drawn.contains("near_gain %"),
            "{knee_drawn}"
        );
        let rows = front_rows(&knee);
        assert_eq!((&*rows[0][2], &*rows[1][2]), ("near_gain %", "50.00"));
        let mut mine =
            FrontPoint { meets: false, values: vec![4.0, 0.25], ..front.points[0].clone() };
        mine.placement.name = "mine".to_owned();
        let beside = Front { baselines: vec![mine], ..front.clone() };
        let drawn = front_plot(&beside).svg();
        for words in [">baseline (hollow: misses a<", ">mine<"] {
            assert!(drawn.contains(words) && !knee_drawn.contains(words), "{words}: {drawn}");
        }
        // Its mark, and the one in the legend.
        assert_eq!(drawn.matches("<polygon").count(), 2, "{drawn}");
        assert_eq!(drawn.matches("fill=\"#fff\" stroke=").count(), 1, "{drawn}");
        let rows = front_rows(&beside);
        assert_eq!((&*rows[2][0], &*rows[2][2]), ("mine", "25.00"));
        assert_eq!(rows[2].last().map(String::as_str), Some("baseline"));
        // Sensors that reach 20 m: nobody looked farther.
        let words =
            "blind °: width of the sectors of 30° in which a car is lost somewhere between 5 and";
        assert_eq!(blind_in_words(&front), format!("{words} 50 m"));
        let card = RangeCard { blind_between: [5.0, 20.0], ..RangeCard::default() };
        front.points[0].scores.range_card = Some(card);
        assert_eq!(blind_in_words(&front), format!("{words} 20 m"));
        let record = FrontRecord::new(&front);
        let text = front_text(&front, &record, "runs".as_ref());
        assert!(text.contains(&format!("\n{words} 20 m\n")), "{text}");
    }

    #[test]
    fn a_third_objective_is_the_size_of_the_points() {
        let mut front = single();
        let point = |at: [f64; 3]| FrontPoint { values: at.to_vec(), ..single().points[0].clone() };
        front.objectives = "price,near_gain,sensors".parse().unwrap();
        front.points = vec![point([3.0, 0.5, 1.0]), point([5.0, 0.6, 3.0]), point([6.0, 0.7, 4.0])];
        front.baselines = vec![point([7.0, 0.6, 2.0])];
        let svg = front_plot(&front).svg();
        for words in [">size: sensors 1<", ">size: sensors 4<", "r=\"5.8\" fill="] {
            assert_eq!(svg.matches(words).count(), 1, "{words}: {svg}");
        }
        // A point and its line in the legend.
        for words in ["r=\"3.5\" fill=", "r=\"7\" fill="] {
            assert_eq!(svg.matches(words).count(), 2, "{words}: {svg}");
        }
        // All alike, or two objectives: no size tells anything.
        front.points.truncate(1);
        front.baselines.clear();
        let alike = front_plot(&front).svg();
        front.objectives = "price,near_gain".parse().unwrap();
        front.points[0].values.truncate(2);
        for svg in [alike, front_plot(&front).svg()] {
            assert!(!svg.contains("size: ") && svg.contains("r=\"4\" fill="), "{svg}");
        }
    }

    #[test]
    fn copies_are_explained_where_a_column_has_them() {
        let mut front = single();
        front.points[0].scores.required = vec![Seen::of("car", 1.0)];
        let words = "copies %: copies mounted within the tolerance";
        for share in [None, Some(0.5)] {
            front.points[0].scores.requirements_hold_in = share;
            let titles = &front_rows(&front)[0];
            let text = front_text(&front, &FrontRecord::new(&front), "runs".as_ref());
            let both = [titles.contains(&"copies %".to_owned()), text.contains(words)];
            assert_eq!(both, [share.is_some(); 2], "{text}");
        }
    }

    #[test]
    fn picks_and_baselines_have_a_line_each_and_the_requirement_that_is_missed_most_is_named() {
        let mut missing = single();
        let mut mine = FrontPoint { meets: false, ..missing.points[0].clone() };
        mine.placement.name = "mine".to_owned();
        (missing.picks, missing.baselines) = (vec![(Pick::Knee, 0)], vec![mine]);
        let required = [("car", 0.7), ("child", 0.25), ("tyre", 1.0)];
        let required = required.map(|(name, share)| Seen::of(name, share)).to_vec();
        missing.baselines[0].scores.required = required.clone();
        missing.points[0].scores.required = required[2..].to_vec();
        let table = front_table(&missing);
        let told = "child: 25.0 % seen, 90.0 % required, and 1 more requirement";
        for words in [&*format!("\n  ! {told}\n"), "\n\nknee: only\nbaseline: mine\n"] {
            assert!(table.contains(words), "{words}: {table}");
        }
        assert!(!table.contains("pick") && table.contains("  NOT MET\n"), "{table}");
        assert_eq!(front_rows(&missing)[2][4], "NOT MET: child, 25.0 of 90.0 %");
        let all = Front { points: vec![missing.points[0].clone(); 2], ..missing };
        let verdict = front_verdict(&all);
        let words = "2 placements by price and near gain. No other placement found is better in both and meets the \
                     requirements as well. The cheapest found that meets all requirements costs";
        assert!(verdict.starts_with(words), "{verdict}");
        let whole = front_verdict(&Front { is_whole: true, ..all });
        assert!(whole.contains(". The cheapest that meets all requirements costs"), "{whole}");
    }
}
