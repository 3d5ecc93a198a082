//! Imports of the program's source files, from file to file: paths that start with `crate`, `self`,
//! `super` or a child module, followed through re-exports to the file that defines the name.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Path segments from the root of the crate.
type ModulePath = Vec<String>;

/// One source file.
pub struct Source {
    /// Relative to `src`, with `/`.
    pub name: String,
    /// Text without comments and without its inline tests.
    pub code: String,
    module: ModulePath,
    /// Names that a `use` brings into the module, with their paths.
    imports: Vec<(String, ModulePath)>,
    /// Paths in the code, without those of re-exports.
    paths: Vec<ModulePath>,
}

/// All source files by module path.
pub struct Sources(BTreeMap<ModulePath, Source>);

impl Sources {
    /// Reads `src`; test modules are left out.
    pub fn read() -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
        let mut files = Vec::new();
        collect(&root, &mut files);
        let mut sources = BTreeMap::new();
        for file in files {
            let name = file.strip_prefix(&root).unwrap().to_string_lossy().replace('\\', "/");
            let mut module: ModulePath =
                name.trim_end_matches(".rs").split('/').map(str::to_owned).collect();
            if module.iter().any(|part| part == "tests") || name == "main.rs" {
                continue;
            }
            module.pop_if(|last| last == "mod" || last == "lib");
            let code = code_of(&fs::read_to_string(&file).unwrap());
            let source = Source { name, code, module, imports: vec![], paths: vec![] };
            sources.insert(source.module.clone(), source);
        }
        let mut sources = Self(sources);
        let parsed: Vec<_> = sources.0.values().map(|source| sources.parse(source)).collect();
        for (source, (imports, paths)) in sources.0.values_mut().zip(parsed) {
            (source.imports, source.paths) = (imports, paths);
        }
        sources
    }

    /// The files, in the order of their module paths.
    pub fn iter(&self) -> impl Iterator<Item = &Source> {
        self.0.values()
    }

    /// Files that each file imports from, itself left out.
    pub fn edges(&self) -> BTreeMap<&str, BTreeSet<&str>> {
        let edges = self.iter().map(|source| {
            let targets = source.paths.iter().filter_map(|path| self.definer(path, 0));
            let targets = targets.map(|target| target.name.as_str()).filter(|t| *t != source.name);
            (source.name.as_str(), targets.collect())
        });
        edges.collect()
    }

    /// Imports of a module and the other paths in its code, all from the root of the crate.
    fn parse(&self, source: &Source) -> (Vec<(String, ModulePath)>, Vec<ModulePath>) {
        let (mut imports, mut paths) = (Vec::new(), Vec::new());
        let is_child = |name: &str| {
            let mut child = source.module.clone();
            child.push(name.to_owned());
            self.0.contains_key(&child)
        };
        let code = &source.code;
        for (start, word) in words(code) {
            let before = code[..start].trim_end();
            let starts_path = code[start + word.len()..].trim_start().starts_with("::")
                && !before.ends_with("::")
                && !before.ends_with(['{', ',']) // a branch of a tree of imports
                || before.ends_with("use");
            if !starts_path || !(["crate", "self", "super"].contains(&word) || is_child(word)) {
                continue;
            }
            let statement = code[..start].rfind([';', '}', '{']).map_or(0, |at| at + 1);
            let head = code[statement..start].trim();
            let is_use = head.ends_with("use");
            let mut tree = Vec::new();
            expand(&code[start..], &mut Vec::new(), &mut tree);
            for (path, name) in tree {
                let path = absolute(&source.module, &path);
                if is_use {
                    imports.push((name, path.clone()));
                }
                if !(is_use && head.contains("pub")) {
                    paths.push(path);
                }
            }
        }
        (imports, paths)
    }

    /// The file that defines the item at a path; the module's own where it names none.
    fn definer(&self, path: &[String], depth: usize) -> Option<&Source> {
        let known = (0..=path.len()).rev().find(|&n| self.0.contains_key(&path[..n]))?;
        let module = &self.0[&path[..known]];
        let Some(name) = path.get(known) else { return Some(module) };
        let import = module.imports.iter().find(|(import, _)| import == name);
        match import.filter(|_| depth < 8) {
            Some((_, target)) => {
                let target: ModulePath = target.iter().chain(&path[known + 1..]).cloned().collect();
                self.definer(&target, depth + 1)
            }
            None => Some(module),
        }
    }
}

fn collect(dir: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|e| e == "rs") {
            files.push(path);
        }
    }
}

/// Code before the inline tests, without comments.
fn code_of(text: &str) -> String {
    let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or(text);
    let lines = code.lines().map(|line| match line.find("//") {
        // `://` stands in texts, as in `http://`.
        Some(at) if !line[..at].ends_with(':') => &line[..at],
        _ => line,
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// Identifiers with their places.
pub fn words(code: &str) -> impl Iterator<Item = (usize, &str)> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    code.split(move |c| !is_word(c))
        .filter(|word| !word.is_empty())
        .map(|word| (word.as_ptr() as usize - code.as_ptr() as usize, word))
}

/// Paths of a tree such as `a::{b, c::d as e}` at the start of `code`, each with the name it brings;
/// returns the rest of the code.
fn expand<'a>(
    code: &'a str,
    prefix: &mut ModulePath,
    found: &mut Vec<(ModulePath, String)>,
) -> &'a str {
    let code = code.trim_start();
    let depth = prefix.len();
    if let Some(mut rest) = code.strip_prefix('{') {
        loop {
            rest = rest.trim_start();
            if let Some(after) = rest.strip_prefix('}') {
                return after;
            }
            rest = expand(rest, prefix, found).trim_start();
            rest = rest.strip_prefix(',').unwrap_or(rest);
            if rest.is_empty() {
                return rest;
            }
        }
    }
    let end = code.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(code.len());
    if end == 0 {
        found.push((prefix.clone(), String::new()));
        return code.get(1..).unwrap_or_default();
    }
    prefix.push(code[..end].to_owned());
    let mut rest = &code[end..];
    if let Some(deeper) = rest.trim_start().strip_prefix("::") {
        rest = expand(deeper, prefix, found);
    } else {
        let (mut name, mut path) = (prefix[prefix.len() - 1].clone(), prefix.clone());
        if name == "self" && path.len() > 1 {
            path.pop();
            name = path[path.len() - 1].clone();
        }
        if let Some(alias) = rest.trim_start().strip_prefix("as ") {
            let end = alias.find(|c: char| !(c.is_alphanumeric() || c == '_'));
            name = alias[..end.unwrap_or(alias.len())].to_owned();
            rest = &alias[end.unwrap_or(alias.len())..];
        }
        found.push((path, name));
    }
    prefix.truncate(depth);
    rest
}

/// A path of a module from the root of the crate.
fn absolute(module: &[String], path: &[String]) -> ModulePath {
    let mut from = module.to_vec();
    let mut rest = path;
    match path[0].as_str() {
        "crate" => {
            from.clear();
            rest = &path[1..];
        }
        "self" => rest = &path[1..],
        _ => {
            while rest.first().is_some_and(|part| part == "super") {
                from.pop();
                rest = &rest[1..];
            }
        }
    }
    from.extend_from_slice(rest);
    from
}
