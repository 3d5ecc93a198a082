//! Targets: things of known size that a rig must detect at a range, as presets or from files.
//!
//! A target file is `{ "sightline": 1, "name", "shapes": [shapes as in a scene], "reflectance", "source" }`. Shapes need
//! no class. Its frame has z = 0 on the ground and x along the target.

use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use glam::DVec3;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::classes::Classes;
use super::description::{Dictionary, ShapeDescription};
use super::shapes::Builder;
use super::solid::around;
use lidar_cast::bvh::Bvh;
use lidar_cast::geom::{Pose, TriangleSoup};
use sightline_files::Note;
use sightline_files::json::check::{self, bad};
use sightline_files::json::{self, Checked, FileKind, Location};

/// Largest target file, in bytes.
const MAX_FILE: u64 = 64 << 20;
/// Most triangles of a target: each beam near it is tested against its tree.
const MOST_TRIANGLES: u64 = 200_000;
/// Largest target along any axis, in metres.
const MOST_METRES: f64 = 100.0;
/// Reflectance of a target that states none: sensors' rated ranges hold for it.
pub(crate) const RATED_REFLECTANCE: f64 = 0.1;
/// Least size of a target along the two longer axes of the box around it, in metres.
const LEAST_METRES: f64 = 1e-4;
/// End of the error of a target that beams cannot meet.
const NO_SIZE: &str = ": beams cannot meet a target without size; give its shapes lengths in metres, or a mesh faces with an \
                       area and a larger `scale`";
/// Metres by which a target may stand off its origin or the ground before a note says so.
const OFF_CENTRE: f64 = 1e-3;
/// Longest hits in the trees of targets, in metres.
const FAR: f32 = 1000.0;
/// Class of shapes that name none; a target's classes count for nothing.
const CLASS: &str = "other";

/// A thing of known size that stands on the ground.
#[derive(Debug, Clone, Serialize)]
pub struct Target {
    /// Name in tables and requirements.
    pub name: String,
    /// Length, width and height of the box around it, metres.
    pub size: [f64; 3],
    /// Shapes as the file writes them.
    pub shapes: Value,
    /// Share of the light that its surface reflects, above 0 and at most 1.
    pub reflectance: f64,
    /// True if only beams of which the sensor sees enough light count, in clear air too: a rule asks for it, no file.
    #[serde(skip)]
    pub returning_only: bool,
    /// Source of its dimensions and reflectance; `None` where the file does not say.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
    /// Lower and upper corner of the box around it, in its own frame.
    #[serde(skip)]
    pub corners: [[f64; 3]; 2],
    /// Triangles with the middle of that box at x = y = 0 and the ground at z = 0, metres.
    #[serde(skip)]
    pub tree: Arc<Bvh>,
    /// Normal of each triangle, by its number.
    #[serde(skip)]
    pub normals: Arc<[[f32; 3]]>,
    /// Likely mistakes in the file, a sentence each.
    #[serde(skip)]
    pub notes: Vec<Note>,
    /// The target file and its meshes; none of a preset.
    #[serde(skip)]
    pub files: Vec<PathBuf>,
}

impl PartialEq for Target {
    /// Equal names, sizes, shapes and reflectances, and the same beams count.
    fn eq(&self, other: &Self) -> bool {
        (&self.name, self.size, &self.shapes, self.reflectance, self.returning_only)
            == (&other.name, other.size, &other.shapes, other.reflectance, other.returning_only)
    }
}

/// A target file as it is written.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct TargetDescription {
    /// JSON Schema of this file, which editors read.
    #[serde(rename = "$schema")]
    _schema: Option<String>,
    /// Version of the format, 1.
    #[serde(rename = "sightline")]
    #[cfg_attr(feature = "schema", schemars(extend("const" = 1)))]
    _version: u64,
    /// Name in tables and requirements.
    name: String,
    /// Shapes, z = 0 on the ground and x along the target.
    shapes: Vec<ShapeDescription>,
    /// Share of light that it reflects, above 0 and at most 1; 0.1.
    reflectance: Option<f64>,
    /// Source of its dimensions and reflectance.
    source: Option<String>,
}

/// Words for presets in other parts of the world, and the preset.
const OTHER_NAMES: [(&str, &str); 8] = [
    ("bicycle", "cyclist"),
    ("bike", "cyclist"),
    ("curb", "kerb"),
    ("kid", "child"),
    ("motorbike", "motorcycle"),
    ("pedestrian", "adult"),
    ("person", "adult"),
    ("tire", "tyre"),
];

