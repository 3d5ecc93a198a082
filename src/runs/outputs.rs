//! Files that commands write beside their answer: figures as SVG, tables as CSV, a frame as glTF.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::{FiguresOut, RunError, TableFormat, Watcher};
use crate::export::{Glb, GltfView};
use crate::files::{
    RunDir, is_sink, safe_names, target, writable_file, writable_folder, write_folder, write_whole,
};
use crate::json::counted;
use crate::report::Figures;

/// A figure: its name without an ending, and the SVG.
pub(crate) type Figure = (String, String);
/// A table: its name without an ending, and the CSV.
pub(crate) type TableFile = (&'static str, String);

/// Checks, before long work, that a folder of figures could be written; true if one is wanted.
pub(crate) fn check_figures(folder: Option<&Path>) -> Result<bool, RunError> {
    folder.map(writable_folder).transpose()?;
    Ok(folder.is_some())
}

/// Refuses figures in the folder of a run, whose own files would be in their way.
pub(crate) fn check_figures_apart(figures: Option<&Path>, run: &Path) -> Result<(), RunError> {
    let place = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    match figures.filter(|figures| place(figures) == place(run)) {
        None => Ok(()),
        Some(figures) => Err(RunError::Usage(format!(
            "--figures {}: is the folder of the run; name another folder, or one in it",
            figures.display()
        ))),
    }
}

/// Writes the drawings of a run beside its record.
pub(super) fn write_drawings<S>(folder: &RunDir<S>, drawings: &Figures) -> Result<(), RunError> {
    let one = [("convergence.svg", &drawings.convergence), ("placement.svg", &drawings.placement)];
    for (name, figure) in one {
        figure.iter().try_for_each(|figure| folder.write_text(name, figure))?;
    }
    for (index, (_, map)) in drawings.maps.iter().enumerate() {
        let number = if index > 0 { format!("-{}", index + 1) } else { String::new() };
        folder.write_text(&format!("map{number}.svg"), map)?;
    }
    Ok(())
}

/// Writes each figure as `NAME.svg`, and the table that a command prints, if there is one, as `NAME.csv`.
pub(crate) fn write_figures(
    folder: Option<&Path>,
    figures: Vec<Figure>,
    table: Option<TableFile>,
) -> Result<(), RunError> {
    let Some(folder) = folder else { return Ok(()) };
    let names = safe_names(figures.iter().map(|(name, _)| &**name));
    let named = names.into_iter().zip(figures);
    let figures = named.map(|(name, (_, svg))| (format!("{name}.svg"), svg.into_bytes()));
    let table = table.map(|(name, csv)| (format!("{name}.csv"), csv.into_bytes()));
    Ok(write_folder(folder, &figures.chain(table).collect::<Vec<_>>())?)
}

/// Places of a drawing, and of its figures one by one.
#[derive(Clone, Copy)]
pub(super) struct Drawings<'a> {
    pub file: Option<&'a Path>,
    pub folder: Option<&'a Path>,
}

impl<'a> Drawings<'a> {
    pub(crate) fn new(file: &'a Option<PathBuf>, folder: &'a FiguresOut) -> Self {
        Self { file: file.as_deref(), folder: folder.figures.as_deref() }
    }

    /// Drawings of a command that has no file for one.
    pub(crate) fn in_folder(folder: &'a FiguresOut) -> Self {
        Self { file: None, folder: folder.figures.as_deref() }
    }

    /// Checks, before work begins, that they can be written.
    pub(crate) fn check(self) -> Result<(), RunError> {
        self.file.map_or(Ok(()), |file| check_file(file, "svg"))?;
        check_figures(self.folder).map(drop)
    }

