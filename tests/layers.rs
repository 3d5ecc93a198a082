//! Imports go one way: from file to file without a circle, from module to module in one order, and
//! each foreign crate only where it belongs.

mod imports;

use std::collections::{BTreeMap, BTreeSet};

use imports::{Source, Sources, words};

/// Modules of the library, top to bottom: each imports only from itself and from those above it.
const ORDER: [&str; 36] = [
    "memory",
    "allocator",
    "chance",
    "threads",
    "note",
    "files",
    "maths",
    "geom",
    "json",
    "npy",
    "mesh",
    "vehicle",
    "rig",
    "scene",
    "worlds",
    "psog",
    "datasets",
    "bvh",
    "problem",
    "cast",
    "cover",
    "reduce",
    "scan",
    "export",
    "engine",
    "score",
    "near_field",
    "search",
    "job",
    "audit",
    "verify",
    "chart",
    "study",
    "report",
    "error",
    "runs",
];

/// Foreign crates and the files that may name them, by the start of their names.
const FOREIGN: [(&str, &[&str]); 12] = [
    ("wgpu", &["engine/gpu/"]),
    ("clap", &["cli/"]),
    ("indicatif", &["cli/"]),
    ("ctrlc", &["cli/"]),
    ("gltf", &["mesh/"]),
    ("earcut", &["mesh/"]),
    ("roxmltree", &["rig/", "worlds/"]),
    ("xodr", &["worlds/"]),
    (
        "npyz",
        &["npy.rs", "psog/", "files/", "vehicle/sensor_file/npy.rs", "datasets/carla/records.rs"],
    ),
    ("zip", &["psog/"]),
    ("saphyr_parser", &["json/"]),
    // Where files are read and written.
    (
        "serde_json",
        &[
            "json/",
            "engine/gpu/isa.rs",
            "mesh/",
            "files/",
            "export/",
            "vehicle/",
            "rig/",
            "datasets/",
            "worlds/scene_file.rs",
            "score/mod.rs",
            "report/",
            "runs/",
            "cli/",
        ],
    ),
];

fn module(source: &str) -> &str {
    source.split('/').next().unwrap_or(source).trim_end_matches(".rs")
}

fn place(source: &str) -> usize {
    let module = module(source);
    ORDER
        .iter()
        .position(|m| *m == module)
        .unwrap_or_else(|| panic!("src/{source} belongs to no module of the order"))
}

fn is_library(source: &str) -> bool {
    !["cli", "lib"].contains(&module(source))
}

#[test]
fn modules_import_only_from_those_above_them() {
    let sources = Sources::read();
    let (mut checked, mut upwards) = (0, Vec::new());
    for (file, targets) in sources.edges().into_iter().filter(|(file, _)| is_library(file)) {
        for target in targets {
            let allowed = is_library(target) && place(target) <= place(file);
            checked += usize::from(module(target) != module(file));
            upwards.extend((!allowed).then(|| format!("src/{file} imports from src/{target}")));
        }
    }
    assert!(upwards.is_empty(), "{upwards:#?}");
    assert!(checked > 200, "only {checked} imports between modules were found");
}

/// Files that reach each other by imports, smallest name first.
fn circles(edges: &BTreeMap<&str, BTreeSet<&str>>) -> BTreeSet<Vec<String>> {
    let reach = |start: &str| {
        let mut found: BTreeSet<&str> = BTreeSet::new();
        let mut open: Vec<&str> = edges[start].iter().copied().collect();
        while let Some(file) = open.pop() {
            if found.insert(file) {
                open.extend(edges.get(file).into_iter().flatten());
            }
        }
        found
    };
    let reached: BTreeMap<&str, BTreeSet<&str>> =
        edges.keys().map(|&file| (file, reach(file))).collect();
    let circle = |file: &str| {
        let members = reached[file].iter().filter(|other| reached[**other].contains(file));
        members.map(|&other| other.to_owned()).collect::<Vec<String>>()
    };
    edges.keys().map(|file| circle(file)).filter(|circle| circle.len() > 1).collect()
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let sources = Sources::read();
    let found = circles(&sources.edges());
    assert!(found.is_empty(), "circles: {found:#?}");
}

#[test]
fn a_circle_is_found() {
    let edge = |from, to: &[&'static str]| (from, to.iter().copied().collect());
    let edges = BTreeMap::from([
        edge("a.rs", &["b.rs"]),
        edge("b.rs", &["c.rs"]),
        edge("c.rs", &["a.rs", "d.rs"]),
        edge("d.rs", &[]),
    ]);
    let names = ["a.rs", "b.rs", "c.rs"].map(str::to_owned).to_vec();
    assert_eq!(circles(&edges), BTreeSet::from([names]));
}

#[test]
fn crates_stay_where_they_belong() {
    for Source { name, code, .. } in Sources::read().iter() {
        for (at, word) in words(code) {
            let Some((foreign, homes)) = FOREIGN.iter().find(|(foreign, _)| *foreign == word)
            else {
                continue;
            };
            // A crate is named by a path, a child module of the same name in its parent's `mod`.
            let named = code[at + word.len()..].starts_with("::") && !code[..at].ends_with("::");
            let at_home = homes.iter().any(|home| name.starts_with(home));
            assert!(at_home || !named, "src/{name} uses {foreign}");
        }
    }
}

#[test]
fn shaders_are_included_by_the_gpu_engine_alone() {
    let mut found = 0;
    for Source { name, code, .. } in Sources::read().iter() {
        let includes =
            code.matches("include_str!").count() + code.matches("include_bytes!").count();
        found += includes;
        // The published placements are part of the program, style and scripts of its page.
        let homes = ["engine/gpu/", "vehicle/published.rs", "report/page/", "cli/"];
        let allowed = homes.iter().any(|home| name.starts_with(home));
        assert!(includes == 0 || allowed, "src/{name} includes a file of another place");
    }
    assert!(found > 0, "no included file was found");
}
