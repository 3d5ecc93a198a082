//! A frame of a scene with its rigs as one binary glTF file: meshes by class, actors, LiDARs, frusta, points.
//!
//! Coordinates are in the ego frame (ISO 8855: x forward, y left, z up, metres). One root node turns it into glTF's
//! own frame (x left, y up, z forward), by a rotation whose four numbers are exact.

mod container;

use std::collections::{BTreeMap, HashMap};
use std::io::Write;

use glam::DQuat;
use lidar_cast::geom::{Pose, TriangleSoup};
use serde_json::{Value, json};
use sightline_scene::scene::{PartOwner, Scene};
use sightline_scene::vehicle::{Placement, SensorPose, Sensors};

use super::{Checked, FormatError};
use container::{Container, Frustum, PrimitiveMode};

/// Takes ISO 8855 to glTF: x, y, z, w. A third of a turn about (1, 1, 1), backwards.
const GLTF_FROM_ISO: [f64; 4] = [-0.5, -0.5, -0.5, 0.5];

/// Content of a glTF file: a frame of a scene, rigs, points.
#[derive(Debug, Clone, Copy)]
pub struct GltfView<'a> {
    /// The world, its actors and the ego's body.
    pub scene: &'a Scene,
    /// Frame of the scene, in whose ego frame all stands.
    pub frame: usize,
    /// Rigs, each a node with a node for each of its LiDARs.
    pub placements: &'a [Placement],
    /// Points in the ego frame with their classes; [`sightline_scan::NO_CLASS`] for none.
    pub points: &'a [(u16, [f32; 3])],
}

/// A whole binary glTF file in memory.
#[derive(Debug, Clone)]
pub struct Glb(Container);

impl Glb {
    /// Lays a view out.
    ///
    /// # Errors
    /// A frame that the scene does not have, a sensor that its vehicle does not have, more bytes than a file
    /// of this format holds.
    pub fn of(view: &GltfView<'_>) -> Result<Self, FormatError> {
        let (scene, frames) = (view.scene, view.scene.frame_count());
        if view.frame >= frames {
            let (name, frame) = (scene.name(), view.frame);
            return Err(refused!(
                "the scene `{name}` has no frame {frame}; name one of its frames, from 0"
            ));
        }
        let mut file = Writer { out: Container::default(), view, shapes: HashMap::new() };
        let mut children = file.parts()?;
        children.extend(file.rigs()?);
        children.extend(file.points()?);
        let root = file.out.node(json!({
            "name": "sightline",
            "rotation": GLTF_FROM_ISO,
            "children": children,
            "extras": {
                "frame": "ego frame, ISO 8855: x forward, y left, z up; metres",
                "scene": scene.name(),
                "scene_frame": view.frame,
            },
        }));
        file.out.finish(scene.name(), root);
        Ok(Self(file.out))
    }

    /// Writes the file.
    pub fn write(&self, out: impl Write) -> std::io::Result<()> {
        self.0.write(out)
    }
}

/// A node's place: translation and rotation of a pose.
fn placed(pose: &Pose, mut node: Value) -> Value {
    let turn = DQuat::from_mat3(&pose.rotation).normalize();
    node["translation"] = json!(pose.translation.to_array());
    node["rotation"] = json!(turn.to_array());
    node
}

/// Triangles of each class of a soup: rising classes, corners without those that no triangle uses.
fn by_class(soup: &TriangleSoup) -> Vec<(u16, Vec<[f32; 3]>, Vec<u32>)> {
    let mut classes = soup.face_class.clone();
    classes.sort_unstable();
    classes.dedup();
    let of = |class: u16| {
        let (mut numbers, mut corners) = (HashMap::new(), Vec::new());
        let faces = soup.faces.iter().zip(&soup.face_class).filter(|(_, of)| **of == class);
        let indices = faces.flat_map(|(face, _)| *face).map(|v| {
            *numbers.entry(v).or_insert_with(|| {
                corners.push(soup.vertices[v as usize]);
                corners.len() as u32 - 1
            })
        });
        let indices = indices.collect();
        (class, corners, indices)
    };
    classes.into_iter().map(of).collect()
}

struct Writer<'v> {
    out: Container,
    view: &'v GltfView<'v>,
    /// Meshes of actors by their triangles: equal shapes share one.
    shapes: HashMap<Vec<u8>, usize>,
}

