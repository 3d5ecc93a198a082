//! Scores, P-SOGs and verifications as text.

use super::columns::{LONGEST_CELL, align_columns, align_with_notes, table_text};
use super::losses::losses_text;
use super::{RunRecord, SceneRecord, ScoreColumn, optional};
use crate::json::{counted, fixed, spoken, trimmed};
use crate::psog::PsogInfo;
use crate::scan::conditions::under;
use crate::score::{Interval, Objective, Scores, bootstrap};
use crate::search::{Finding, GenerationsStop, Scored};
use crate::study::{Row, Table};
use crate::vehicle::{Placement, SensorPose, millimetres};
use crate::verify::Verification;

/// A text of at most `most` characters: the end of a longer one is an ellipsis.
pub(crate) fn shortened(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        None => text.to_owned(),
        Some(_) => text.chars().take(most - 1).chain(['…']).collect(),
    }
}

/// A text as a terminal may show it: characters that it would obey, or that turn the order of letters or the line,
/// are spelled out.
pub(crate) fn visible(text: &str) -> String {
    let spell = |c: char| match c {
        _ if c.is_control() => c.escape_default().to_string(),
        _ if is_hidden(c) => c.escape_unicode().to_string(),
        _ => c.into(),
    };
    text.chars().map(spell).collect()
}

/// True if a character shows nothing and changes how others are shown: marks of direction, breaks of lines.
fn is_hidden(c: char) -> bool {
    matches!(c, '\u{061c}' | '\u{200b}' | '\u{200e}' | '\u{200f}' | '\u{feff}')
        || ('\u{2028}'..='\u{202e}').contains(&c)
        || ('\u{2060}'..='\u{2069}').contains(&c)
}

/// Places that the distances of requirements count from.
pub(super) const COUNTED_FROM: &str =
    "Metres of targets count from the origin, of ground and blind zones from the body.";

/// A table of placements, below each its requirements (+ met, ! not), doubts (!) and blind sectors (*).
pub(crate) fn scores_text(all: &[Scores]) -> String {
    scores_text_by(all, "")
}

/// Like [`scores_text`], where an objective was maximized: with the scores that it names.
pub(super) fn scores_text_by(all: &[Scores], objective: &str) -> String {
    let columns = ScoreColumn::shown(all, objective);
    let cells = |scores| columns.iter().map(|column| column.cell(scores)).collect();
    let mut rows: Vec<Vec<String>> =
        vec![columns.iter().map(|column| column.title().to_owned()).collect()];
    rows.extend(all.iter().map(cells));
    let table = align_with_notes(&rows, &all.iter().map(notes).collect::<Vec<_>>());
    requirements_in_words(all).into_iter().fold(table, |text, words| text + &words + "\n")
}

/// Sentences below the requirements of some placements: where metres begin, and how far copies are off. None without
/// requirements.
pub(super) fn requirements_in_words<'a>(all: impl IntoIterator<Item = &'a Scores>) -> Vec<String> {
    let required: Vec<_> = all.into_iter().filter(|scores| !scores.required.is_empty()).collect();
    let from = required.first().map(|_| COUNTED_FROM.to_owned());
    let off = required.iter().find_map(|scores| scores.copies_off);
    let copies = off.map(|[mm, deg]| {
        format!("Copies are mounted up to {mm} mm and {deg}° off, at random (--tolerance).")
    });
    from.into_iter().chain(copies).collect()
}

pub(super) fn notes(scores: &Scores) -> Vec<String> {
    let required = scores.required.iter();
    let required =
        required.map(|seen| format!("  {} {seen}", if seen.is_met() { "+" } else { "!" }));
    let holds = scores.holds_in_words().map(|words| format!("  * {words}"));
    let guards = scores.guards.iter();
    let guards =
        guards.map(|guard| format!("  {} {guard}", if guard.is_doubt() { "!" } else { "*" }));
    let rules = scores.broken_rules.iter().map(|rule| format!("  ! RULE BROKEN: {rule}"));
    required.chain(holds).chain(guards).chain(rules).collect()
}

/// Properties that have a correlation with the objective, and both numbers of each.
pub(super) fn finding_rows(all: &[Finding]) -> Vec<Vec<String>> {
    let told = all.iter().filter(|of| of.correlation.is_some() || of.beside_height.is_some());
    let row = |of: &Finding| {
        vec![of.property.to_owned(), optional(of.correlation, 2), optional(of.beside_height, 2)]
    };
    told.map(row).collect()
}

