//! `sightline study nearfield`: what a placement sees of the ground and of poles near the vehicle.

use std::path::PathBuf;

use crate::internals::{near_field_csv, near_field_text};
use crate::runs::near_field::{NearFieldRequest, near_fields};
use crate::runs::{RunError, TableFormat};
use crate::scan::conditions::under;

use super::answer::answer;
use super::args::{Compute, Conditions, FiguresOut, UnnamedModelArgs};
use super::exit::Exit;

#[derive(clap::Args)]
#[command(after_help = "Example:
  sightline study nearfield scenes/urban-crossing.json scenes/placements.json --out near.svg

near %: ground cells within 10 m of the body with a hit within 0.5 m; poles: seen of all, by standard, at
five beams or more; own body %: beams that end at the own vehicle. docs/nearfield.md has the definitions.")]
pub struct NearFieldArgs {
    /// Scene file; it must have geometry and an own body
    scene: PathBuf,
    /// Placements [default: Table 7 of the paper, where the vehicle is its car: one model, a mount that holds them]
    placements: Option<PathBuf>,
    /// Draw blind zones and poles from above into this SVG file
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Average over this many frames, spread evenly over the scene [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// How to print the result
    #[arg(long, value_enum, default_value_t)]
    format: TableFormat,
    #[command(flatten)]
    figures: FiguresOut,
    #[command(flatten)]
    conditions: Conditions,
    #[command(flatten)]
    named: UnnamedModelArgs,
    #[command(flatten)]
    compute: Compute,
}

pub fn run(args: &NearFieldArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let request = NearFieldRequest {
        scene: args.scene.clone(),
        placements: args.placements.clone(),
        out: args.out.clone(),
        figures: args.figures.figures.clone(),
        frames: args.frames,
        conditions: args.conditions.condition.clone(),
    };
    let found = near_fields(&request, &args.named.computing(&args.compute, &terminal))?;
    answer(
        args.format,
        &found,
        || near_field_csv(&found.near_fields),
        || {
            let (scene, area, frames) = (&found.scene, found.ground_area, found.frames);
            let under = under(&found.conditions);
            outln!("{scene}: {area:.0} m² of ground within 10 m, {frames} frame(s){under}")?;
            out!("{}", near_field_text(&found.near_fields))
        },
    )?;
    Ok(terminal.exit())
}