/// Every preset, in the order of `targets.json`.
pub fn preset_targets() -> &'static [Target] {
    static PRESETS: OnceLock<Vec<Target>> = OnceLock::new();
    PRESETS.get_or_init(|| {
        let all: Vec<Value> =
            serde_json::from_str(include_str!("targets.json")).unwrap_or_default();
        // A test reads them all.
        let read = |value: &Value| Target::from_text(&value.to_string(), Path::new(""), "presets");
        all.iter().filter_map(|value| read(value).ok()).collect()
    })
}

impl Target {
    /// A preset by its name; any other text is the name of a target file.
    ///
    /// # Errors
    /// No such preset and no such file; any [`DescriptionError`](super::DescriptionError) of the file.
    pub fn named(text: &str) -> Checked<Self> {
        Self::named_at(&Location::top("target"), Path::new(""), text)
    }

    /// Like [`Self::named`], with target files relative to a folder; an error names the place of the text.
    pub(crate) fn named_at(at: &Location, dir: &Path, text: &str) -> Checked<Self> {
        if let Some(preset) = preset_targets().iter().find(|preset| preset.name == text) {
            return Ok(preset.clone());
        }
        let file = dir.join(text);
        if Path::new(text).extension().is_some() || file.exists() {
            return Self::read(&file).map_err(|error| match error {
                // A place in a file: the file that names another one is at fault.
                json::DescriptionError::OtherKind { file, found, .. } if !at.path.is_empty() => {
                    let wanted = format!(
                        "a target: {file} is {found}; name a preset, or a file with the `shapes` of a target"
                    );
                    bad(at, format!("`{text}`"), wanted)
                }
                error @ json::DescriptionError::Read { .. } if !at.path.is_empty() => {
                    error.of_file(at.clone())
                }
                error => error,
            });
        }
        let kind = "preset or file of a target";
        if let Some((_, preset)) = OTHER_NAMES.iter().find(|(name, _)| *name == text) {
            let told = format_args!("no {kind} is called `{text}`; did you mean `{preset}`?");
            return Err(check::refused(at, told));
        }
        let known = preset_targets().iter().map(|preset| preset.name.as_str());
        Err(check::unknown_name(at, kind, text, known))
    }

    /// Reads a target file.
    pub fn read(path: &Path) -> Checked<Self> {
        let text = json::read_text(path, MAX_FILE)?;
        let dir = path.parent().unwrap_or(Path::new(""));
        let mut target = Self::from_text(&text, dir, &path.display().to_string())?;
        target.files.insert(0, path.to_owned());
        if preset_targets().iter().any(|preset| preset.name == target.name) {
            let (file, name) = (path.display(), &target.name);
            target.notes.push(Note::fact(format!(
                "{file}: name: `{name}` is the name of a preset, too; results mean this file by it"
            )));
        }
        Ok(target)
    }

    /// From the text of a target file, whose meshes are in `dir`.
    fn from_text(text: &str, dir: &Path, file: &str) -> Checked<Self> {
        json::check_version(text, file, FileKind::Target)?;
        let TargetDescription { name, mut shapes, reflectance, source, .. } =
            json::parse(text, file)?;
        let json::UniqueKeys(written) = json::parse(text, file)?;
        let at = Location::top(file);
        let name = check::name(&at.key("name"), name)?;
        if name.trim().is_empty() {
            return Err(bad(&at.key("name"), "an empty text", "a name"));
        }
        let reflectance = reflectance.unwrap_or(RATED_REFLECTANCE);
        if !(reflectance > 0.0 && reflectance <= 1.0) {
            let wanted = "a share above 0 and at most 1, 0.1 for example";
            return Err(bad(&at.key("reflectance"), reflectance, wanted));
        }
        let source = source.map(|text| check::text(&at.key("source"), text)).transpose()?;
        if shapes.is_empty() {
            return Err(bad(
                &at.key("shapes"),
                "an empty list",
                "a list of at least one box, cylinder or mesh",
            ));
        }
        for shape in shapes.iter_mut().filter(|shape| shape.shape.is_none()) {
            shape.class.get_or_insert_with(|| CLASS.to_owned());
        }
        let (classes, named) = (Classes::new(&at, None, None)?, Dictionary::default());
        let mut builder = Builder::new(&at, &classes, &named, dir).limited(MOST_TRIANGLES);
        let solid = builder.list(&at.key("shapes"), &shapes)?;
        let (files, mut notes) = (builder.files(), builder.notes());
        let mut soup = TriangleSoup::default();
        solid.append_to(&mut soup, &Pose::IDENTITY);
        if !solid.has_area() {
            let wanted = format!("at least one shape with an area{NO_SIZE}");
            return Err(bad(&at.key("shapes"), "a list without an area", wanted));
        }
        let [low, high] = checked_corners(&at, &soup)?;
        notes.extend(off_centre(&at, low, high));
        let middle = [0, 1].map(|k| 0.5 * (low[k] + high[k]));
        let moved = |corner: [f64; 3]| [corner[0] - middle[0], corner[1] - middle[1], corner[2]];
        for vertex in &mut soup.vertices {
            *vertex = moved(vertex.map(f64::from)).map(|v| v as f32);
        }
        let tree = Arc::new(Bvh::build(&soup, FAR));
        let mut normals = vec![[0.0; 3]; soup.faces.len()];
        tree.triangles.iter().for_each(|of| normals[of.prim as usize] = of.normal);
        Ok(Self {
            name,
            size: [0, 1, 2].map(|k| to_micrometres(high[k] - low[k])),
            shapes: written["shapes"].clone(),
            reflectance,
            returning_only: false,
            source,
            corners: [moved(low), moved(high)],
            tree,
            normals: normals.into(),
            notes,
            files,
        })
    }
}

