//! `sightline study nearfield`: what a placement sees of the ground and of poles near the vehicle.

use std::io::Write;
use std::path::{Path, PathBuf};

use crate::internals::{near_field_svg, near_field_text, writable_file, write_whole};
use crate::near_field::{NearField, NearSite};
use crate::problem::{Problem, spread};
use crate::psog::Psog;
use crate::scene::Scene;
use crate::search::Evaluator;
use crate::vehicle::{Placement, read_placements, table_7};
use serde_json::json;

use super::args::{Compute, Format};
use super::error::Error;
use super::exit::Exit;
use super::interrupt::Interrupt;
use super::{load, progress};

#[derive(clap::Args)]
#[command(after_help = "Example:
  sightline study nearfield scenes/urban-crossing.json scenes/placements.json --out near.svg

near %: ground cells within 10 m of the body with a hit within 0.5 m; poles: seen of all, by standard, at
five beams or more; own body %: beams that end at the own vehicle. docs/nearfield.md has the definitions.")]
pub struct Args {
    /// Scene file; it must have geometry and an own body
    scene: PathBuf,
    /// Placements [default: Table 7 of the paper]
    placements: Option<PathBuf>,
    /// Draw blind zones and poles from above into this SVG file
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Average over this many frames, spread evenly over the scene [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// How to print the result
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    compute: Compute,
}

pub fn run(args: &Args) -> Result<Exit, Error> {
    args.compute.start()?;
    let talk = args.compute.talk;
    let placements = args.placements.as_deref().map_or_else(|| Ok(table_7()), read_placements)?;
    let scene = load::read(&args.scene, args.compute.vehicle.as_deref(), talk)?;
    load::note_frames(&scene, args.frames, talk);
    if let Some(file) = &args.out {
        let inputs = scene.files().iter().map(PathBuf::as_path);
        writable_file(file, inputs.chain(args.placements.as_deref()))?;
    }
    let mut evaluator = load::evaluator(problem(&scene, &args.scene, args.frames)?, &args.compute)?;
    let site = NearSite::new(&scene, &evaluator.shared_problem())?;
    let interrupt = Interrupt::listen(talk);
    let bar = progress::bar(placements.len() as u64, "placements", talk);
    let mut all = Vec::new();
    for placement in placements.iter().take_while(|_| !interrupt.is_set()) {
        all.push(look(&site, &mut evaluator, placement)?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    if let Some(file) = &args.out {
        let drawn: Vec<(&Placement, &NearField)> = placements.iter().zip(&all).collect();
        let svg = near_field_svg(site.footprint(), &drawn);
        write_whole(file, |out| out.write_all(svg.as_bytes()).map_err(Error::io(file)))?;
    }
    let frames = evaluator.problem().frame_count();
    match args.format {
        Format::Json => outln!(
            "{}",
            json!({
                "scene": scene.name(),
                "frames": frames,
                "footprint": site.footprint(),
                "ground_area": site.ground_area(),
                "near_fields": all,
            })
        )?,
        Format::Text => {
            let area = site.ground_area();
            outln!("{}: {area:.0} m² of ground within 10 m, {frames} frame(s)", scene.name())?;
            out!("{}", near_field_text(&all))?;
        }
    }
    Ok(if interrupt.is_set() { Exit::Interrupted } else { Exit::Done })
}

fn look(
    site: &NearSite,
    evaluator: &mut Evaluator,
    placement: &Placement,
) -> Result<NearField, Error> {
    Ok(site.look(evaluator.backend_mut(), placement)?)
}

/// The scene's geometry over some frames; its P-SOG is not needed and stays empty.
fn problem(scene: &Scene, path: &Path, frames: Option<u32>) -> Result<Problem, Error> {
    if !scene.has_geometry() {
        return Err(Error::Usage(format!(
            "{}: has no geometry to cast into; add static shapes, actors and an ego body",
            path.display()
        )));
    }
    let psog = Psog::new(scene.roi().grid()?, 1, scene.classes().to_vec(), vec![], vec![])?;
    Ok(Problem::with_psog(scene, &psog, &spread(scene.frame_count(), frames))?)
}
