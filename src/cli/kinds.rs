//! Kinds of study in help: a line each in `study -h`, and help of its own behind `study KIND -h`.

use std::ffi::OsString;

use clap::Command;

use crate::study::Kind;

/// A kind of study in help.
struct KindHelp {
    /// Its question in a line of `study -h`.
    line: &'static str,
    /// Arguments of an example, behind the kind.
    example: &'static str,
    /// Options that `-h` shows beside those of every kind.
    own: &'static [&'static str],
}

/// Help of each of [`Kind::ALL`].
const KINDS: [KindHelp; 12] = [
    KindHelp {
        line: "How many LiDARs: the best rig of each number",
        example: "scenes/highway.json --vehicle scenes/vehicles/car.json",
        own: &["budget"],
    },
    KindHelp {
        line: "Gain of a vehicle's sensors for their price",
        example: "scenes/highway.json --vehicle scenes/vehicles/car.json --budget 12000",
        own: &["budget"],
    },
    KindHelp {
        line: "16 to 128 channels, and sensors of files",
        example: "scenes/highway.json --sensor-file vlp_32c.json",
        own: &["sensors"],
    },
    KindHelp {
        line: "Own rigs ranked at the four voxel sizes of the paper",
        example: "scenes/highway.json scenes/placements.json",
        own: &[],
    },
    KindHelp {
        line: "Random placements against own rigs and an optimized one",
        example: "scenes/highway.json scenes/placements.json --random 200",
        own: &["random"],
    },
    KindHelp {
        line: "One placement for segmentation and detection",
        example: "scenes/highway.json",
        own: &[],
    },
    KindHelp {
        line: "All LiDARs at one height, against free heights",
        example: "scenes/highway.json",
        own: &[],
    },
    KindHelp {
        line: "Near, middle, far; front, side, rear; boxes; classes",
        example: "scenes/residential.json mine.json --box crossing:10,-5,0,30,5,2",
        own: &["regions"],
    },
    KindHelp {
        line: "Each LiDAR lost in turn: what fails, where it is blind",
        example: "scenes/highway.json scenes/placements.json",
        own: &[],
    },
    KindHelp {
        line: "Own rigs in clear air, fog, snow, rain",
        example: "scenes/highway.json mine.json --condition fog:mor=50",
        own: &["condition"],
    },
    KindHelp {
        line: "A placement optimized on one scene, scored on others",
        example: "scenes/highway.json scenes/residential.json",
        own: &[],
    },
    KindHelp {
        line: "The paper's placements against its published results",
        example: "scenes/highway.json --voxel 0.2",
        own: &["voxel"],
    },
];

/// Lines of all kinds, as wide as those of commands.
pub(super) fn lines() -> String {
    let all = Kind::ALL.iter().zip(&KINDS);
    all.map(|((_, name, _), kind)| format!("  {name:<11} {}\n", kind.line)).collect()
}

/// Files that a kind takes: their name, and a sentence.
fn files_of(kind: Kind) -> (&'static str, &'static str) {
    match kind {
        Kind::Transfer => ("SCENE…", "Two scene files or more, looked at together"),
        kind if kind.takes_placements() => (
            "SCENE… [PLACEMENTS]",
            "Scene files, looked at one after the other, and behind them a file of own rigs",
        ),
        _ => ("SCENE…", "Scene files, looked at one after the other"),
    }
}

/// The program with help of the kind of study that the arguments name: its question, its example, its own options.
pub(super) fn with_kind(program: Command, arguments: &[OsString]) -> Command {
    let word = |at: usize| arguments.get(at).and_then(|word| word.to_str());
    let named = word(2).filter(|_| word(1) == Some("study"));
    let mut all = Kind::ALL.iter().zip(&KINDS);
    let Some(((of, name, answer), kind)) = all.find(|((_, name, _), _)| named == Some(*name))
    else {
        return program;
    };
    let (files, sentence) = files_of(*of);
    program.mut_subcommand("study", |study| {
        let rest = study.get_after_help().map(ToString::to_string).unwrap_or_default();
        let rest = rest.split_once("\n\n").map_or("", |(_, rest)| rest).to_owned();
        study
            .about(*answer)
            .override_usage(format!("sightline study {name} [OPTIONS] <{files}>..."))
            .after_help(format!("Example:\n  sightline study {name} {}\n\n{rest}", kind.example))
            // `mut_arg` would move the kind behind the scenes.
            .mut_args(|arg| match arg.get_id().as_str() {
                "kind" => arg.hide(true),
                "scenes" => arg.value_name(files).help(sentence).long_help(sentence),
                id if kind.own.contains(&id) => {
                    let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
                    let own = format!(", for `{name}`");
                    arg.help(help.replace(&own, "")).hide_short_help(false)
                }
                _ => arg,
            })
            .mut_subcommands(|below| below.hide(true))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{Refused, parse, program};

    #[test]
    fn every_kind_has_its_line_and_its_own_help() {
        let study = program();
        let study = study.find_subcommand("study").unwrap();
        for ((of, name, _), KindHelp { example, own, .. }) in Kind::ALL.iter().zip(&KINDS) {
            for flag in ["-h", "--help"] {
                let words = ["sightline", "study", name, flag].map(OsString::from);
                let Err(Refused::Help(help)) = parse(&words) else { panic!("{name}: no help") };
                let help = help.to_string().replace(" \\\n    ", " ");
                let told = format!("  sightline study {name} {example}");
                assert!(help.contains(&told), "{name}: {help}");
                assert!(
                    help.contains(&format!("Usage: sightline study {name} [OPTIONS]")),
                    "{help}"
                );
                assert!(!help.contains("possible values: lidars"), "{help}");
                assert!(!help.contains(&format!(", for `{name}`")), "{help}");
                let rigs = of.takes_placements();
                assert_eq!(help.contains("<SCENE… [PLACEMENTS]>..."), rigs, "{help}");
                assert_eq!(help.contains("looked at together"), *name == "transfer", "{help}");
                for id in *own {
                    let arg = study.get_arguments().find(|arg| arg.get_id() == id).unwrap();
                    let long = format!("--{}", arg.get_long().unwrap());
                    assert!(help.contains(&long), "{name} {flag}: {help}");
                }
            }
        }
    }
}
