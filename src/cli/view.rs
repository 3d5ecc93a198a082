//! `view`: the page of `optimize` about a placement that was not searched for.

use std::io::Write;
use std::path::{Path, PathBuf};

use crate::internals::{writable_file, write_whole};
use crate::report::{Figures, Looks, SceneRecord, Subject, view_html};
use crate::scene::Scene;
use crate::score::Objective;
use crate::search::{Scored, Suite};
use crate::vehicle::{Placement, table_7};

use super::args::{Compute, Conditions};
use super::error::Error;
use super::exit::Exit;
use super::files::{file_and_name, named_placements};
use super::load::{self, Suited};
use super::own_body::add_self_hits;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline view scenes/urban-crossing.json scenes/placements.json:Pyramid --out view.html
  sightline view scenes/highway.json scenes/residential.json mine.json:roof \
    --baseline mine.json:bumper --out view.html")]
pub struct Args {
    /// Scene files, and last a file of placements with the name of the one to show behind a colon [default:
    /// its first]
    #[arg(value_name = "SCENE… PLACEMENTS[:NAME]", required = true, num_args = 2..)]
    files: Vec<String>,
    /// Placement to compare with, or a file of them; may be given several times [default: Table 7 of the
    /// paper]
    #[arg(long, value_name = "FILE[:NAME]")]
    baseline: Vec<String>,
    /// Page to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    conditions: Conditions,
    #[command(flatten)]
    compute: Compute,
}

pub fn run(args: &Args) -> Result<Exit, Error> {
    args.compute.start()?;
    let (placements, scenes) = args.files.split_last().expect("clap requires two files");
    let given = named_placements(placements)?;
    let shown = given.first().ok_or_else(|| {
        Error::Usage(format!("{placements}: holds no placement; there is nothing to show"))
    })?;
    let baselines = baselines(args, shown)?;
    let paths: Vec<PathBuf> = scenes.iter().map(PathBuf::from).collect();
    let conditions = &args.conditions.condition;
    let mut suited = load::suite(&paths, None, conditions, &args.compute)?;
    let files = suited.scenes.iter().flat_map(|scene| scene.files()).map(PathBuf::as_path);
    let named = args.baseline.iter().chain([placements]).map(|text| file_and_name(text).0);
    writable_file(&args.out, files.chain(named.map(Path::new)))?;
    let page = page(args, &mut suited, shown, &baselines)?;
    write_whole(&args.out, |out| out.write_all(page.as_bytes()).map_err(Error::io(&args.out)))?;
    Ok(Exit::Done)
}

/// The layouts to compare with; the one shown is none of them.
fn baselines(args: &Args, shown: &Placement) -> Result<Vec<Placement>, Error> {
    let given = args.baseline.iter().map(|text| named_placements(text));
    let given = given.collect::<Result<Vec<_>, _>>()?.concat();
    let all = if args.baseline.is_empty() { table_7() } else { given };
    Ok(all.into_iter().filter(|baseline| baseline != shown).collect())
}

fn page(
    args: &Args,
    suited: &mut Suited,
    shown: &Placement,
    baselines: &[Placement],
) -> Result<String, Error> {
    let Suited { scenes, suite, evaluator, .. } = suited;
    let (scenes, suite): (&[Scene], &Suite) = (scenes, suite);
    let all: Vec<Placement> = std::iter::once(shown).chain(baselines).cloned().collect();
    let objective = Objective::default();
    let scored = all.iter().zip(evaluator.judged(&all)?);
    let scored = scored.map(|(p, judged)| Scored::new(p, judged, &objective, suite.constraints()));
    let mut scored: Vec<Scored> = scored.collect();
    add_self_hits(scenes, suite, scored.iter_mut())?;
    let (result, baselines) = (&scored[0], &scored[1..]);
    let looks = Looks::new(scenes, suite, shown, baselines, args.compute.memory)?;
    let figures = Figures::new(Some(result), suite.constraints(), &scenes[0].body(), Some(looks));
    let records = SceneRecord::several(suite);
    let names: Vec<&str> = scenes.iter().map(Scene::name).collect();
    let names = names.join(", ");
    let objective = objective.to_string();
    let subject = Subject::given(&names, &records, result, baselines, &objective, command(args));
    Ok(view_html(&subject, &figures))
}

/// The command that was given.
fn command(args: &Args) -> String {
    let mut words = vec!["sightline view".to_owned()];
    words.extend(args.files.iter().cloned());
    words.extend(args.baseline.iter().map(|baseline| format!("--baseline {baseline}")));
    words.extend(args.conditions.condition.iter().map(|one| format!("--condition {one}")));
    words.extend(args.compute.vehicle.iter().map(|file| format!("--vehicle {}", file.display())));
    words.push(format!("--out {}", args.out.display()));
    words.join(" ")
}
