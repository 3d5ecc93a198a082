//! `sightline audit`: attempts to fool the scores, and rankings under changes of the model, scene by scene.

use std::path::PathBuf;

use crate::audit::Audit;
use crate::internals::{audit_text, audits_text};
use crate::runs::RunError;
use crate::runs::audit::{AuditRequest, audit_scenes};
use crate::score::Objective;
use serde_json::json;

use super::args::{Compute, Format, UnnamedModelArgs};
use super::exit::Exit;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline audit scenes/highway.json
  sightline audit scenes/highway.json scenes/residential.json scenes/placements.json")]
pub struct AuditArgs {
    /// Scene files, and placements to start from, which should be sound ones: the best of them is changed so
    /// that it sees less, and no score may rise unnoticed [default: Table 7 of the paper]
    #[arg(value_name = "SCENE… [PLACEMENTS]", required = true)]
    files: Vec<PathBuf>,
    /// Score by which the best placement is chosen, and that is watched while the model changes
    #[arg(long, default_value_t = Objective::default().to_string())]
    objective: String,
    /// Frames to average over, spread evenly over the scene [default: 2]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// How to print
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    named: UnnamedModelArgs,
    #[command(flatten)]
    compute: Compute,
}

pub fn run(args: &AuditArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let request = AuditRequest {
        files: args.files.clone(),
        objective: Some(args.objective.clone()),
        frames: args.frames,
    };
    let mut gap = "";
    let print = |found: &Audit| match args.format {
        Format::Json => Ok(()),
        Format::Text => out!("{}{}", std::mem::replace(&mut gap, "\n"), audit_text(found)),
    };
    let all = audit_scenes(&request, &args.named.computing(&args.compute, &terminal), print)?;
    let passed = all.iter().all(|found| found.passed);
    match (args.format, &all[..]) {
        (Format::Json, [found]) => outln!("{}", json!(found))?,
        (Format::Json, all) => outln!("{}", json!({ "scenes": all, "passed": passed }))?,
        (Format::Text, [_]) => {}
        (Format::Text, all) => out!("{}", audits_text(all))?,
    }
    Ok(if passed { Exit::Done } else { Exit::CheckFailed })
}
