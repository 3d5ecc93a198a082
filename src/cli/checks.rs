//! `audit`, `verify`, `bench` and `devices`: checks of scores, of engines and of devices.

use serde_json::{Value, json};

use super::args::{Asked, Format};
use super::output::Exit;
use crate::audit::Audit;
use crate::chart::Chart;
use crate::engine::gpu::{TestedAdapter, test_adapters};
use crate::report::audit::{audit_text, audits_text};
use crate::report::chart_text::{chart_text, charts_csv, charts_text};
use crate::report::columns::align_columns;
use crate::report::run_tables::audits_csv;
use crate::report::text::verification_text;
use crate::runs::chart::{ChartRequest, Charted, chart_scenes};
use crate::runs::coverage::{AuditRequest, audit_scenes};
use crate::runs::devices::{
    DeviceBenchRequest, Verified, VerifyRequest, bench_device, verify_scenes,
};
use crate::runs::{RunError, TableFormat};

pub(super) type AuditArgs = Asked<AuditRequest, TableFormat>;

pub(super) fn run_audit(args: &AuditArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let mut gap = "";
    let print = |found: &Audit| match args.format {
        TableFormat::Json | TableFormat::Csv => Ok(()),
        TableFormat::Text => out!("{}{}", std::mem::replace(&mut gap, "\n"), audit_text(found)),
    };
    let all = audit_scenes(&args.request, &args.computing(&terminal), print)?;
    let passed = all.iter().all(|found| found.passed);
    match (args.format, &all[..]) {
        (TableFormat::Json, [found]) => outln!("{}", json!(found))?,
        (TableFormat::Json, all) => outln!("{}", json!({ "scenes": all, "passed": passed }))?,
        (TableFormat::Csv, all) => out!("{}", audits_csv(all))?,
        (TableFormat::Text, [_]) => {}
        (TableFormat::Text, all) => out!("{}", audits_text(all))?,
    }
    Ok(if passed { Exit::Done } else { Exit::CheckFailed })
}

pub(super) type VerifyArgs = Asked<VerifyRequest>;

pub(super) fn run_verify(args: &VerifyArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let format = args.format;
    let print = |one: &Verified| match format {
        Format::Json => Ok(()),
        Format::Text => out!("{}", verification_text(&one.scene, &one.conditions, &one.found)),
    };
    let all = verify_scenes(&args.request, &args.computing(&terminal), print)?;
    let passed = all.iter().all(|one| one.found.passed);
    match (format, &all[..]) {
        (Format::Json, [one]) => outln!("{}", json!(one))?,
        (Format::Json, all) => outln!("{}", json!({ "scenes": all, "passed": passed }))?,
        (Format::Text, _) => {}
    }
    Ok(if passed { Exit::Done } else { Exit::CheckFailed })
}

#[derive(clap::Subcommand)]
pub(super) enum BenchCommand {
    /// Measure a Vulkan device: self-test, bits beside the CPU's, placements a second
    #[command(
        after_help = "Example:
  sightline bench device scenes/highway.json scenes/residential.json > device.md",
        mut_arg("format", |format| format.help("How to print: text is a block of Markdown"))
    )]
    Device(Asked<DeviceBenchRequest>),
}

pub(super) fn run_bench(command: &BenchCommand) -> Result<Exit, RunError> {
    let BenchCommand::Device(args) = command;
    let terminal = args.compute.start()?;
    let found = bench_device(&args.request, &args.computing(&terminal))?;
    match args.format {
        Format::Json => outln!("{}", serde_json::json!(found))?,
        Format::Text => out!("{found}")?,
    }
    Ok(if found.passed() { Exit::Done } else { Exit::CheckFailed })
}

pub(super) fn run_devices(format: Format) -> Result<Exit, RunError> {
    let adapters = test_adapters();
    match format {
        Format::Json => outln!("{}", serde_json::json!({ "devices": adapters }))?,
        Format::Text if adapters.is_empty() => {
            outln!("no Vulkan device: --backend auto computes on the CPU")?;
        }
        Format::Text => {
            let titles = [
                "device", "kind", "driver", "max binding", "max workgroup", "self-test",
                "product + sum", "division", "denormals", "auto",
            ];
            let mut rows = vec![titles.map(str::to_owned).to_vec()];
            rows.extend(adapters.iter().map(device_row));
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

fn device_row(TestedAdapter { summary, self_test, .. }: &TestedAdapter) -> Vec<String> {
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

pub(super) type ChartArgs = Asked<ChartRequest, TableFormat>;

pub(super) fn run_chart(args: &ChartArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let mut gap = "";
    let print = |found: &Charted| match args.format {
        TableFormat::Json | TableFormat::Csv => Ok(()),
        TableFormat::Text => {
            let svg = found.folder.join("chart.svg");
            let gap = std::mem::replace(&mut gap, "\n");
            outln!("{gap}{}chart: {}", chart_text(&found.chart), svg.display())
        }
    };
    let (count, found) = chart_scenes(&args.request, &args.computing(&terminal), print)?;
    let (charts, answers): (Vec<Chart>, Vec<Value>) =
        found.into_iter().map(|found| (found.chart, found.answer)).unzip();
    match (args.format, &answers[..]) {
        (TableFormat::Json, [answer]) if count == 1 => outln!("{answer}")?,
        (TableFormat::Json, answers) => outln!("{}", json!({ "scenes": answers }))?,
        (TableFormat::Csv, _) => out!("{}", charts_csv(&charts, count > 1))?,
        (TableFormat::Text, [_]) => {}
        (TableFormat::Text, _) => out!("{}", charts_text(&charts))?,
    }
    let is_finished = charts.len() == count && charts.iter().all(|chart| chart.missing == 0);
    Ok(if is_finished { Exit::Done } else { Exit::Interrupted })
}
