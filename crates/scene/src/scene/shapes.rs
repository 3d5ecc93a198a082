//! From shape descriptions to triangles: classes, copies, named shapes, meshes and robots.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use glam::DVec3;
use sightline_files::Note;
use sightline_files::json::check::bad;
use sightline_files::json::{Checked, Location, check, nearest};

use super::classes::Classes;
use super::description::{Dictionary, MeshDescription, ShapeDescription, UrdfDescription};
use super::solid::{Solid, copies, cuboid, cylinder, plane, prism};
use crate::mesh::{
    self, Geometry, MOST_TRIANGLES, OriginAngles, Placing, RawMesh, RobotFile, RobotShapes,
};
use crate::vehicle;

/// Most triangles of a scene: static world, actors, ego body and each named shape once.
const MAX_TRIANGLES: u64 = MOST_TRIANGLES as u64;
const MAX_DEPTH: usize = 8;
const KINDS: &[&str] = &["box", "prism", "cylinder", "plane", "mesh", "urdf", "shape"];
/// Corners of a cylinder's base, and of a sphere's circles of latitude.
const SIDES: u32 = 32;
/// Bands of a sphere from pole to pole.
const BANDS: u32 = 16;
/// Links of a robot that a doubt names.
const MOST_LINKS: usize = 6;

/// Builds triangles from shapes; loads each mesh file once.
pub(crate) struct Builder<'a> {
    classes: &'a Classes,
    /// True while shapes of the own body are built.
    is_own: bool,
    named: &'a Dictionary<Vec<ShapeDescription>>,
    by_name: HashMap<&'a str, usize>,
    /// Place of the key `shapes`.
    named_at: Location,
    dir: &'a Path,
    meshes: HashMap<PathBuf, Rc<RawMesh>>,
    /// Files that are no meshes.
    others: Vec<PathBuf>,
    /// Named shapes already built: a copy costs its triangles alone.
    built: HashMap<&'a str, Rc<Solid>>,
    /// Triangles built so far, named shapes included, and the most there may be.
    triangles: u64,
    most: u64,
    notes: Vec<Note>,
}

impl<'a> Builder<'a> {
    pub(crate) fn new(
        top: &Location,
        classes: &'a Classes,
        named: &'a Dictionary<Vec<ShapeDescription>>,
        dir: &'a Path,
    ) -> Self {
        let named_at = top.key("shapes");
        let (meshes, built) = (HashMap::new(), HashMap::new());
        let by_name = named.0.iter().enumerate().map(|(i, (name, _))| (name.as_str(), i)).collect();
        Self {
            classes,
            is_own: false,
            named,
            by_name,
            named_at,
            dir,
            meshes,
            others: vec![],
            built,
            triangles: 0,
            most: MAX_TRIANGLES,
            notes: vec![],
        }
    }

    /// A builder of at most so many triangles.
    pub(crate) fn limited(self, most: u64) -> Self {
        Self { most, ..self }
    }

    /// The files of all meshes and robots, in alphabetical order, each once.
    pub(crate) fn files(&self) -> Vec<PathBuf> {
        let meshes = self.meshes.values().flat_map(|m| m.files.clone());
        let mut files: Vec<PathBuf> = meshes.chain(self.others.iter().cloned()).collect();
        files.sort();
        files.dedup();
        files
    }

