//! The folder of a run in place of a file of placements: its optimum, and the run's words about it.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::Value;

use crate::csv::rounded;
use crate::job::Tolerance;
use crate::runs::RunError;
use crate::runs::inputs::file_and_name;
use crate::runs::run_folder::{PLACEMENTS, RESULT, best_of, result_of};
use crate::score::{
    BLIND_SECTOR, Between, HOLDS, Lost, RulePlaces, SEEN, Seen, WorstFrame, percent_down,
};

/// Most placements of a front that an error names.
const MOST_NAMED: usize = 24;

/// Rig to hand over, as given: a file of placements, or the folder of a run.
pub(super) struct GivenRig {
    /// File of placements, with the name of one behind a colon where there are several.
    pub text: String,
    /// The run, where a folder was given.
    pub run: Option<RunFound>,
}

/// A run as its folder tells it.
pub(super) struct RunFound {
    /// The folder.
    pub folder: PathBuf,
    /// Vehicle file; `None` where the scene says its vehicle.
    pub vehicle: Option<PathBuf>,
    /// First scene.
    pub scene: PathBuf,
    /// Seed of the search.
    pub seed: u64,
    /// Mounting tolerance that requirements were looked at within.
    pub tolerance: Option<Tolerance>,
    /// Requirements as the run measured them, over all its frames.
    pub required: Vec<Seen>,
    /// Share of copies within the tolerance that meet all of them; `None` where the run did not look.
    pub hold_in: Option<f64>,
    /// Result in words, guards that the placement violates, and the command that repeats the run.
    pub words: Vec<String>,
}

impl GivenRig {
    /// Looks whether a folder is given, with or without `:NAME` of another of its placements.
    ///
    /// # Errors
    /// A folder that holds no result of a search; a search that found nothing.
    pub(crate) fn new(text: &str) -> Result<Self, RunError> {
        let (folder, name) = file_and_name(text);
        let folder = Path::new(folder);
        if !folder.is_dir() {
            return Ok(Self { text: text.to_owned(), run: None });
        }
        let placements = folder.join(PLACEMENTS).display().to_string();
        let has_result = folder.join(RESULT).is_file();
        if !has_result && folder.join(PLACEMENTS).is_file() {
            let name = name.map_or(String::new(), |name| format!(":{name}"));
            return Ok(Self { text: format!("{placements}{name}"), run: None });
        }
        let result = result_of(folder)?;
        let points = result["front"].as_array().map_or(&[][..], Vec::as_slice);
        let Some(name) = name.or_else(|| best_of(&result)) else {
            return Err(unnamed(folder, points, &result["picks"][0]["name"]));
        };
        // Baselines of a run are placements of a file like any other.
        let point = points.iter().find(|point| point["name"] == name);
        let best = Some(&result["best"]).filter(|best| best["placement"]["name"] == name);
        let run = point.or(best).map(|found| RunFound::new(folder, &result, found));
        Ok(Self { text: format!("{placements}:{name}"), run })
    }
}

/// Error for a folder whose result names no placement: a front has several, and a search may have found none.
fn unnamed(folder: &Path, points: &[Value], picked: &Value) -> RunError {
    let of = folder.display();
    let names: Vec<&str> = points.iter().filter_map(|point| point["name"].as_str()).collect();
    let Some(first) = picked.as_str().or(names.first().copied()) else {
        return RunError::Usage(format!(
            "{of}: its search found no placement; there is nothing to hand over"
        ));
    };
    let (count, more) = (names.len(), if names.len() > MOST_NAMED { ", …" } else { "" });
    let listed = names[..count.min(MOST_NAMED)].join(", ");
    RunError::Usage(format!(
        "{of}: holds a front of {count} placements, and one is handed over; name it behind a colon, as {of}:{first} (it \
         has {listed}{more})"
    ))
}

impl RunFound {
    /// A placement that a run found: its result, or a point of its front.
    fn new(folder: &Path, result: &Value, found: &Value) -> Self {
        let settings = &result["settings"];
        let path = |key: &str| settings[key].as_str().map(PathBuf::from);
        let tolerance = settings["tolerance"].as_str().and_then(|text| text.parse().ok());
        let required = found["scores"]["requirements"].as_array();
        let seed = result["seed"].as_u64().or(settings["search"]["seed"].as_u64());
        Self {
            folder: folder.to_owned(),
            vehicle: path("vehicle"),
            scene: path("scene").unwrap_or_default(),
            seed: seed.unwrap_or_default(),
            tolerance,
            required: required.into_iter().flatten().map(seen).collect(),
            hold_in: found["scores"]["requirements_hold_in"].as_f64(),
            words: words(result, found),
        }
    }
}

