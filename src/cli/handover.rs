//! `sightline rig handover`: the folder of a rig for those who build, calibrate and simulate it.

use std::path::PathBuf;

use serde_json::json;

use crate::runs::RunError;
use crate::runs::handover::{HandoverRequest, handover};

use super::args::{Compute, Format, UnnamedModelArgs};
use super::exit::Exit;
use super::rig::base_link;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline rig handover runs/mine/placements.json:optimized --vehicle van.json --out handover
  sightline rig handover scenes/urban-crossing.json scenes/placements.json:Center --frame 3 --out handover

The folder has poses in millimetres and degrees beside metres and radians, the bill of materials, for each LiDAR a mask
of its beams that end at the own body, crop boxes in Autoware's parameters, a drawing as SVG and PDF, and a profile of
each sensor model for Isaac Sim. README.txt in it says the conventions.")]
pub struct HandoverArgs {
    /// A scene, none for level ground, and placements, with the name of one of them where there are several
    #[arg(value_name = "[SCENE] PLACEMENTS[:NAME]", required = true, num_args = 1..)]
    files: Vec<String>,
    /// Folder to write, new or empty
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Frame of the scene, from 0
    #[arg(long, default_value_t = 0, value_name = "T")]
    frame: u32,
    /// Metres that crop boxes reach beyond the own body
    #[arg(long, default_value_t = 0.05, value_name = "METRES", value_parser = margin)]
    margin: f64,
    /// Position of base_link in the ego frame, in metres [default: 0,0,0]
    #[arg(long, value_name = "X[,Y,Z]", value_parser = base_link, allow_hyphen_values = true)]
    base_link: Option<[f64; 3]>,
    /// How to print the summary
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    named: UnnamedModelArgs,
    #[command(flatten)]
    compute: Compute,
}

fn margin(text: &str) -> Result<f64, String> {
    let found = text.trim().parse().ok().filter(|metres| (0.0..=10.0).contains(metres));
    found.ok_or("give metres from 0 to 10".to_owned())
}

pub fn run(args: &HandoverArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let request = HandoverRequest {
        files: args.files.clone(),
        out: args.out.clone(),
        frame: args.frame,
        margin: args.margin,
        base_link: args.base_link.unwrap_or_default(),
    };
    let made = handover(&request, &args.named.computing(&args.compute, &terminal))?;
    match args.format {
        Format::Json => outln!("{}", json!(made))?,
        Format::Text => {
            let (placement, price) = (&made.placement, made.price);
            let priced = if price > 0.0 { format!(", sensors for {price}") } else { String::new() };
            outln!("{}: {} files of {placement}{priced}", made.out.display(), made.files.len())?;
            for (k, [own, all]) in made.own_beams.iter().enumerate() {
                let share = 100.0 * *own as f64 / *all as f64;
                outln!("  LiDAR {k}: {own} of {all} beams end at the own body, {share:.1} %")?;
            }
        }
    }
    Ok(terminal.exit())
}
