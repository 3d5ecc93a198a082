//! `devices`: the Vulkan devices, how they compute, and the one that `auto` takes.

use crate::engine::gpu::{TestedAdapter, test_adapters};
use crate::internals::align_columns;

use super::args::Format;
use super::exit::Exit;
use crate::runs::RunError;

#[derive(clap::Args)]
#[command(after_help = "Example:\n  sightline devices")]
pub struct DevicesArgs {
    /// How to print
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

pub fn run(args: &DevicesArgs) -> Result<Exit, RunError> {
    let adapters = test_adapters();
    match args.format {
        Format::Json => outln!("{}", serde_json::json!({ "devices": adapters }))?,
        Format::Text if adapters.is_empty() => {
            outln!("no Vulkan device: --backend auto computes on the CPU")?;
        }
        Format::Text => {
            let titles = [
                "device",
                "kind",
                "driver",
                "max binding",
                "max workgroup",
                "self-test",
                "product + sum",
                "division",
                "denormals",
                "auto",
            ];
            let mut rows = vec![titles.map(str::to_owned).to_vec()];
            rows.extend(adapters.iter().map(row));
            out!("{}", align_columns(&rows))?;
            for TestedAdapter { summary, refused, .. } in &adapters {
                if let Some(why) = refused {
                    let name = &summary.name;
                    outln!("{name} is not used: {why}; --inexact takes it all the same")?;
                }
            }
            if !adapters.iter().any(|a| a.summary.auto) {
                outln!("no hardware that passed: --backend auto computes on the CPU")?;
            }
        }
    }
    Ok(Exit::Done)
}

fn row(TestedAdapter { summary, self_test, .. }: &TestedAdapter) -> Vec<String> {
    let arithmetic = match self_test {
        None => ["not run", "", "", ""],
        Some(test) => test.words(),
    };
    let auto = if summary.auto { "yes" } else { "" };
    let mut row = vec![
        summary.name.clone(),
        summary.kind.to_owned(),
        format!("{} {}", summary.driver, summary.driver_info),
        format!("{} MiB", summary.max_binding >> 20),
        summary.max_workgroup.to_string(),
    ];
    row.extend(arithmetic.into_iter().chain([auto]).map(str::to_owned));
    row
}
