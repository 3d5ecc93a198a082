mod stability;

use std::path::PathBuf;
use std::process::ExitCode;

use serde_json::json;
use sightline::audit::{Trial, Verdict, gaming_placements, jittered, spearman};
use sightline::problem::Problem;
use sightline::problem::spread;
use sightline::psog::{Psog, Roi};
use sightline::scan::scan_scene;
use sightline::scene::{PsogSource, ScanSettings, Scene};
use sightline::score::Scores;
use sightline::search::Evaluator;
use sightline::vehicle::{Placement, read_placements};

use super::args::{Compute, Format};
use super::error::Error;
use super::{load, optimize, progress, table};
use stability::{Ranking, Stability, preferred, value_of};

/// Exit code of a check that failed.
const FAILED: u8 = 1;
/// Frames to average over where nothing else is said.
const FRAMES: u32 = 2;
/// Mountings that are drawn within the tolerance.
const MOUNTINGS: u64 = 12;
/// Mounting tolerance: a millimetre and a tenth of a degree.
const TOLERANCE: (f64, f64) = (1e-3, 0.1 * std::f64::consts::PI / 180.0);
/// Ranges in metres to which the visibility is cut.
const VISIBILITIES: [f32; 3] = [10.0, 20.0, 40.0];

#[derive(clap::Args)]
#[command(after_help = "Example:\n  sightline audit scenes/highway.json")]
pub struct Args {
    /// Scene file
    scene: PathBuf,
    /// Honest placements; of those without a violated guard, the first that gains most is the base [default: Table 7 of the paper]
    placements: Option<PathBuf>,
    /// Frames to average over, spread evenly over the scene [default: 2]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// How to print
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    compute: Compute,
}

pub fn run(args: &Args) -> Result<ExitCode, Error> {
    args.compute.start()?;
    let honest = match &args.placements {
        Some(path) => read_placements(path)?,
        None => optimize::table_7()?,
    };
    let wanted = args.frames.unwrap_or(FRAMES);
    let mut loaded = load::scene(&args.scene, Some(wanted), &args.compute)?;
    load::note_frames(&loaded.scene, args.frames, args.compute.talk);
    let bar = progress::bar(4, "parts", args.compute.talk);
    let scores = loaded.evaluator.scores(&honest)?;
    let gain = |s: &Scores| s.segmentation.information_gain.unwrap_or(0.0);
    let best = preferred(&scores, gain).unwrap_or(0);
    let (base, base_scores) = (&honest[best], &scores[best]);
    bar.inc(1);

    let mut trials = Vec::new();
    for (name, placement) in gaming_placements(base) {
        let scores = loaded.evaluator.scores(std::slice::from_ref(&placement))?.remove(0);
        trials.push(Trial::new(name, base_scores, scores));
    }
    for metres in VISIBILITIES {
        let scores = loaded.evaluator.scores_at(std::slice::from_ref(base), metres)?.remove(0);
        trials.push(Trial::new(&format!("visibility cut to {metres} m"), base_scores, scores));
    }
    bar.inc(1);

    let ranking = Ranking { honest: &honest, before: &scores, base: best };
    let mut rows = Vec::new();
    let mut draws = Vec::new();
    for seed in 0..MOUNTINGS {
        let mounted: Vec<Placement> =
            honest.iter().map(|p| jittered(p, TOLERANCE.0, TOLERANCE.1, 1000 + seed)).collect();
        draws.push(loaded.evaluator.scores(&mounted)?);
    }
    rows.push(ranking.under("mounted within 1 mm and 0.1°", &draws));
    let step = std::f64::consts::TAU / azimuth_steps(&loaded.scene);
    let turned: Vec<Placement> = honest
        .iter()
        .map(|p| {
            let mut p = p.clone();
            p.lidars.iter_mut().for_each(|l| l.yaw += 0.5 * step);
            p
        })
        .collect();
    let scored = loaded.evaluator.scores(&turned)?;
    rows.push(ranking.under("azimuth phase by half a step", &[scored]));
    bar.inc(1);
    for (name, psog, frames) in changed_worlds(&loaded.scene, &loaded.psog, wanted)? {
        let mut evaluator = audited(&loaded.scene, &psog, &frames, args)?;
        rows.push(ranking.under(&name, &[evaluator.scores(&honest)?]));
    }
    bar.finish_and_clear();

    let values: Vec<f64> = scores.iter().map(value_of).collect();
    let null = spearman(&values, &ranking.heights());
    let passed = trials.iter().all(|t| t.verdict != Verdict::Fooled);
    match args.format {
        Format::Json => outln!(
            "{}",
            json!({
                "scene": loaded.scene.name(),
                "base": base_scores,
                "trials": trials,
                "stability": rows.iter().map(Stability::json).collect::<Vec<_>>(),
                "ranking_against_mean_height": null,
                "passed": passed,
            })
        )?,
        Format::Text => print_text(&loaded.scene, base_scores, &trials, &rows, null, passed)?,
    }
    Ok(if passed { ExitCode::SUCCESS } else { ExitCode::from(FAILED) })
}