    /// Writes the figures and the table, and the drawing where there is one, and notes their names. The table is made where
    /// a folder is given.
    pub(crate) fn write(
        self,
        figures: Vec<Figure>,
        (name, table): (&'static str, impl FnOnce() -> String),
        drawing: impl FnOnce() -> Option<String>,
        watcher: &dyn Watcher,
    ) -> Result<(), RunError> {
        let wrote = wrote(self.folder, (figures.len(), 1), self.file);
        let table = self.folder.map(|_| (name, table()));
        // First, since the file may lie in their folder.
        write_figures(self.folder, figures, table)?;
        if let Some(file) = self.file
            && let Some(svg) = drawing()
        {
            write_text(file, &svg)?;
        }
        wrote.iter().for_each(|wrote| watcher.note(wrote));
        Ok(())
    }
}

/// Writes a file of text, whole at any time.
pub(super) fn write_text(path: &Path, text: &str) -> Result<(), RunError> {
    write_whole(path, |file| file.write_all(text.as_bytes()).map_err(RunError::io(path)))
}

/// Sentence on the files that a command wrote: figures and tables in a folder, and a drawing. `None` if it wrote none.
pub(super) fn wrote(
    folder: Option<&Path>,
    (figures, tables): (usize, usize),
    file: Option<&Path>,
) -> Option<String> {
    let count = match (figures, tables) {
        (figures, 0) => counted(figures, "figure"),
        (0, tables) => counted(tables, "table"),
        _ => format!("{} and {}", counted(figures, "figure"), counted(tables, "table")),
    };
    let folder = folder.map(|folder| format!("{count} in {}", folder.display()));
    let file = file.map(|file| file.display().to_string());
    let all: Vec<String> = file.into_iter().chain(folder).collect();
    (!all.is_empty()).then(|| format!("wrote {}", all.join(", ")))
}

/// Scenes and frames behind the numbers of a command: `over 2 frames of street`, `over 2 frames of each of 3 scenes`; `on
/// bare level ground` without a scene.
pub(super) fn over(scenes: &[(&str, usize)]) -> String {
    let frames = |count: usize| counted(count, "frame");
    match scenes {
        [] => "on bare level ground".to_owned(),
        [(name, count)] => format!("over {} of {name}", frames(*count)),
        [(_, first), others @ ..] if others.iter().all(|(_, count)| count == first) => {
            format!("over {} of each of {} scenes", frames(*first), scenes.len())
        }
        all => {
            let each = all.iter().map(|(name, count)| format!("{} of {name}", frames(*count)));
            format!("over {}", each.collect::<Vec<_>>().join(", "))
        }
    }
}

/// Endings of formats that programs know.
const ENDINGS: [&str; 25] = [
    "csv", "gif", "glb", "gltf", "htm", "html", "jpeg", "jpg", "json", "npy", "npz", "obj", "ods",
    "pcd", "pdf", "ply", "png", "sdf", "stl", "svg", "txt", "urdf", "xls", "xlsx", "yaml",
];

/// Checks, before work begins, that a file can be written and does not have the ending of another format than `ending`.
pub(super) fn check_file(path: &Path, ending: &str) -> Result<(), RunError> {
    writable_file(path)?;
    check_ending(path, ending, &[])
}

/// Refuses the ending of another format for a table that is written in one.
pub(super) fn check_table(path: &Path, format: TableFormat) -> Result<(), RunError> {
    let ending = match format {
        TableFormat::Text => "txt",
        TableFormat::Json => "json",
        TableFormat::Csv => "csv",
    };
    check_ending(path, ending, &["csv", "json"])
}

/// Refuses a file with the ending of another format than `ending`; some are `formats` of the command.
fn check_ending(path: &Path, ending: &str, formats: &[&str]) -> Result<(), RunError> {
    let given = path.extension().map(|given| given.to_string_lossy().to_ascii_lowercase());
    let other = given.filter(|given| given != ending && ENDINGS.contains(&&**given));
    let Some(other) = other else { return Ok(()) };
    if is_sink(&target(path)?) {
        return Ok(());
    }
    let mend = match formats.contains(&&*other) {
        true => format!("--format {other}, or"),
        false => "it".to_owned(),
    };
    let (path, written) = (path.display(), ending.to_uppercase());
    Err(RunError::Usage(format!(
        "--out {path}: is written as {written}; give {mend} the ending .{ending}"
    )))
}

/// Checks, before work begins, that the file has the right ending, and can be written.
pub(super) fn check_gltf(path: Option<&Path>) -> Result<(), RunError> {
    let Some(path) = path else { return Ok(()) };
    let is_glb = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("glb"));
    if !is_glb && !is_sink(&target(path)?) {
        return Err(RunError::Usage(format!(
            "--gltf {}: is written as binary glTF; give it the ending .glb",
            path.display()
        )));
    }
    Ok(writable_file(path)?)
}

/// Writes a view where a file is given, and says so.
pub(super) fn write_gltf(
    path: Option<&Path>,
    watcher: &dyn Watcher,
    view: &GltfView<'_>,
) -> Result<(), RunError> {
    let Some(path) = path else { return Ok(()) };
    let glb = Glb::of(view)?;
    write_whole(path, |file| glb.write(file).map_err(RunError::io(path)))?;
    watcher.note(&format!("frame {} of {} in {}", view.frame, view.scene.name(), path.display()));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_scenes_and_files_are_named() {
        assert_eq!(over(&[]), "on bare level ground");
        assert_eq!(over(&[("yard", 1)]), "over 1 frame of yard");
        assert_eq!(over(&[("a", 2), ("b", 2)]), "over 2 frames of each of 2 scenes");
        assert_eq!(over(&[("a", 2), ("b", 1)]), "over 2 frames of a, 1 frame of b");
        let [folder, file] = ["figs", "near.svg"].map(Path::new);
        assert_eq!(wrote(None, (3, 1), None), None);
        assert_eq!(wrote(Some(folder), (1, 0), None).unwrap(), "wrote 1 figure in figs");
        assert_eq!(wrote(Some(folder), (0, 1), None).unwrap(), "wrote 1 table in figs");
        assert_eq!(
            wrote(Some(folder), (2, 1), Some(file)).unwrap(),
            "wrote near.svg, 2 figures and 1 table in figs"
        );
    }
}
