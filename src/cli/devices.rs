//! `devices`: the Vulkan devices and the one that `auto` takes.

use crate::engine::gpu::list_adapters;
use crate::internals::align_columns;

use super::args::Format;
use super::exit::Exit;
use crate::runs::Error;

#[derive(clap::Args)]
#[command(after_help = "Example:\n  sightline devices")]
pub struct Args {
    /// How to print
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

pub fn run(args: &Args) -> Result<Exit, Error> {
    let adapters = list_adapters();
    match args.format {
        Format::Json => outln!("{}", serde_json::json!({ "devices": adapters }))?,
        Format::Text if adapters.is_empty() => {
            outln!("no Vulkan device: --backend auto computes on the CPU")?;
        }
        Format::Text => {
            let titles = ["device", "kind", "driver", "max binding", "max workgroup", "auto"];
            let mut rows = vec![titles.map(str::to_owned).to_vec()];
            rows.extend(adapters.iter().map(|a| {
                vec![
                    a.name.clone(),
                    a.kind.to_owned(),
                    format!("{} {}", a.driver, a.driver_info),
                    format!("{} MiB", a.max_binding >> 20),
                    a.max_workgroup.to_string(),
                    if a.auto { "yes" } else { "" }.to_owned(),
                ]
            }));
            out!("{}", align_columns(&rows))?;
            if !adapters.iter().any(|a| a.auto) {
                outln!("only software: --backend auto computes on the CPU")?;
            }
        }
    }
    Ok(Exit::Done)
}
