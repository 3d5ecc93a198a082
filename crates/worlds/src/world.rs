//! From a network to a whole world, and why one could not be made.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;

use glam::DVec2;
use lidar_cast::geom::TriangleSoup;
use lidar_cast::maths;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use sightline_files::Note;
use sightline_scene::scene::DEFAULT_CLASSES;

use crate::network::{GroundRect, Line, Network, Street, class, left_of};
use crate::population::{Population, PopulationDraft};
use crate::style::{Style, WorldKind};
use crate::surfaces::{HOUSE, ROAD, THING, WALK, WorldDraft};
use crate::traffic::{ActorPose, BodyPart, RATE, Trajectory};
use crate::{opendrive, style, traffic};

/// A world: its static triangles, and who moves through it.
#[derive(Debug)]
pub struct GeneratedWorld {
    model: TriangleSoup,
    pub(crate) people: Population,
    pub(crate) frames: usize,
    houses: Vec<[DVec2; 4]>,
    trees: Vec<DVec2>,
    pub(crate) network: Network,
}

impl GeneratedWorld {
    /// Triangles of the static world with classes of the default classes, in metres.
    pub fn mesh(&self) -> &TriangleSoup {
        &self.model
    }

    /// Sentences about the map that the world stands on.
    pub fn notes(&self) -> &[Note] {
        &self.network.notes
    }

    /// Corners of the houses in plan, in metres.
    pub fn houses(&self) -> &[[DVec2; 4]] {
        &self.houses
    }

    /// Feet of the trees in plan, in metres.
    pub fn trees(&self) -> &[DVec2] {
        &self.trees
    }

    /// The scene of this world, whose static triangles lie in the file `mesh` beside it.
    ///
    /// Region, LiDAR and mount equal those of the example scenes; the LiDAR has 720 azimuth steps.
    pub fn scene(&self, name: &str, mesh: &str) -> Value {
        let used: BTreeSet<usize> = self.people.actors.iter().map(|a| a.model).collect();
        let models = used.iter().map(|&m| &self.people.models[m]);
        let shapes: BTreeMap<&str, &[BodyPart]> =
            models.map(|m| (m.name.as_str(), m.parts.as_slice())).collect();
        let actors: Vec<Value> = self
            .people
            .actors
            .iter()
            .enumerate()
            .map(|(i, a)| {
                let model = &self.people.models[a.model];
                let track = &self.people.scene.tracks[a.track];
                let (key, motion) = motion(track, self.frames);
                json!({ "name": format!("{}-{i}", model.kind), "kind": model.kind,
                    "parts": [{ "shape": model.name }], key: motion })
            })
            .collect();
        let (body, _) = traffic::ego();
        let ego = &self.people.scene.tracks[self.people.ego];
        json!({
            "sightline": 1,
            "name": name,
            "roi": { "min": [-40, -40, -0.5], "max": [40, 40, 5.5], "voxel": [0.2, 0.2, 0.2] },
            "lidar": { "channels": 16, "fov": [-24.8, 2.0], "azimuth_steps": 720, "range": 100 },
            "mount": { "min": [-0.6, -0.6, 2.2], "max": [0.6, 0.6, 2.8], "roll": [-0.3, 0.3],
                       "min_distance": 0.2, "lidars": 4 },
            "coverage": "first-hit",
            "frames": self.frames,
            "rate": RATE,
            "ego": { "body": body, "poses": poses(ego, self.frames) },
            "static": [mesh_shape(&self.model, mesh)],
            "shapes": shapes,
            "actors": actors,
        })
    }
}

/// A generator for one step of making a world, so that steps do not disturb each other.
fn lot(seed: u64, step: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(step);
    rng
}

/// Makes a world of a kind for `frames` frames at 10 frames a second; the seed decides everything.
///
/// # Errors
/// No way is long enough for that many frames.
pub fn generate(kind: WorldKind, seed: u64, frames: usize) -> Result<GeneratedWorld, WorldError> {
    let mut rng = lot(seed, kind as u64 + 1);
    let mut network = style::plan(kind, &mut rng).network();
    network.lift(style::relief(kind, &mut rng));
    let mut style = kind.style();
    // Two worlds of a kind differ in how full they are, too.
    let fill = 0.6 + 0.8 * rng.random_range(0.0..1.0);
    style.vehicles = (style.vehicles as f64 * fill).round() as usize;
    style.pedestrians = (style.pedestrians as f64 * fill).round() as usize;
    furnished(network, style, seed, frames, kind.name(), |draft| match kind {
        WorldKind::Highway => draft.bridge(),
        WorldKind::Yard => draft.rails(),
        _ => {}
    })
}