/// Rank correlations of properties of layouts with the objective, one property a line; empty where none has one.
pub(crate) fn findings_text(all: &[Finding], objective: &str) -> String {
    let title = format!("rank correlation with {objective}");
    let titles = ["over random placements", &*title, "with mean height held fixed"];
    let rows = finding_rows(all);
    if rows.is_empty() { String::new() } else { table_text(&titles, rows) }
}

/// A value of an objective in a sentence: see [`Objective::spoken`].
pub(super) fn value_in_words(objective: &str, value: f64) -> String {
    let known = objective.parse::<Objective>();
    known.map_or_else(|_| spoken(value), |objective| objective.spoken(value))
}

/// Rules in lines: those of all mounts together, then a line a mount, as `1 × spin-32 on roof: yaw = 0, roll = 0`.
pub(super) fn rule_lines(rules: &[String]) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let mut mount: Option<&str> = None;
    for rule in rules {
        // Sensors on a mount come before its own rules, each of which begins with its name.
        let counted = rule.split_once(" × ").and_then(|(_, rest)| rest.split_once(" on "));
        let own = mount.and_then(|mount| rule.strip_prefix(mount));
        let own = own.filter(|own| own.starts_with([':', ',']));
        match (lines.last_mut(), own.map(|own| own.trim_start_matches([':', ',', ' ']))) {
            (Some(line), Some(own)) => {
                let between = if line.contains(": ") { ", " } else { ": " };
                *line += &format!("{between}{own}");
            }
            (Some(line), None) if mount.is_none() && counted.is_none() => {
                *line += &format!("; {rule}");
            }
            _ => lines.push(rule.clone()),
        }
        mount = counted.map(|(_, name)| name).or(mount);
    }
    lines
}

/// The option that ended a run at its limit of evaluations, which ends whole generations, and words behind it: `asked` of it,
/// `evaluated` by the run. `None` where another reason ended it.
fn limit_in_words(stopped: &str, asked: Option<u64>, evaluated: u64) -> Option<[String; 2]> {
    let limit = GenerationsStop::Budget.to_string();
    let (rest, asked) = stopped.strip_prefix(&limit).zip(asked)?;
    let rounded = if evaluated > asked { ", rounded up to whole generations" } else { "" };
    Some([format!("--evaluations {asked}{rounded}"), rest.to_owned()])
}

pub(super) fn limit_of(run: &RunRecord) -> Option<[String; 2]> {
    let asked = run.settings["search"]["evaluations"].as_u64();
    limit_in_words(&run.stopped, asked, run.evaluations)
}

/// Why a run ended and after how many placements; `done` counts them, as `55 evaluations and 300 of swaps`.
pub(super) fn stopped_in_words(stopped: &str, limit: Option<[String; 2]>, done: &str) -> String {
    let done = done.trim_end_matches(',');
    match limit {
        None => format!("stopped: {stopped}, after {done}"),
        Some([option, rest]) => {
            let limited = format!(" evaluations ({option})");
            format!("stopped after {}{rest}", done.replacen(" evaluations", &limited, 1))
        }
    }
}

/// A study's cases and notes. Columns in which no case has a number are named in a line.
pub(crate) fn study_text(table: &Table) -> String {
    let number = |value: Option<f64>, column: usize| match value {
        None => "–".to_owned(),
        Some(v) if table.columns[column + 1].ends_with(" %") => fixed(v, 2),
        Some(0.0) => "0".to_owned(),
        Some(v) if (1e-3..1e6).contains(&v.abs()) => trimmed(v, 4),
        // Counts of voxels: whole numbers, as below a million.
        Some(v) if (1e6..1e9).contains(&v.abs()) => fixed(v, 0),
        Some(v) => format!("{v:.4e}"),
    };
    let value = |row: &Row, column: usize| row.values.get(column).copied().flatten();
    let says = |row: &Row, column| value(row, column).is_some() || row.unmet_at.contains(&column);
    let all = 0..table.columns.len().saturating_sub(1);
    let (shown, empty): (Vec<usize>, Vec<usize>) =
        all.clone().partition(|&k| table.rows.iter().any(|row| says(row, k)));
    // A table without any number keeps its titles.
    let (shown, empty) = if shown.is_empty() { (all.collect(), shown) } else { (shown, empty) };
    let titles = |columns: &[usize]| {
        columns.iter().map(|&k| table.columns[k + 1].clone()).collect::<Vec<_>>()
    };
    let mut rows = vec![[&table.columns[..1], &titles(&shown)[..]].concat()];
    rows.extend(table.rows.iter().map(|row| {
        let mark = |column| if row.unmet_at.contains(&column) { "!" } else { "" };
        let values = shown.iter().map(|&k| format!("{}{}", mark(k), number(value(row, k), k)));
        std::iter::once(row.marked()).chain(values).collect()
    }));
    let empty = match &empty[..] {
        [] => String::new(),
        _ => format!("without a number: {}\n", titles(&empty).join(", ")),
    };
    let remarks: String =
        table.rows.iter().flat_map(Row::remarks).map(|remark| format!("{remark}\n")).collect();
    let gap = if remarks.is_empty() { "" } else { "\n" };
    let notes: String = table.notes.iter().map(|note| format!("\n{note}\n")).collect();
    let shown = align_columns(&rows);
    let cut = cut_names(table, &shown);
    shown + &empty + &cut + &losses_text(table) + gap + &remarks + &notes
}

