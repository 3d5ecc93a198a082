//! `scene info`: what scenes hold, counted.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::internals::align_columns;
use crate::psog::{Psog, PsogInfo};
use crate::scan::BeamHits;
use crate::scene::EgoBody;
use crate::{Evaluator, Placement, Problem, SensorPose};
use serde::Serialize;
use serde_json::json;

use crate::cli::args::{Format, Talk};
use crate::cli::error::Error;
use crate::cli::{load, progress};

/// Upper ends of the classes of range, metres.
const RANGES: [f32; 5] = [5.0, 10.0, 20.0, 40.0, f32::INFINITY];
const RANGE_NAMES: [&str; 5] = ["0–5 m", "5–10 m", "10–20 m", "20–40 m", "over 40 m"];

#[derive(clap::Args)]
#[command(after_help = "Example:\n  sightline scene info scenes/highway.json town.json")]
pub struct Args {
    /// Scene files with geometry
    #[arg(required = true)]
    scenes: Vec<PathBuf>,
    /// How to print
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    talk: Talk,
}

/// What one scene holds.
#[derive(Debug, Serialize)]
struct Facts {
    name: String,
    frames: usize,
    /// Of a frame, the ego's body among them.
    triangles: usize,
    actors: BTreeMap<String, usize>,
    /// Metres between the ego's first and last place.
    ego_way: f64,
    /// Occupied voxels of the P-SOG.
    occupied: u64,
    /// Percent of the classes' voxels, by class.
    voxel_share: BTreeMap<String, f64>,
    /// Entropy of the P-SOG in nats.
    entropy: f64,
    /// Percent of the reference LiDAR's beams that hit nothing.
    lost: f64,
    /// Percent of its hits in each class of range.
    hits_by_range: [f64; 5],
}

pub fn run(args: &Args) -> Result<(), Error> {
    let facts = args.scenes.iter().map(|path| facts(path, args.talk));
    let facts = facts.collect::<Result<Vec<Facts>, Error>>()?;
    match args.format {
        Format::Json => outln!("{}", json!(facts))?,
        Format::Text => out!("{}", table(&facts))?,
    }
    Ok(())
}

fn facts(path: &Path, talk: Talk) -> Result<Facts, Error> {
    let scene = load::read(path, None, talk)?;
    if !scene.has_geometry() {
        return Err(Error::Usage(format!(
            "{}: has no geometry to count; add static shapes or actors",
            path.display()
        )));
    }
    let frames = scene.frame_count();
    let bar = progress::bar(frames as u64, "frames scanned for the P-SOG", talk);
    let psog = Psog::of(&scene, || bar.inc(1))?;
    bar.finish_and_clear();
    let info = PsogInfo::new(&psog, None);
    let soup = scene.frame(0, EgoBody::Include);
    let mut actors = BTreeMap::new();
    for track in scene.tracks() {
        *actors.entry(track.kind.name().to_owned()).or_default() += 1;
    }
    let all: Vec<usize> = (0..frames).collect();
    let problem = Problem::with_psog(&scene, &psog, &all)?;
    let (lost, hits_by_range) = hits(problem, &soup.face_class, frames)?;
    let votes: u64 = info.classes.iter().map(|c| c.voxels).sum();
    let share = |voxels: u64| 100.0 * voxels as f64 / votes.max(1) as f64;
    let seen = info.classes.iter().filter(|c| c.voxels > 0);
    let way = scene.ego_pose(frames - 1).translation - scene.ego_pose(0).translation;
    Ok(Facts {
        name: scene.name().to_owned(),
        frames,
        triangles: soup.faces.len(),
        actors,
        ego_way: way.length(),
        occupied: info.occupied,
        voxel_share: seen.map(|c| (c.name.clone(), share(c.voxels))).collect(),
        entropy: info.entropy_segmentation,
        lost,
        hits_by_range,
    })
}

/// Percent of beams without a hit, and of hits by range: one LiDAR above the origin, in the middle of
/// the first mount in height, in all frames. Hits on the ego's own body are left out.
fn hits(problem: Problem, classes: &[u16], frames: usize) -> Result<(f64, [f64; 5]), Error> {
    let [low, high] = problem.constraints().corners();
    let z = 0.5 * (low[2] + high[2]);
    let pose = SensorPose { z, ..SensorPose::default() };
    let placement = Placement { name: "middle".to_owned(), lidars: vec![pose] };
    let mut evaluator = Evaluator::on_cpu(problem.clone());
    let (mut beams, mut count) = (0, [0_usize; 5]);
    for t in 0..frames {
        let problem = problem.over(&[t]);
        let columns = BeamHits::of(std::slice::from_ref(&placement), &problem, classes, |poses| {
            evaluator.backend_mut().hits(poses, t)
        })?;
        beams += columns.beams();
        for distance in columns.distance.iter().filter(|d| d.is_finite()) {
            count[RANGES.partition_point(|end| end <= distance).min(4)] += 1;
        }
    }
    let hits: usize = count.iter().sum();
    let percent = |n: usize, of: usize| 100.0 * n as f64 / of.max(1) as f64;
    Ok((percent(beams - hits, beams), count.map(|n| percent(n, hits))))
}

/// A column a scene.
fn table(facts: &[Facts]) -> String {
    let row = |name: &str, value: &dyn Fn(&Facts) -> String| {
        std::iter::once(name.to_owned()).chain(facts.iter().map(value)).collect::<Vec<String>>()
    };
    let mut rows = vec![
        row("", &|f| f.name.clone()),
        row("frames", &|f| f.frames.to_string()),
        row("ego drives, m", &|f| format!("{:.0}", f.ego_way)),
        row("triangles", &|f| f.triangles.to_string()),
    ];
    let union = |of: &dyn Fn(&Facts) -> Vec<String>| {
        facts.iter().flat_map(of).collect::<std::collections::BTreeSet<String>>()
    };
    for kind in union(&|f| f.actors.keys().cloned().collect()) {
        rows.push(row(&kind, &|f| f.actors.get(&kind).copied().unwrap_or(0).to_string()));
    }
    rows.push(row("occupied voxels", &|f| f.occupied.to_string()));
    rows.push(row("entropy, nats", &|f| format!("{:.0}", f.entropy)));
    for class in union(&|f| f.voxel_share.keys().cloned().collect()) {
        let share = |f: &Facts| f.voxel_share.get(&class).copied().unwrap_or(0.0);
        rows.push(row(&format!("{class}, % of voxels"), &|f| format!("{:.2}", share(f))));
    }
    rows.push(row("beams without a hit, %", &|f| format!("{:.1}", f.lost)));
    for (k, name) in RANGE_NAMES.iter().enumerate() {
        rows.push(row(&format!("hits at {name}, %"), &|f| format!("{:.1}", f.hits_by_range[k])));
    }
    align_columns(&rows)
}