/// Rounds a length to micrometres: finer digits of `f32` coordinates are noise.
fn to_micrometres(metres: f64) -> f64 {
    (metres * 1e6).round() / 1e6
}

/// Corners of the box around triangles, which must fit a road.
fn checked_corners(at: &Location, soup: &TriangleSoup) -> Checked<[[f64; 3]; 2]> {
    let corners = soup.vertices.iter().map(|vertex| DVec3::from(vertex.map(f64::from)));
    let [low, high] = around(corners).unwrap_or_default();
    let longest = (high - low).max_element();
    if longest > MOST_METRES {
        let wanted = format!(
            "a target of at most {MOST_METRES} m; if a mesh is in millimetres, give it `\"scale\": 0.001`"
        );
        return Err(bad(&at.key("shapes"), format!("a target of {longest:.1} m"), wanted));
    }
    let size = (high - low).to_array();
    let long_enough = size.iter().filter(|metres| **metres >= LEAST_METRES).count();
    if long_enough < 2 {
        let found =
            format!("a target of {} m", size.map(|metres| format!("{metres:e}")).join(" × "));
        let wanted = format!("{LEAST_METRES} m or more along two axes{NO_SIZE}");
        return Err(bad(&at.key("shapes"), found, wanted));
    }
    if high.z < OFF_CENTRE && low.z < -OFF_CENTRE {
        let found = format!("a target whose top is at z = {:.3} m", high.z);
        return Err(bad(&at.key("shapes"), found, "one above the ground, z = 0; raise its shapes"));
    }
    Ok([low, high].map(|corner| corner.to_array()))
}