/// Lines about a placement of a run: the result, a line each guard with `BLIND` before a blind sector, and the command. Runs of older programs tell less.
fn words(result: &Value, found: &Value) -> Vec<String> {
    let verdict = result["verdict"].as_str().map(str::to_owned);
    let verdict = verdict.unwrap_or_else(|| of_point(found));
    let verdict = (!verdict.is_empty()).then(|| format!("Result: {verdict}"));
    let guards = found["scores"]["guards"].as_array();
    let guards = guards.into_iter().flatten().filter_map(Value::as_str);
    let command = result["command"].as_str().zip(result["backend"].as_str());
    let repeat = command.map(|(command, backend)| format!("Repeat: {command} --backend {backend}"));
    let guards = guards.map(|guard| match guard.strip_prefix(BLIND_SECTOR) {
        Some(sector) => format!("BLIND{sector}"),
        None => format!("Warning: {guard}"),
    });
    verdict.into_iter().chain(guards).chain(repeat).collect()
}

/// Sentence on a point of a front: requirements met, price, near gain, and the copies within the tolerance that meet all.
/// Requirements that it misses have lines of their own.
fn of_point(point: &Value) -> String {
    let Some(name) = point["name"].as_str() else { return String::new() };
    let scores = &point["scores"];
    let required: Vec<Seen> =
        scores["requirements"].as_array().into_iter().flatten().map(seen).collect();
    let met = required.iter().filter(|seen| seen.is_met()).count();
    let requirements = match (&required[..], required.len()) {
        ([], _) => "no requirement is set".to_owned(),
        ([one], _) if met == 1 => format!("meets its requirement ({})", one.title()),
        ([one], _) => format!("misses its requirement ({})", one.title()),
        (_, all) if met == all => format!("meets all {all} requirements"),
        (_, all) => format!("meets {met} of {all} requirements"),
    };
    let price = point["price"].as_f64().filter(|price| *price > 0.0);
    let price = price.map_or(String::new(), |price| format!(", price {}", rounded(price, 2)));
    let gain = scores["near_gain"].as_f64();
    let gain = gain.map_or(String::new(), |gain| format!(", near gain {:.2} %", 100.0 * gain));
    let copies = point["copies_that_meet_all"].as_f64().map_or(String::new(), |share| {
        let paper = if share < HOLDS { " (ON PAPER ONLY)" } else { "" };
        format!(
            ", {} % of copies mounted within the tolerance meet all{paper}",
            percent_down(share)
        )
    });
    format!("{name}: {requirements}{price}{gain}{copies}.")
}

/// A requirement as a result has it.
fn seen(of: &Value) -> Seen {
    let number = |key: &str| of[key].as_f64();
    let worst = of["worst_without"].as_u64().map(|lidar| lidar as usize);
    Seen {
        name: of["name"].as_str().unwrap_or_default().to_owned(),
        share: number("found").unwrap_or_default(),
        done: SEEN,
        least: number("required").unwrap_or_default(),
        missing: of["missing"].as_str().map(str::to_owned),
        holds_in: number("holds_in"),
        lost: number("intact").map(|intact| Lost { intact, worst, ..Lost::default() }),
        worst_frame: WorstFrame::deserialize(&of["worst_frame"]).ok(),
        places: RulePlaces::deserialize(&of["places"]).ok(),
        between: Between::deserialize(&of["between"]).ok(),
    }
}

/// The command that hands over one of several placements of a file.
pub(super) fn command(files: &[String], text: &str, name: &str) -> String {
    use crate::report::words::word;
    let scenes: String =
        files[..files.len() - 1].iter().map(|file| format!("{} ", word(file))).collect();
    let own = word(&format!("{}:{name}", file_and_name(text).0));
    format!("sightline rig handover {scenes}{own}")
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_point_of_a_front_has_its_result_in_words() {
        let requirement = |share: f64| json!({ "name": "car", "required": 0.9, "found": share });
        let mut point = json!({ "name": "front-2", "price": 11400.0, "copies_that_meet_all": 0.9712,
            "scores": { "near_gain": 0.56, "requirements": [requirement(1.0), requirement(0.95)] } });
        let facts = "price 11400, near gain 56.00 %";
        let copies = "97.1 % of copies mounted within the tolerance meet all";
        let words = format!("front-2: meets all 2 requirements, {facts}, {copies}.");
        assert_eq!(of_point(&point), words);
        point["copies_that_meet_all"] = json!(0.9);
        assert!(of_point(&point).ends_with(" meet all (ON PAPER ONLY)."));
        point["copies_that_meet_all"] = Value::Null;
        point["scores"]["requirements"][1] = requirement(0.5);
        assert_eq!(of_point(&point), format!("front-2: meets 1 of 2 requirements, {facts}."));
        point["scores"]["requirements"] = json!([requirement(0.5)]);
        point["price"] = json!(0.0);
        let words = "front-2: misses its requirement (car), near gain 56.00 %.";
        assert_eq!(of_point(&point), words);
        point["scores"] = json!({});
        assert_eq!(of_point(&point), "front-2: no requirement is set.");
        assert_eq!(self::words(&json!({}), &point)[0], "Result: front-2: no requirement is set.");
    }
}