/// Names that a table cuts, such as long lists of sensors, whole, a line each. Remarks have the names of their rows.
fn cut_names(table: &Table, shown: &str) -> String {
    let is_cut = |name: &str| {
        name.chars().count() > LONGEST_CELL
            || name.split_whitespace().any(|word| !shown.contains(word))
    };
    let unremarked = table.rows.iter().filter(|row| row.remarks().next().is_none());
    let names = unremarked.map(|row| visible(&row.name)).filter(|name| is_cut(name));
    names.map(|name| format!("{}: {name}\n", table.columns[0])).collect()
}

/// The poses of a placement, a line each, in metres and radians and then in millimetres and degrees; `mounts` names the
/// mount of each LiDAR, or is empty.
pub(crate) fn poses_text(placement: &Placement, mounts: &[Option<String>]) -> String {
    let titles = ["LiDAR", "x", "y", "z", "roll", "pitch", "yaw"];
    let mut rows = vec![titles.map(str::to_owned).to_vec()];
    let mounted = !mounts.is_empty();
    rows[0].extend(mounted.then(|| "mount".to_owned()));
    let named = placement.lidars.iter().any(|pose| !pose.sensor.is_none());
    rows[0].extend(named.then(|| "sensor".to_owned()));
    let phased = placement.lidars.iter().any(|pose| pose.phase.is_some());
    rows[0].extend(phased.then(|| "phase".to_owned()));
    for (index, pose) in placement.lidars.iter().enumerate() {
        let mut row = vec![index.to_string()];
        row.extend(pose.fields().map(|(_, value)| fixed(value, 3)));
        row.extend(mounted.then(|| mount_text(mounts, index)));
        row.extend(named.then(|| pose.sensor.to_string()));
        row.extend(phased.then(|| phase_text(pose)));
        rows.push(row);
    }
    let small = placement.lidars.iter().enumerate().map(|(index, pose)| {
        let numbers = millimetres(pose).map(|(_, value)| value.to_string());
        std::iter::once(index.to_string()).chain(numbers).collect()
    });
    let titles = ["", "x mm", "y mm", "z mm", "roll °", "pitch °", "yaw °"];
    align_columns(&rows) + &table_text(&titles, small)
}

/// Mount of a LiDAR, – where it stands on none.
pub(in crate::report) fn mount_text(mounts: &[Option<String>], lidar: usize) -> String {
    mounts.get(lidar).cloned().flatten().unwrap_or_else(|| "–".to_owned())
}

/// Phase of a LiDAR in radians, empty where its model says it.
pub(in crate::report) fn phase_text(pose: &SensorPose) -> String {
    pose.phase.map(|phase| fixed(phase, 4)).unwrap_or_default()
}

/// Names of scenes, of equal ones the later ones with a number: they tell rows and folders apart.
pub(crate) fn numbered(names: impl IntoIterator<Item = String>) -> Vec<String> {
    let mut told: Vec<String> = Vec::new();
    for wanted in names {
        let numbered = (2..).map(|number| format!("{wanted}-{number}"));
        let mut candidates = std::iter::once(wanted.clone()).chain(numbered);
        let free = candidates.find(|name| !told.contains(name));
        told.push(free.unwrap_or(wanted));
    }
    told
}

/// Its facts, a line each, and the part of each class in the entropy.
pub(crate) fn psog_text(info: &PsogInfo) -> String {
    format!("{}\n{}", facts(info), classes(info))
}