fn azimuth_steps(scene: &Scene) -> f64 {
    match scene.lidar() {
        sightline::vehicle::Lidar::Spinning { azimuth_steps, .. } => f64::from(*azimuth_steps),
        sightline::vehicle::Lidar::Directions { directions, .. } => directions.len() as f64,
    }
}

fn audited(scene: &Scene, psog: &Psog, frames: &[usize], args: &Args) -> Result<Evaluator, Error> {
    let table = scene.lidar().table()?;
    let problem = Problem::on_grid_of(psog, scene, table, frames)?;
    let quiet =
        Compute { talk: super::args::Talk { quiet: true, verbose: false }, ..args.compute.clone() };
    load::evaluator(problem, &quiet)
}

/// (change, P-SOG, frames): the same scene seen through another model of it.
fn changed_worlds(
    scene: &Scene,
    psog: &Psog,
    frames: u32,
) -> Result<Vec<(String, Psog, Vec<usize>)>, Error> {
    let all = spread(scene.frame_count(), Some(frames));
    let half = spread(scene.frame_count(), Some((all.len() as u32).div_ceil(2)));
    let mut worlds = Vec::new();
    if all.len() > 1 {
        worlds.push(("frames halved".to_owned(), psog.clone(), half));
    }
    let mut largest: Vec<u64> = vec![0; psog.classes().len()];
    for row in psog.rows() {
        for (sum, &count) in largest.iter_mut().zip(row) {
            *sum += u64::from(count);
        }
    }
    let class = (0..largest.len()).max_by_key(|&c| largest[c]).unwrap_or(0);
    let name = psog.classes()[class].clone();
    worlds.push((
        format!("class {name} absent"),
        with_rows(psog, |row| row[class] = 0)?,
        all.clone(),
    ));
    let tied = with_rows(psog, |row| {
        // Half of the frames of the commonest class go to its neighbour.
        let top = (0..row.len()).max_by_key(|&c| row[c]).unwrap_or(0);
        let moved = row[top] / 2;
        row[top] -= moved;
        let next = (top + 1) % row.len();
        row[next] += moved;
    })?;
    worlds.push(("votes tied between two classes".to_owned(), tied, all.clone()));
    if scene.has_geometry() {
        let settings = match scene.psog_source() {
            PsogSource::Scan(settings) => *settings,
            PsogSource::File(_) => ScanSettings::default_of(scene),
        };
        let bounds = scene.roi();
        let (min, max, voxel) = (bounds.min, bounds.max, bounds.voxel);
        let shifted = [0, 1, 2].map(|k| min[k] - 0.5 * voxel[k]);
        let inner = |corner: [f64; 3]| [0.75 * corner[0], 0.75 * corner[1], corner[2]];
        let rois = [
            ("grid shifted by half a voxel", Roi::new(shifted, voxel, bounds.shape)?),
            ("voxels twice as large", Roi::from_bounds(min, max, voxel.map(|v| 2.0 * v))?),
            ("region of three quarters", Roi::from_bounds(inner(min), inner(max), voxel)?),
        ];
        for (name, roi) in rois {
            let (psog, _) = scan_scene(scene, &roi, &settings, || {})?;
            worlds.push((name.to_owned(), psog, all.clone()));
        }
    }
    Ok(worlds)
}