/// Makes a town on the roads of an OpenDRIVE document; `file` names it in errors.
///
/// Coordinates are the document's. Houses, trees, lamps and signs stand along its roads,
/// vehicles drive on its lanes, and the ego follows one of them for 100 m or more by lot.
pub fn import_opendrive(
    text: &str,
    file: &str,
    seed: u64,
    frames: usize,
) -> Result<GeneratedWorld, WorldError> {
    let network = opendrive::network(text, file)?;
    let walks = network.streets.iter().filter(|s| s.walks.iter().any(|w| *w > 0.0)).count();
    let town = 2 * walks >= network.streets.len();
    let style = if town { WorldKind::Town.style() } else { WorldKind::Highway.style() };
    let style = Style { trees: 16.0, ..style };
    furnished(network, style, seed, frames, file, |_| {})
}

fn furnished(
    mut network: Network,
    style: Style,
    seed: u64,
    frames: usize,
    file: &str,
    special: impl FnOnce(&mut WorldDraft<'_>),
) -> Result<GeneratedWorld, WorldError> {
    let (frames, people, rng) = (frames.max(1), Population::default(), lot(seed, 20));
    let draft = PopulationDraft { network: &network, style: &style, frames, people, rng };
    let people = draft.populate().map_err(|[wanted, longest]| {
        let mend = "ask for fewer frames or give a larger network";
        WorldError::Refused(format!("{file}: {}; {mend}", no_way(wanted, longest)))
    })?;
    let mut draft = WorldDraft::new(&network, &style, lot(seed, 23));
    special(&mut draft);
    draft.rng = lot(seed, 21);
    draft.build();
    draft.rng = lot(seed, 22);
    draft.furnish();
    let WorldDraft { model, houses, trees, left_out, .. } = draft;
    if left_out > 0 {
        network.notes.push(Note::fact(format!(
            "{file}: {left_out} signals would stand on the road and are left out; give them the height of a plate over it"
        )));
    }
    Ok(GeneratedWorld { model: model.soup, people, frames, houses, trees, network })
}

impl WorldDraft<'_> {
    /// A bridge across the motorway, and walls against noise.
    fn bridge(&mut self) {
        let Some(street) = self.network.streets.first() else { return };
        let [left, right] = &street.edges;
        let s = self.rng.random_range(0.4..0.6) * left.length();
        let (a, b) = (left.at(s), right.at(s / left.length() * right.length()));
        let (middle, across) = ((a + b) * 0.5, (a - b).truncate());
        let half = 0.5 * across.length() + 8.0;
        let deck = GroundRect::new(middle.truncate(), across.normalize_or(DVec2::Y), [half, 4.5]);
        let z = middle.z + 5.2;
        self.model.block(&deck, [z, z + 0.9], class::BRIDGE);
        self.model.quad(deck.corners().map(|p| p.extend(z)), class::BRIDGE);
        for side in [-1.0, 1.0] {
            let railing = deck.part([-1.0, 1.0], [side * 0.97, side * 0.93]);
            self.model.block(&railing, [z + 0.9, z + 1.9], class::BRIDGE);
            let pier = deck.part([side * 0.97, side * 0.8], [-0.9, 0.9]);
            let foot = self.terrain.height(pier.middle) - 0.5;
            if !self.mask.touches(&pier, ROAD) {
                self.model.block(&pier, [foot, z], class::BRIDGE);
            }
        }
        self.mask.block(&deck, THING);
        let wall = Line::new(left.offset(6.0)).part(0.0, 0.3 * left.length());
        for pair in wall.points().windows(2) {
            let middle = (pair[0] + pair[1]).truncate() * 0.5;
            let ahead = (pair[1] - pair[0]).truncate();
            let half = [0.5 * ahead.length(), 0.12];
            let panel = GroundRect::new(middle, ahead.normalize_or(DVec2::X), half);
            let z = self.terrain.height(middle);
            self.model.block(&panel, [z - 0.3, z + 3.5], class::WALL);
            self.mask.block(&panel, THING);
        }
    }

    /// A siding beside the main road of a yard: two rails on sleepers.
    fn rails(&mut self) {
        let length = |street: &&Street| street.edges[1].length();
        let streets = self.network.streets.iter();
        let Some(street) = streets.max_by(|a, b| length(a).total_cmp(&length(b))) else { return };
        let track = Line::new(street.edges[1].offset(-3.2));
        let mut beds = Vec::new();
        let mut s = 0.0;
        while s + 1.0 < track.length() {
            let (at, ahead) = (track.at(s + 0.5), track.heading(s + 0.5));
            let middle = at.truncate();
            let z = self.terrain.height(middle);
            let bed = GroundRect::new(middle, ahead, [0.5, 1.3]);
            if !self.mask.touches(&bed, ROAD | WALK | HOUSE) {
                let sleeper = bed.part([-0.25, 0.25], [-1.0, 1.0]);
                self.model.block(&sleeper, [z, z + 0.14], class::RAIL_TRACK);
                for side in [-0.75, 0.75] {
                    let rail = GroundRect::new(middle + left_of(ahead) * side, ahead, [0.5, 0.05]);
                    self.model.block(&rail, [z, z + 0.3], class::RAIL_TRACK);
                }
                beds.push(bed);
            }
            s += 1.0;
        }
        beds.iter().for_each(|bed| self.mask.block(bed, THING | HOUSE));
    }
}