/// One fact a line: its name, its value and its meaning.
fn facts(info: &PsogInfo) -> String {
    let [x, y, z] = [0, 1, 2].map(|k| format!("{} to {}", info.min[k], info.max[k]));
    let [nx, ny, nz] = info.shape;
    let [dx, dy, dz] = info.voxel;
    let voxels = |count: u64, which: &str| {
        format!("{count} voxels ({:.2} %) {which}", 100.0 * count as f64 / info.voxels as f64)
    };
    let nats = |value: f64| format!("{value:.2} nats");
    let mut facts = vec![
        ("region", format!("x {x}, y {y}, z {z} m")),
        ("voxels", format!("{} = {nx} × {ny} × {nz} of {dx} × {dy} × {dz} m", info.voxels)),
        ("frames", info.frames.to_string()),
        ("occupied", voxels(info.occupied, "in at least one frame")),
        ("informative", voxels(info.informative, "not the same in all frames")),
        ("entropy", format!("{}, every class for itself", nats(info.entropy_segmentation))),
    ];
    if let (Some(entropy), Some(target)) = (info.entropy_detection, &info.detection_target) {
        facts.push(("", format!("{}, {target} or not", nats(entropy))));
    }
    facts.push(("", format!("{}, occupied or not", nats(info.entropy_bernoulli))));
    facts.push(("memory", format!("{:.1} MiB", info.memory_bytes as f64 / f64::from(1 << 20))));
    let ties = info.tie_share.map(|ties| format!("{:.2} % of the votes", 100.0 * ties));
    facts.extend(ties.map(|words| ("ties", words + ", which went to the lowest class")));
    facts.iter().map(|(name, value)| format!("{name:<12}{value}\n")).collect()
}

fn classes(info: &PsogInfo) -> String {
    let row =
        |name: &str, voxels: String, nats: f64| vec![name.to_owned(), voxels, format!("{nats:.2}")];
    let all = info.classes.iter().map(|of| row(&of.name, of.voxels.to_string(), of.entropy));
    let empty = row("(empty)", "–".to_owned(), info.entropy_empty);
    table_text(&["class", "voxels", "nats"], all.chain([empty]))
}

/// Times that scenes are drawn.
const RESAMPLES: usize = 10_000;

/// A result against one baseline.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Against<'a> {
    pub name: &'a str,
    /// Gain of the baseline, as a share.
    pub gain: f64,
    /// Gain of the result less that of the baseline.
    pub difference: f64,
    /// 95 % interval of the difference over scenes, mirror images counting with their scene; `None` for one scene.
    pub interval: Option<Interval>,
}

/// The result against every baseline that gains anything, in their order, by a share: see [`ScoreColumn::argued`].
pub(crate) fn against<'a>(
    best: &Scored,
    baselines: &'a [Scored],
    scenes: &[SceneRecord],
    seed: u64,
    column: ScoreColumn,
) -> Vec<Against<'a>> {
    let share = |scores: &Scores| column.value(scores);
    let compare = |baseline: &'a Scored| {
        let (ours, theirs) = (share(&best.scores)?, share(&baseline.scores)?);
        // A scene and its mirror image are two frames of one place.
        let mut differences: Vec<Vec<f64>> = Vec::new();
        let pairs = best.by_scene.iter().zip(&baseline.by_scene);
        for (scene, (ours, theirs)) in scenes.iter().zip(pairs) {
            let difference =
                share(&ours.scores).unwrap_or(0.0) - share(&theirs.scores).unwrap_or(0.0);
            match differences.last_mut().filter(|_| scene.mirrored) {
                Some(place) => place.push(difference),
                None => differences.push(vec![difference]),
            }
        }
        let several = differences.len() > 1;
        let interval = several.then(|| bootstrap(&differences, RESAMPLES, seed)).flatten();
        let (name, difference) = (baseline.placement.name.as_str(), ours - theirs);
        Some(Against { name, gain: theirs, difference, interval })
    };
    baselines.iter().filter_map(compare).collect()
}