fn with_rows(psog: &Psog, change: impl Fn(&mut [u16])) -> Result<Psog, Error> {
    let mut counts = psog.counts().to_vec();
    counts.chunks_mut(psog.classes().len()).for_each(change);
    let (roi, frames) = (*psog.roi(), psog.frames());
    Ok(Psog::new(roi, frames, psog.classes().to_vec(), psog.index().to_vec(), counts)?)
}

fn print_text(
    scene: &Scene,
    base: &Scores,
    trials: &[Trial],
    stability: &[Stability],
    null: Option<f64>,
    passed: bool,
) -> Result<(), Error> {
    outln!("{}: attempts to look better than {} while seeing less", scene.name(), base.name)?;
    let metrics = ["M-SOG", "M-SOG/N ×1e-6", "det ×1e-6", "gain nats", "S-MIG"];
    let titles = [&["attempt"][..], &metrics, &["verdict", "looks better by", "guards"]].concat();
    let mut rows = vec![titles.into_iter().map(str::to_owned).collect::<Vec<_>>()];
    rows.push(cells(&base.name, base));
    for trial in trials {
        let mut row = cells(&trial.name, &trial.scores);
        row.push(
            match trial.verdict {
                Verdict::NotFooled => "not fooled",
                Verdict::Caught => "caught",
                Verdict::Fooled => "FOOLED",
            }
            .to_owned(),
        );
        row.push(trial.fooled.join(", "));
        row.push(guard_names(&trial.scores));
        rows.push(row);
    }
    out!("{}", table::align(&rows))?;
    outln!(
        "\n{} under changes of the model, and m_sog_scaled of all honest placements: its change and \
         Kendall's τ with the unchanged ranking (median and worst), Spearman with mean height alone",
        base.name
    )?;
    let changes = ["median %", "worst %", "τ median", "τ worst", "height", "first", "guards"];
    let titles = [&["change"][..], &metrics, &changes].concat();
    let mut rows = vec![titles.into_iter().map(str::to_owned).collect::<Vec<_>>()];
    let two = |v: Option<f64>| v.map_or("–".into(), |v| format!("{v:.2}"));
    let mut none = cells("none", base);
    none.extend([String::new(), String::new(), String::new(), String::new(), two(null)]);
    rows.push(none);
    rows.extend(stability.iter().map(|change| {
        let mut row = cells(&change.name, &change.base);
        row.extend([
            format!("{:.2}", 100.0 * change.median),
            format!("{:.2}", 100.0 * change.worst),
            two(change.median_tau),
            two(change.worst_tau),
            two(change.null),
            change.first.clone(),
            guard_names(&change.base),
        ]);
        row
    }));
    out!("{}", table::align(&rows))?;
    outln!("{}", if passed { "\npassed" } else { "\nFAILED: a score was fooled unnoticed" })
}

/// A name and the value of each metric.
fn cells(name: &str, scores: &Scores) -> Vec<String> {
    let number = |v: Option<f64>, factor: f64, decimals: usize| {
        v.map_or("–".into(), |v| format!("{:.decimals$}", v * factor))
    };
    vec![
        name.to_owned(),
        number(scores.segmentation.m_sog, 1.0, 4),
        number(scores.segmentation.m_sog_scaled, 1e6, 3),
        number(scores.detection.and_then(|d| d.m_sog_scaled), 1e6, 3),
        number(scores.segmentation.information_gain, 1.0, 0),
        number(scores.s_mig, 1.0, 0),
    ]
}

/// Names of the guards that speak against a placement.
fn guard_names(scores: &Scores) -> String {
    let guards = scores.guards.iter().map(ToString::to_string);
    let mut names: Vec<_> = guards.filter_map(|g| g.split(':').next().map(str::to_owned)).collect();
    names.dedup();
    names.join(", ")
}
