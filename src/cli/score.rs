use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use npyz::WriterBuilder;
use serde_json::json;
use sightline::search::Evaluator;
use sightline::vehicle::{Placement, PlacementFileError, PlacementReader};

use super::args::{Compute, Format};
use super::error::Error;
use super::load::{self, Loaded};
use super::output::{shared_folder, unless_closed, writable_file, write_whole};
use super::{progress, table};

/// Placements that are read, scored and printed at a time.
const BLOCK: usize = 1024;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline score scenes/highway.json scenes/placements.json
  sightline score scenes/highway.json million.jsonl --format json --out scores.json")]
pub struct Args {
    /// Scene file
    scene: PathBuf,
    /// Placements: a .json document, or a .jsonl file with one placement a line, read as a stream; - is
    /// stdin
    placements: PathBuf,
    /// How to print
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    /// Write the scores to this file instead of stdout
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write the covered voxels of each placement to DIR/NAME.npy: u64 linear indices, rising; with
    /// several frames, voxels covered in at least one
    #[arg(long, value_name = "DIR")]
    coverage_out: Option<PathBuf>,
    /// Average over this many frames, spread evenly over the scene [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    #[command(flatten)]
    compute: Compute,
}

pub fn run(args: &Args) -> Result<ExitCode, Error> {
    let start = Instant::now();
    args.compute.start()?;
    // Everything that can be wrong is found before the first score is computed or printed; a pipe can
    // be read only once.
    let is_file = args.placements != Path::new("-") && args.placements.is_file();
    let total = if is_file { count_placements(&args.placements)? } else { 0 };
    let loaded = load::scene(&args.scene, args.frames, &args.compute)?;
    load::note_frames(&loaded.scene, args.frames, args.compute.talk);
    if let Some(file) = &args.out {
        writable_file(file, loaded.inputs(&args.placements))?;
    }
    if let Some(folder) = &args.coverage_out {
        shared_folder(folder)?;
    }
    match &args.out {
        Some(path) => write_whole(path, |file| print(args, loaded, total, start, path, file)),
        None => {
            let path = Path::new("stdout");
            let mut out = std::io::stdout().lock();
            unless_closed(print(args, loaded, total, start, path, &mut out))
        }
    }?;
    Ok(ExitCode::SUCCESS)
}

/// Reads and checks the whole file once; a stream is not kept.
fn count_placements(path: &Path) -> Result<u64, Error> {
    let mut count = 0;
    for placement in PlacementReader::open(path)? {
        placement?;
        count += 1;
    }
    if count == 0 {
        return Err(PlacementFileError::Empty { path: path.to_owned() }.into());
    }
    Ok(count)
}

fn print(
    args: &Args,
    loaded: Loaded,
    total: u64,
    start: Instant,
    path: &Path,
    out: &mut dyn Write,
) -> Result<(), Error> {
    let io = |error| Error::io(path)(error);
    let format = args.format;
    let Loaded { scene, mut evaluator, times, .. } = loaded;
    let (bar, mut count) = (progress::bar(total, "placements", args.compute.talk), 0);
    let mut reader = PlacementReader::open(&args.placements)?.peekable();
    let mut first = true;
    while reader.peek().is_some() {
        let block: Result<Vec<Placement>, _> = reader.by_ref().take(BLOCK).collect();
        if block.is_err() && count > 0 && args.out.is_none() {
            // Of a stream only: a file was read to its end before.
            let words = format!("only the scores of the first {count} placements were printed");
            args.compute.talk.note(words);
        }
        let block = block?;
        let scores = evaluator.scores(&block)?;
        if first {
            // Not before the first scores: what cannot be computed prints nothing.
            print_head(scene.name(), &evaluator, format, out).map_err(io)?;
        }
        if let Some(folder) = &args.coverage_out {
            for placement in &block {
                write_coverage(folder, placement, &mut evaluator)?;
            }
        }
        if format == Format::Json {
            for score in &scores {
                let line = serde_json::to_string(score)
                    .map_err(|source| Error::Json { path: path.to_owned(), source })?;
                write!(out, "{}\n{line}", if first { "" } else { "," }).map_err(io)?;
                first = false;
            }
        } else {
            let text = table::scores(&scores);
            let body = if first { &text } else { text.split_once('\n').map_or("", |t| t.1) };
            write!(out, "{body}").map_err(io)?;
            first = false;
        }
        count += block.len() as u64;
        bar.set_length(total.max(count));
        bar.set_position(count);
    }
    if first {
        return Err(PlacementFileError::Empty { path: args.placements.clone() }.into());
    }
    bar.finish_and_clear();
    let stages = evaluator.backend().times();
    let total_seconds = start.elapsed().as_secs_f64();
    let search_seconds = total_seconds - times.load - times.build;
    let frames = evaluator.problem().frame_count() as u64;
    args.compute.talk.note(format!(
        "{count} placements × {frames} frame(s) in {search_seconds:.2} s: {:.1} placements × frames/s",
        (count * frames) as f64 / search_seconds
    ));
    if format == Format::Json {
        let timings = json!({
            "load": times.load,
            "build": times.build,
            "cast": stages.cast.as_secs_f64(),
            "cover": stages.cover.as_secs_f64(),
            "reduce": stages.reduce.as_secs_f64(),
            "total": total_seconds,
        });
        let changes = evaluator.backend().changes();
        if !changes.is_empty() {
            // The head was printed before it came to this.
            write!(out, "\n],\"backend_changes\":{}", json!(changes)).map_err(io)?;
        } else {
            write!(out, "\n]").map_err(io)?;
        }
        writeln!(out, ",\"timings\":{timings}}}").map_err(io)?;
    }
    out.flush().map_err(io)
}

/// What comes before the scores; in JSON the object is left open, since the timings follow them.
fn print_head(
    scene: &str,
    evaluator: &Evaluator,
    format: Format,
    out: &mut dyn Write,
) -> std::io::Result<()> {
    let problem = evaluator.problem();
    if format == Format::Json {
        let head = json!({
            "scene": scene,
            "backend": evaluator.backend().name(),
            "adapter": evaluator.backend().adapter(),
            "coverage": load::coverage_name(problem),
            "frames": problem.frame_count(),
            "modelled": problem.modelled(),
            "threads": rayon::current_num_threads(),
        });
        let head = head.to_string();
        write!(out, "{},\"scores\":[", &head[..head.len() - 1])
    } else {
        writeln!(
            out,
            "{scene}: {} over {} frame(s), {} beams a LiDAR",
            load::coverage_name(problem),
            problem.frame_count(),
            problem.table().directions().len()
        )
    }
}

fn write_coverage(
    folder: &Path,
    placement: &Placement,
    evaluator: &mut Evaluator,
) -> Result<(), Error> {
    let mut union = BTreeSet::new();
    let frames = evaluator.problem().frame_count();
    let mut covered = Vec::new();
    for frame in 0..frames {
        covered = evaluator.backend_mut().covered(placement, frame)?;
        if frames > 1 {
            union.extend(covered.iter().copied());
        }
    }
    if frames > 1 {
        covered = union.into_iter().collect();
    }
    let path = folder.join(format!("{}.npy", placement.name));
    write_whole(&path, |file| {
        let shape = [covered.len() as u64];
        let mut array = npyz::WriteOptions::new()
            .default_dtype()
            .shape(&shape)
            .writer(file)
            .begin_nd()
            .map_err(Error::io(&path))?;
        array.extend(covered).map_err(Error::io(&path))?;
        array.finish().map_err(Error::io(&path))
    })
}