/// Differences of a GPU from the CPU reference, and of that from `f64`, a line each.
pub(crate) fn verification_text(
    scene: &str,
    conditions: &[String],
    found: &Verification,
) -> String {
    let lines = |rows: &[(&str, String)]| {
        let row = |(name, value): &(&str, String)| vec![format!("  {name}"), value.clone()];
        align_columns(&rows.iter().map(row).collect::<Vec<_>>())
    };
    let (gpu, reference) = (&found.gpu_against_cpu, &found.cpu_against_f64);
    let mut text = format!(
        "{scene}: {} × {}{}\nGPU ({}) against the CPU reference:\n",
        counted(found.placements, "placement"),
        counted(found.frames, "frame"),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::TablePlot;

    #[test]
    fn findings_leave_out_properties_without_a_number() {
        let finding =
            |property, correlation| Finding { property, correlation, beside_height: None };
        let none = finding("mean height", None);
        let told = findings_text(&[none.clone(), finding("mean |roll|", Some(-0.2))], "near_gain");
        let lines: Vec<&str> = told.lines().collect();
        assert_eq!(lines.len(), 2, "{told}");
        assert!(lines[0].contains("rank correlation with near_gain") && lines[1].contains("-0.20"));
        assert_eq!(findings_text(&[none], "near_gain"), "");
    }

    #[test]
    fn a_limit_of_evaluations_is_told_with_its_option() {
        let told = |stopped: &str, evaluated| {
            let limit = limit_in_words(stopped, Some(45), evaluated);
            stopped_in_words(stopped, limit, "55 evaluations, and 300 of swaps,")
        };
        let limit = GenerationsStop::Budget.to_string();
        let option = "stopped after 55 evaluations (--evaluations 45";
        let rounded = ", rounded up to whole generations), and 300 of swaps";
        assert_eq!(told(&limit, 55), format!("{option}{rounded}"));
        assert_eq!(told(&limit, 45), format!("{option}), and 300 of swaps"));
        let few = "; 1 baseline is not scored";
        assert_eq!(told(&format!("{limit}{few}"), 55), format!("{option}{rounded}{few}"));
        let end = "stopped: interrupted, after 55 evaluations, and 300 of swaps";
        assert_eq!(told("interrupted", 55), end);
    }

    #[test]
    fn rules_of_a_mount_stand_on_its_line() {
        let rules = [
            "LiDARs at least 0.3 m apart",
            "all LiDARs at one height",
            "1 × spin-32 on roof",
            "roof: yaw = 0",
            "roof: roll = 0",
            "2 × side-64 on roof-rear",
            "roof-rear, in its own frame: z = 0",
            "roof-rear-left: yaw = 0",
        ];
        let want = [
            "LiDARs at least 0.3 m apart; all LiDARs at one height",
            "1 × spin-32 on roof: yaw = 0, roll = 0",
            "2 × side-64 on roof-rear: in its own frame: z = 0",
            "roof-rear-left: yaw = 0",
        ];
        assert_eq!(rule_lines(&rules.map(str::to_owned)), want);
        assert_eq!(rule_lines(&["yaw = 0".to_owned()]), ["yaw = 0"]);
    }

    #[test]
    fn a_study_names_columns_without_a_number_in_a_line() {
        let row = |values: [Option<f64>; 3], unmet_at: &[usize]| Row {
            name: "rig".into(),
            values: values.to_vec(),
            unmet_at: unmet_at.to_vec(),
            ..Row::default()
        };
        let table = |row: Row| Table {
            title: "t".into(),
            columns: ["case", "a", "b", "c"].map(str::to_owned).to_vec(),
            rows: vec![row],
            notes: Vec::new(),
            drawing: TablePlot::ByCase { columns: vec![0], y_title: "a".into(), line: false },
        };
        let text = study_text(&table(row([None, Some(2.0), None], &[2])));
        assert_eq!(text, "case  b   c\nrig   2  !–\nwithout a number: a\n");
        let none = study_text(&table(row([None; 3], &[])));
        assert_eq!(none, "case  a  b  c\nrig   –  –  –\n");
        // Counts beside each other are written alike, however large.
        let counts = study_text(&table(row([1_175_600.0, 794_158.0, 0.5].map(Some), &[])));
        assert_eq!(counts, "case        a       b    c\nrig   1175600  794158  0.5\n");
    }

    #[test]
    fn a_long_list_of_sensors_is_cut_in_the_table_and_whole_below() {
        let rows = ["near and far, ", "short"].map(|name| Row {
            name: name.repeat(if name == "short" { 1 } else { 12 }).trim_end_matches(", ").into(),
            values: vec![Some(1.0)],
            ..Row::default()
        });
        let long = rows[0].name.clone();
        let table = Table {
            title: "t".into(),
            columns: ["sensors", "price"].map(str::to_owned).to_vec(),
            rows: rows.to_vec(),
            notes: Vec::new(),
            drawing: TablePlot::ByCase { columns: vec![0], y_title: "a".into(), line: false },
        };
        let text = study_text(&table);
        assert!(text.contains('…') && text.ends_with(&format!("\nsensors: {long}\n")), "{text}");
        assert!(!text.contains("sensors: short"), "{text}");
        // The remark of a row has its name whole.
        let mut unmet = table.clone();
        unmet.rows[0].not_met = vec!["NOT MET: near".into()];
        let text = study_text(&unmet);
        assert_eq!(text.matches(&long).count(), 1, "{text}");
    }
}