impl Writer<'_> {
    fn class(&self, class: u16) -> &str {
        self.view.scene.classes().get(usize::from(class)).map_or("none", String::as_str)
    }

    fn material(&mut self, class: u16) -> usize {
        let name = self.class(class).to_owned();
        self.out.material(&name, container::of_class(&name))
    }

    /// Static world, actors, ego body: a node each that has triangles.
    fn parts(&mut self) -> Checked<Vec<usize>> {
        let scene = self.view.scene;
        let tracks = scene.tracks();
        let mut nodes = Vec::new();
        for (part, pose) in scene.part_poses(self.view.frame).iter().enumerate() {
            if scene.part_triangles(part) == 0 {
                continue;
            }
            let soup = scene.part(part);
            let node = match scene.owner(part) {
                PartOwner::World => json!({ "name": "static", "children": self.world(&soup)? }),
                PartOwner::Ego => {
                    json!({ "name": "ego body", "mesh": self.shape("ego body", &soup)? })
                }
                PartOwner::EgoBody(body) => {
                    let name = format!("ego body {}", body + 1);
                    let mesh = self.shape(&name, &soup)?;
                    json!({ "name": format!("{name} {}", scene.own_body_name(body)).trim_end(), "mesh": mesh })
                }
                PartOwner::Actor(actor) => {
                    let kind = tracks[actor].kind.name();
                    let mesh = self.shape(&format!("{kind} {actor}"), &soup)?;
                    let name = format!("actor {actor} {}", tracks[actor].name);
                    json!({ "name": name.trim_end(), "mesh": mesh, "extras": { "kind": kind } })
                }
            };
            nodes.push(self.out.node(placed(pose, node)));
        }
        Ok(nodes)
    }

    /// A mesh and a node for each class of the static world.
    fn world(&mut self, soup: &TriangleSoup) -> Checked<Vec<usize>> {
        let mut nodes = Vec::new();
        for (class, corners, indices) in by_class(soup) {
            let name = format!("static {}", self.class(class));
            let primitive = self.triangles(class, &corners, &indices)?;
            let mesh = self.out.mesh(&name, vec![primitive]);
            nodes.push(self.out.node(json!({ "name": name, "mesh": mesh })));
        }
        Ok(nodes)
    }

    /// Mesh of a thing, a primitive for each of its classes; equal things share one mesh.
    fn shape(&mut self, name: &str, soup: &TriangleSoup) -> Checked<usize> {
        let mut key = bytemuck::cast_slice(&soup.vertices).to_vec();
        key.extend_from_slice(bytemuck::cast_slice(&soup.faces));
        key.extend_from_slice(bytemuck::cast_slice(&soup.face_class));
        if let Some(&mesh) = self.shapes.get(&key) {
            return Ok(mesh);
        }
        let mut primitives = Vec::new();
        for (class, corners, indices) in by_class(soup) {
            primitives.push(self.triangles(class, &corners, &indices)?);
        }
        let mesh = self.out.mesh(name, primitives);
        self.shapes.insert(key, mesh);
        Ok(mesh)
    }

    fn triangles(&mut self, class: u16, corners: &[[f32; 3]], indices: &[u32]) -> Checked<Value> {
        let (positions, indices) = (self.out.positions(corners)?, self.out.indices(indices)?);
        let material = self.material(class);
        Ok(PrimitiveMode::Triangles.primitive(positions, Some(indices), material))
    }

    /// A node for each placement, in it a node for each LiDAR, in it a node for its frustum.
    fn rigs(&mut self) -> Checked<Vec<usize>> {
        let placements = self.view.placements;
        if placements.is_empty() {
            return Ok(Vec::new());
        }
        let sensors = self.view.scene.sensors()?;
        let mut frusta: HashMap<usize, (usize, Frustum)> = HashMap::new();
        let mut nodes = Vec::new();
        for placement in placements {
            let mut lidars = Vec::new();
            for (number, pose) in placement.lidars.iter().enumerate() {
                let model = sensors.number(pose)?;
                if let std::collections::hash_map::Entry::Vacant(slot) = frusta.entry(model) {
                    let frustum = Frustum::of(sensors.table(model));
                    let positions = self.out.positions(&frustum.lines())?;
                    let material = self.out.material("frustum", container::FRUSTUM);
                    let lines = PrimitiveMode::Lines.primitive(positions, None, material);
                    let name = sensors.models()[model].name;
                    slot.insert((self.out.mesh(&format!("frustum {name}"), vec![lines]), frustum));
                }
                let (mesh, frustum) = &frusta[&model];
                let name = format!("{} lidar {number}", placement.name);
                lidars.push(self.lidar(&name, pose, &sensors, *mesh, frustum));
            }
            let name = format!("placement {}", placement.name);
            nodes.push(self.out.node(json!({ "name": name, "children": lidars })));
        }
        Ok(nodes)
    }

    /// A LiDAR's node; its frustum turns with the phase of the model in this frame.
    fn lidar(
        &mut self,
        name: &str,
        pose: &SensorPose,
        sensors: &Sensors,
        mesh: usize,
        frustum: &Frustum,
    ) -> usize {
        let model = sensors.number(pose).unwrap_or_default();
        let turned = sensors.ego_from_sensor(model, pose, self.view.frame);
        let phase = pose.ego_from_sensor().inverse().compose(&turned);
        let lines = json!({ "name": format!("{name} frustum"), "mesh": mesh });
        let lines = self.out.node(placed(&phase, lines));
        let table = sensors.table(model);
        let node = json!({
            "name": name,
            "children": [lines],
            "extras": {
                "sensor": sensors.models()[model].name.to_string(),
                "channels": table.grid().map(|grid| grid.channels.len()),
                "beams": table.directions().len(),
                "range": table.range(),
                "pose": pose.fields().into_iter().collect::<BTreeMap<_, _>>(),
                "frustum": frustum,
            },
        });
        self.out.node(placed(&pose.ego_from_sensor(), node))
    }

    /// A node of points for each of their classes, under one node.
    fn points(&mut self) -> Checked<Option<usize>> {
        let mut sorted = self.view.points.to_vec();
        sorted.sort_by_key(|&(class, _)| class);
        let mut nodes = Vec::new();
        for points in sorted.chunk_by(|a, b| a.0 == b.0) {
            let class = points[0].0;
            let name = format!("points {}", self.class(class));
            let places: Vec<[f32; 3]> = points.iter().map(|&(_, place)| place).collect();
            let (positions, material) = (self.out.positions(&places)?, self.material(class));
            let mesh = self
                .out
                .mesh(&name, vec![PrimitiveMode::Points.primitive(positions, None, material)]);
            nodes.push(self.out.node(json!({ "name": name, "mesh": mesh })));
        }
        if nodes.is_empty() {
            return Ok(None);
        }
        Ok(Some(self.out.node(json!({ "name": "points", "children": nodes }))))
    }
}