/// Notes on a target that stands off the origin of its file, or not on the ground.
fn off_centre(at: &Location, low: [f64; 3], high: [f64; 3]) -> Vec<Note> {
    let mut notes = Vec::new();
    let [x, y] = [0, 1].map(|k| 0.5 * (low[k] + high[k]));
    if x.abs().max(y.abs()) > OFF_CENTRE {
        notes.push(Note::doubt(format!(
            "{at}: shapes: the middle of the target is at x = {x:.3} m, y = {y:.3} m; distances count to that middle"
        )));
    }
    if low[2].abs() > OFF_CENTRE {
        let how = if low[2] > 0.0 { "floats above" } else { "reaches below" };
        let z = low[2];
        notes.push(Note::doubt(format!(
            "{at}: shapes: the target {how} the ground, its lowest point is at z = {z:.3} m; it is taken as it is \
             written"
        )));
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_is_read_and_says_its_source() {
        let all: Vec<Value> = serde_json::from_str(include_str!("targets.json")).unwrap();
        assert_eq!(preset_targets().len(), all.len());
        for (other, preset) in OTHER_NAMES {
            assert_holds!(Target::named(other).unwrap_err(), &format!("did you mean `{preset}`?"));
        }
        for name in ["child", "adult", "cyclist", "car", "tyre", "motorcycle", "pole", "kerb"] {
            let target = Target::named(name).unwrap();
            assert!(target.source.is_some() && target.notes.is_empty(), "{name}");
            assert_eq!(target.corners[0][2], 0.0, "{name} stands on the ground");
            assert!((target.corners[0][0] + target.corners[1][0]).abs() < 1e-6);
        }
        assert_eq!(Target::named("child").unwrap().size[2], 1.1);
    }

    #[test]
    fn the_page_on_targets_has_the_presets() {
        // A package of this crate alone has no documents.
        let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/targets.md");
        let Ok(page) = std::fs::read_to_string(page) else { return };
        for Target { name, size, reflectance, .. } in preset_targets() {
            let [x, y, z] = size.map(|metres| (1e3 * metres).round() / 1e3);
            let row = format!("| `{name}` | {x} × {y} × {z} | {:.0} % |\n", 100.0 * reflectance);
            assert!(page.contains(&row), "{row}");
        }
    }

    #[test]
    fn the_reflectance_of_a_preset_has_a_source_or_is_unconfirmed() {
        for Target { name, reflectance, source, .. } in preset_targets() {
            let told = source.as_deref().unwrap_or_default();
            let is_told = told.contains(&format!(" {:.0} %", 100.0 * reflectance));
            let lies_between = told.contains("5 to 10 %") && (0.05..=0.1).contains(reflectance);
            let is_unconfirmed = told.contains("reflectance") && told.contains("unconfirmed");
            assert!(is_told || lies_between || is_unconfirmed, "{name}: {told}");
        }
    }

    #[test]
    fn wrong_targets_are_refused_with_their_place() {
        let refused =
            |text: &str| Target::from_text(text, Path::new(""), "t.json").unwrap_err().to_string();
        let target = |shapes: &str, more: &str| {
            format!(r#"{{"sightline": 1, "name": "t", "shapes": [{shapes}]{more}}}"#)
        };
        let cube = r#"{"box": {"foot": [0, 0, 0], "size": [1, 1, 1]}}"#;
        assert!(Target::from_text(&target(cube, ""), Path::new(""), "t.json").is_ok());
        let many = cube.replace("}}", r#"}, "repeat": {"count": 20000, "step": [0, 0, 0]}}"#);
        let cases = [
            (target("", ""), "at least one box, cylinder or mesh"),
            (target(&cube.replace("0]", "-5]"), ""), "top is at z = -4.000 m"),
            (target(cube, r#", "reflectance": 0"#), "reflectance"),
            (target(cube, r#", "reflectance": 10"#), "reflectance"),
            (target(cube, r#", "colour": 1"#), "colour"),
            (target(&many, ""), "200000"),
            (
                target(r#"{"box": {"foot": [0, 0, 0], "size": [1, 0, 1]}}"#, ""),
                "0 is not a positive length; give metres",
            ),
            (
                target(r#"{"box": {"min": [0, 0, 0], "max": [1, 1, 0]}}"#, ""),
                "box.max[2]: 0 is not above min (0); give it an extent",
            ),
            (
                target(r#"{"cylinder": {"foot": [0, 0, 0], "radius": 0, "height": 1}}"#, ""),
                "cylinder.radius: 0 is not a positive length; give metres",
            ),
            (
                target(r#"{"cylinder": {"foot": [0, 0, 0], "radius": 1, "height": -1}}"#, ""),
                "cylinder.height: -1 is not a positive length; give metres",
            ),
            (
                target(r#"{"plane": {"min": [0, 0], "max": [1, 0], "z": 0}}"#, ""),
                "plane.max[1]: 0 is not above min (0); give it an extent",
            ),
            (
                target(r#"{"box": {"foot": [0, 0, 0], "size": [1, 1e-9, 1e-9]}}"#, ""),
                "along two axes: beams cannot meet a target without size; give",
            ),
            (target(r#"{"box": {"foot": [0, 0, 0], "size": [900, 1, 1]}}"#, ""), "millimetres"),
            (r#"{"sightline": 1, "roi": {}}"#.to_owned(), "a scene"),
        ];
        for (text, word) in cases {
            assert_holds!(refused(&text), "t.json", word);
        }
        assert_holds!(Target::named("chidl").unwrap_err(), "`child`");
    }

    #[test]
    fn a_target_without_an_area_is_refused_and_one_of_a_preset_name_is_noted() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("t.json");
        let target = |shape: &str| {
            let text = format!(r#"{{"sightline": 1, "name": "car", "shapes": [{shape}]}}"#);
            std::fs::write(&file, text).unwrap();
            Target::read(&file)
        };
        let named = target(r#"{"box": {"foot": [0, 0, 0], "size": [1, 1, 1]}}"#).unwrap();
        assert_holds!(named.notes[0].text(), "name: `car` is the name of a preset, too");
        if cfg!(feature = "mesh") {
            let line = "v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 2 3\n";
            std::fs::write(dir.path().join("a.obj"), line).unwrap();
            let told = target(r#"{"mesh": {"file": "a.obj"}}"#).unwrap_err();
            assert_holds!(
                told,
                "shapes: a list without an area",
                "; give its shapes lengths in metres"
            );
        }
    }

    #[test]
    fn a_target_off_its_origin_is_moved_to_its_middle_and_noted() {
        let text = r#"{"sightline": 1, "name": "t",
            "shapes": [{"box": {"foot": [2, 0, 0.5], "size": [1, 1, 1]}}]}"#;
        let target = Target::from_text(text, Path::new(""), "t.json").unwrap();
        assert_eq!(target.corners, [[-0.5, -0.5, 0.5], [0.5, 0.5, 1.5]]);
        assert_holds!(target.notes[0], "x = 2.000 m");
        assert_holds!(target.notes[1], "z = 0.500 m");
    }
}