/// Words for a way that is too short for an ego, with the length that it lacks.
fn no_way(wanted: f64, longest: f64) -> String {
    let wanted = (wanted * 10.0).ceil() / 10.0;
    let rounded = (longest * 10.0).round() / 10.0;
    if longest >= wanted {
        return format!(
            "none of the sequences of driving lanes tried, {rounded} m the longest, lets the ego drive {wanted} m from a lane \
             outside junctions that is 2.2 m wide"
        );
    }
    let longest = if rounded < wanted { rounded } else { (longest * 10.0).floor() / 10.0 };
    format!("no sequence of driving lanes is {wanted} m long, the longest tried has {longest} m")
}

/// Why a world could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the message tells the fields")]
pub enum WorldError {
    #[error("{file}: {source}; give an OpenDRIVE document with at least one road")]
    OpenDrive { file: String, source: Box<xodr::ImportError> },
    #[error("{file}: {source}; give an OpenDRIVE file (.xodr)")]
    File { file: String, source: std::io::Error },
    /// Any other file, element or size; the sentence names it and the mend.
    #[error("{0}")]
    Refused(String),
}

impl WorldError {
    pub(crate) fn too_large(file: &str, what: &'static str, value: f64, most: f64) -> Self {
        Self::Refused(format!(
            "{file}: the {what} are {value}, a world holds at most {most}; cut a region out of the map, and move it to the \
             origin"
        ))
    }
}

/// The shape that reads the mesh in `file` with the classes of its labels.
pub fn mesh_shape(soup: &TriangleSoup, file: &str) -> Value {
    let used: BTreeSet<u16> = soup.face_class.iter().copied().collect();
    let name = |c: u16| (c.to_string(), json!(DEFAULT_CLASSES[usize::from(c)]));
    let classes: serde_json::Map<String, Value> = used.into_iter().map(name).collect();
    json!({ "class": "static", "mesh": { "file": file, "classes": classes } })
}

fn round(v: f64, places: f64) -> f64 {
    (v * places).round() / places
}

fn poses(track: &Trajectory, frames: usize) -> Vec<Value> {
    let pose = |stand: &ActorPose| {
        let [x, y, z] = stand.at.to_array().map(|v| round(v, 1e3));
        let mut pose = json!({ "x": x, "y": y, "z": z, "yaw": round(stand.yaw, 1e4) });
        let pitch = round(stand.pitch, 1e4);
        if pitch != 0.0 {
            pose["pitch"] = json!(pitch);
        }
        pose
    };
    (0..frames).map(|t| pose(track.stand(t))).collect()
}

/// A parked thing as a route without speed, all others as a pose a frame.
fn motion(track: &Trajectory, frames: usize) -> (&'static str, Value) {
    let [stand] = track.stands.as_slice() else { return ("poses", json!(poses(track, frames))) };
    let [x, y, z] = stand.at.to_array().map(|v| round(v, 1e3));
    let (sin, cos) = maths::sin_cos(stand.yaw);
    let points = [[x, y, z], [round(x + cos, 1e4), round(y + sin, 1e4), z]];
    ("route", json!({ "points": points, "spacing": 0 }))
}

/// Writes a mesh as binary PLY with the class of each face as `label`.
pub fn write_ply(soup: &TriangleSoup, file: &mut impl Write) -> std::io::Result<()> {
    write!(
        file,
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\n\
         property float y\nproperty float z\nelement face {}\n\
         property list uchar int vertex_indices\nproperty uchar label\nend_header\n",
        soup.vertices.len(),
        soup.faces.len()
    )?;
    for coordinate in soup.vertices.iter().flatten() {
        file.write_all(&coordinate.to_le_bytes())?;
    }
    for (face, &class) in soup.faces.iter().zip(&soup.face_class) {
        file.write_all(&[3])?;
        for vertex in face {
            file.write_all(&vertex.to_le_bytes())?;
        }
        file.write_all(&[class as u8])?;
    }
    Ok(())
}