    pub(crate) fn class_name(&self, class: u16) -> &'a str {
        &self.classes.names[usize::from(class)]
    }

    /// Notes on material names that no mesh has, and on actors that no beam can hit.
    pub(crate) fn notes(&mut self) -> Vec<Note> {
        std::mem::take(&mut self.notes)
    }

    /// Builds the named shapes, used or not.
    pub(crate) fn check_named(&mut self) -> Checked<()> {
        for (name, _) in &self.named.0 {
            let at = self.named_at.clone();
            self.named(&at, name, 0)?;
        }
        Ok(())
    }

    /// The triangles of a list of shapes, in order, and where each shape ends.
    pub(crate) fn list(&mut self, at: &Location, list: &[ShapeDescription]) -> Checked<Solid> {
        self.nested_list(at, list, 0)
    }

    /// Like [`Self::list`], of shapes of the own body.
    pub(crate) fn own_list(&mut self, at: &Location, list: &[ShapeDescription]) -> Checked<Solid> {
        self.is_own = true;
        let built = self.list(at, list);
        self.is_own = false;
        built
    }

    fn class(&self, at: &Location, name: &str) -> Checked<u16> {
        if self.is_own { self.classes.id_of_own(at, name) } else { self.classes.id(at, name) }
    }

    /// Triangles of an actor; an empty list is an error, an actor without area a note.
    pub(crate) fn actor(&mut self, at: &Location, parts: &[ShapeDescription]) -> Checked<Solid> {
        if parts.is_empty() {
            return Err(bad(at, "an empty list", "a shape; add one or leave the actor out"));
        }
        let solid = self.list(at, parts)?;
        if !solid.has_area() {
            self.notes.push(Note::doubt(format!(
                "{at}: no triangle has an area, so that no beam hits the actor; give its mesh an extent, or leave \
                 the actor out"
            )));
        }
        Ok(solid)
    }

    fn nested_list(
        &mut self,
        at: &Location,
        list: &[ShapeDescription],
        depth: usize,
    ) -> Checked<Solid> {
        let mut solid = Solid::default();
        for (i, shape) in list.iter().enumerate() {
            self.append(&at.item(i), shape, depth, &mut solid)?;
            solid.ends.push(solid.faces.len());
        }
        Ok(solid)
    }

    fn append(
        &mut self,
        at: &Location,
        shape: &ShapeDescription,
        depth: usize,
        out: &mut Solid,
    ) -> Checked<()> {
        let there = [
            shape.cuboid.is_some(),
            shape.prism.is_some(),
            shape.cylinder.is_some(),
            shape.plane.is_some(),
            shape.mesh.is_some(),
            shape.urdf.is_some(),
            shape.shape.is_some(),
        ];
        let found = there.iter().zip(KINDS).filter_map(|(&there, &kind)| there.then_some(kind));
        let found: Vec<_> = found.collect();
        if found.len() != 1 {
            return Err(check::choice(at, &found, KINDS));
        }
        let copies = copies(at, shape)?;
        if shape.repeat.as_ref().is_some_and(|repeat| repeat.count > 1 && repeat.step == [0.0; 3]) {
            let (at, count) = (at.key("repeat").key("step"), copies.len());
            self.notes.push(Note::doubt(format!(
                "{at}: 0 m, so that all {count} copies stand in one place; give the way from copy to copy"
            )));
        }
        let solid = match &shape.shape {
            Some(name) if shape.class.is_some() => {
                let mend = format!("the parts of the shape `{name}` have their own classes");
                return Err(check::misplaced(at, "class", mend));
            }
            Some(name) => self.named(&at.key("shape"), name, depth)?,
            None => Rc::new(self.single(at, shape)?),
        };
        self.triangles += solid.faces.len() as u64 * copies.len() as u64;
        self.check_count(at, self.triangles)?;
        for copy in &copies {
            out.append(&solid, copy);
        }
        Ok(())
    }

    fn check_count(&self, at: &Location, count: u64) -> Checked<()> {
        if count <= self.most {
            return Ok(());
        }
        let mend = "take fewer copies or a coarser mesh";
        Err(check::too_many(at, "triangles", count, self.most, mend))
    }

    /// Shape called `name`, used at `at` inside `depth` other named shapes.
    fn named(&mut self, at: &Location, name: &str, depth: usize) -> Checked<Rc<Solid>> {
        if let Some(solid) = self.built.get(name) {
            return Ok(Rc::clone(solid));
        }
        let named = self.named;
        let Some((name, list)) = self.by_name.get(name).map(|&i| &named.0[i]) else {
            let known = named.0.iter().map(|(k, _)| k.as_str());
            return Err(check::unknown_name(at, "shape", name, known));
        };
        if depth == MAX_DEPTH {
            let wanted = format!("nested less than {MAX_DEPTH} deep; does it contain itself?");
            return Err(bad(at, format!("{name:?}"), wanted));
        }
        let here = self.named_at.key(name);
        if list.is_empty() {
            return Err(bad(&here, "an empty list", "a shape; add one or leave the name out"));
        }
        let solid = Rc::new(self.nested_list(&here, list, depth + 1)?);
        self.built.insert(name, Rc::clone(&solid));
        Ok(solid)
    }

    /// Triangles of a primitive or mesh, before its copies are placed.
    fn single(&mut self, at: &Location, shape: &ShapeDescription) -> Checked<Solid> {
        let class = match &shape.class {
            Some(name) => Some(self.class(&at.key("class"), name)?),
            None => None,
        };
        if let Some(mesh) = &shape.mesh {
            return self.mesh(&at.key("mesh"), mesh, class);
        }
        let mend = "name the class of this shape, `\"class\": \"building\"` for example";
        let class = class.ok_or_else(|| check::missing(at, "class", mend))?;
        match shape {
            ShapeDescription { cuboid: Some(b), .. } => cuboid(&at.key("box"), b, class),
            ShapeDescription { prism: Some(p), .. } => prism(&at.key("prism"), p, class),
            ShapeDescription { cylinder: Some(c), .. } => cylinder(&at.key("cylinder"), c, class),
            ShapeDescription { plane: Some(p), .. } => plane(&at.key("plane"), p, class),
            ShapeDescription { urdf: Some(u), .. } => self.urdf(&at.key("urdf"), u, class),
            // The caller has checked for exactly one kind; meshes and names are handled above.
            _ => Ok(Solid::default()),
        }
    }

    fn mesh(
        &mut self,
        at: &Location,
        mesh: &MeshDescription,
        default: Option<u16>,
    ) -> Checked<Solid> {
        let file = self.dir.join(&mesh.file);
        let MeshDescription { scale, translate, roll, pitch, yaw, .. } = *mesh;
        let axes = mesh.axes.as_deref();
        let placing = Placing::new(at, axes, scale, translate, [roll, pitch, yaw])?;
        let mut map = HashMap::new();
        for (material, class) in &mesh.classes.0 {
            let class = self.class(&at.key("classes").key(material), class)?;
            map.insert(material.as_str(), class);
        }
        let raw = self.raw(at, &file, &placing)?;
        self.note_unused(&at.key("classes"), &file, &map, &raw);
        let class_of = |name: &Option<String>| {
            let mapped = name.as_deref().and_then(|n| map.get(n).copied());
            mapped.or(default).ok_or_else(|| {
                let told = format_args!(
                    "mesh {}: material `{}` has no class; name it in `classes` or give the shape a `class` for the rest",
                    file.display(),
                    name.as_deref().unwrap_or("(none)")
                );
                check::refused(at, told)
            })
        };
        let ids = raw.materials.iter().map(class_of).collect::<Result<Vec<_>, _>>()?;
        Ok(Solid {
            vertices: placing.vertices(at, &file, &raw)?,
            faces: raw.faces.clone(),
            classes: raw.face_material.iter().map(|&m| ids[m as usize]).collect(),
            ends: Vec::new(),
        })
    }

    /// A mesh file, read on first use.
    fn raw(&mut self, at: &Location, file: &Path, placing: &Placing) -> Checked<Rc<RawMesh>> {
        if let Some(raw) = self.meshes.get(file) {
            return Ok(Rc::clone(raw));
        }
        let raw = Rc::new(mesh::load(at, file)?);
        self.notes.extend(raw.notes.iter().cloned().chain(placing.note(at, file, &raw)));
        self.meshes.insert(file.to_owned(), Rc::clone(&raw));
        Ok(raw)
    }

    /// Notes material names that the mesh does not have: one map may serve several meshes, or hold a slip.
    fn note_unused(&mut self, at: &Location, file: &Path, map: &HashMap<&str, u16>, raw: &RawMesh) {
        let has = || raw.materials.iter().flatten().map(String::as_str);
        let mut unused: Vec<&str> =
            map.keys().copied().filter(|name| has().all(|known| known != *name)).collect();
        if unused.is_empty() {
            return;
        }
        unused.sort_unstable();
        let guess = unused.iter().find_map(|name| nearest(name, has()));
        let guess = guess.map(|known| format!("; did you mean `{known}`?")).unwrap_or_default();
        self.notes.push(Note::doubt(format!(
            "{at}: {} has no material or label `{}`{guess}",
            file.display(),
            unused.join("`, `")
        )));
    }

    /// Triangles of a robot's links.
    fn urdf(&mut self, at: &Location, urdf: &UrdfDescription, class: u16) -> Checked<Solid> {
        let UrdfDescription { translate, roll, pitch, yaw, .. } = *urdf;
        let placing = Placing::new(at, None, None, translate, [roll, pitch, yaw])?;
        let tag = urdf.geometry.as_deref().unwrap_or("visual");
        if !["visual", "collision"].contains(&tag) {
            let wanted = "\"visual\" or \"collision\"";
            return Err(bad(&at.key("geometry"), format!("{tag:?}"), wanted));
        }
        let file = self.dir.join(&urdf.file);
        let packages = urdf.packages.as_ref().map(|packages| self.dir.join(packages));
        let (packages, without) = (packages.as_deref(), &urdf.without[..]);
        let joints = &urdf.joints.0[..];
        let robot = RobotFile { file: &file, packages, tag, without, joints };
        let RobotShapes { parts, origins, missing, moved, includes, strange } = robot.parts(at)?;
        // Origins of one file share one mistake.
        let in_degrees = origins.iter().filter_map(|OriginAngles { of, angles }| {
            vehicle::of_angles(&format!("{at}: {}: {of}: rpy", file.display()), angles)
        });
        self.notes.extend(in_degrees.take(3).map(Note::doubt));
        self.note_missing(at, &file, tag, &missing);
        self.note_unread(at, &file, includes, &moved, &strange);
        self.others.push(file.clone());
        let mut solid = Solid::default();
        for part in parts {
            let shape = self.part(at, &part.geometry, class)?;
            let count = self.triangles + (solid.faces.len() + shape.faces.len()) as u64;
            self.check_count(at, count)?;
            solid.append(&shape, &placing.pose.compose(&part.root_from_part));
        }
        match solid.vertices.iter().all(|v| v.abs().max_element() <= check::MAX_METRES) {
            true => Ok(solid),
            false => {
                let wanted = "a robot within 1e9 m of the origin; correct its origins and scales";
                Err(bad(&at.key("file"), format!("{:?}", urdf.file), wanted))
            }
        }
    }

    /// Doubts about parts of a robot that are not read, and joints that do not stand at 0.
    fn note_unread(
        &mut self,
        at: &Location,
        file: &Path,
        includes: usize,
        moved: &[String],
        strange: &[String],
    ) {
        let file = file.display();
        let mut doubt =
            |words: String| self.notes.push(Note::doubt(format!("{at}: {file}: {words}")));
        let more = |all: &[String]| match all.len() {
            0 | 1 => String::new(),
            all => format!(" (and {} more)", all - 1),
        };
        if includes > 0 {
            doubt(format!(
                "<include> is not read, {includes} in all; shapes in it are missing, so merge the files and name that one"
            ));
        }
        if let Some(first) = moved.first() {
            doubt(format!(
                "<limit> or <mimic> keeps the {first}, not at 0{}; the shapes stand there",
                more(moved)
            ));
        }
        if let Some(first) = strange.first() {
            doubt(format!(
                "{first}{} is not known there, and not read; a <joint>, a <visual> and a <collision> have an <origin> each",
                more(strange)
            ));
        }
    }

    /// A doubt about links of a robot that have no shape of the kind that is meant.
    fn note_missing(&mut self, at: &Location, file: &Path, tag: &str, missing: &[String]) {
        if missing.is_empty() {
            return;
        }
        let [more, links] =
            [missing.len().saturating_sub(MOST_LINKS), missing.len().min(MOST_LINKS)];
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        let other = if tag == "visual" { "collision" } else { "visual" };
        self.notes.push(Note::doubt(format!(
            "{at}: {}: no <{tag}>, so that no beam meets them: links `{}`{more}; write `\"geometry\": \"{other}\"`, or name \
             them under `without`",
            file.display(),
            missing[..links].join("`, `")
        )));
    }

    fn part(&mut self, at: &Location, geometry: &Geometry, class: u16) -> Checked<Solid> {
        Ok(match geometry {
            Geometry::Box(edges) => Solid::cuboid(DVec3::ZERO, *edges, 0.0, class),
            Geometry::Cylinder(radius, length) => {
                let foot = DVec3::Z * (-length / 2.0);
                Solid::cylinder(foot, *radius, *length, SIDES, class)
            }
            Geometry::Sphere(radius) => Solid::sphere(*radius, [SIDES, BANDS], class),
            Geometry::Mesh(file, scale) => {
                let placing = Placing::scaled(*scale);
                let raw = self.raw(at, file, &placing)?;
                Solid::of_class(placing.vertices(at, file, &raw)?, raw.faces.clone(), class)
            }
        })
    }
}
