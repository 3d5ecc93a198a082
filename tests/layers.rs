//! The one direction of data flow: a module imports only what stands above it in `src/lib.rs`.

use std::fs;
use std::path::{Path, PathBuf};

/// Top to bottom.
const ORDER: [&str; 18] = [
    "geom", "scene", "psog", "vehicle", "bvh", "problem", "cast", "cover", "reduce", "scan",
    "engine", "score", "search", "audit", "verify", "chart", "study", "report",
];

fn sources(dir: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, files);
        } else if path.extension().is_some_and(|e| e == "rs") {
            files.push(path);
        }
    }
}

/// (file, text, first part of its module path) of every source file of the library.
fn library() -> Vec<(PathBuf, String, String)> {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&src, &mut files);
    let files = files.into_iter().map(|file| {
        let text = fs::read_to_string(&file).unwrap();
        let inner = file.strip_prefix(&src).unwrap().with_extension("");
        let module = inner.components().next().unwrap().as_os_str().to_string_lossy().into_owned();
        (file, text, module)
    });
    files.filter(|(_, _, module)| !["main", "lib", "cli"].contains(&module.as_str())).collect()
}

#[test]
fn modules_import_only_what_stands_above_them() {
    let mut checked = 0;
    for (file, text, module) in library() {
        let own = ORDER
            .iter()
            .position(|m| *m == module)
            .unwrap_or_else(|| panic!("{} belongs to no module of the list", file.display()));
        for (line, code) in text.lines().enumerate() {
            let Some((_, used)) = code.split_once("crate::") else { continue };
            let comment = code.trim_start().starts_with("//");
            let used: String =
                used.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            let Some(other) = ORDER.iter().position(|m| *m == used) else { continue };
            checked += 1;
            assert!(comment || other <= own, "{}:{}: {code}", file.display(), line + 1);
        }
    }
    assert!(checked > 30, "only {checked} imports were found");
}

#[test]
fn crates_stay_where_they_belong() {
    for (file, text, _) in library() {
        let path = file.to_string_lossy().replace('\\', "/");
        if !path.contains("/engine/gpu/") {
            assert!(!text.contains("wgpu::"), "{path} uses wgpu");
        }
        for foreign in ["tobj::", "gltf::", "ply_rs_bw::"] {
            assert!(path.contains("/scene/") || !text.contains(foreign), "{path} uses {foreign}");
        }
    }
}
