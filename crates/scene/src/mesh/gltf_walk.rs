//! The nodes of a glTF scene: instances, skins, morph targets, and the triangles of their meshes.

use glam::{DMat4, DQuat, DVec3};
use gltf::accessor::{Accessor, DataType, Dimensions};
use gltf::mesh::{Mode, Semantic};

use super::gltf::Data;
use super::{MOST_TRIANGLES, MeshFault, Parsed, RawMesh};
use sightline_files::Note;

const MAX_DEPTH: usize = 64;
/// Most vertices; primitives may share an accessor, so a small file can ask for any number.
const MAX_VERTICES: usize = 3 * MOST_TRIANGLES;
/// Most sets of four joints at a vertex.
const MOST_JOINT_SETS: u32 = 8;

/// Nodes of a scene in order, and the mesh that they make.
pub(super) struct NodeWalk<'a> {
    mesh: RawMesh,
    data: Data,
    document: &'a gltf::Document,
    /// Matrix from each node's frame to its parent's.
    frames: Vec<DMat4>,
    accessors: Vec<Accessor<'a>>,
    /// Where each node of the scene stands. glTF demands a tree: a node with two parents could make a loop, or
    /// exponentially many copies.
    placed: Vec<Option<DMat4>>,
    shown: Vec<gltf::Node<'a>>,
}

impl<'a> NodeWalk<'a> {
    pub(super) fn new(
        document: &'a gltf::Document,
        frames: Vec<DMat4>,
        data: Data,
        mesh: RawMesh,
    ) -> Self {
        let placed = vec![None; document.nodes().len()];
        let accessors = document.accessors().collect();
        Self { mesh, data, document, frames, accessors, placed, shown: Vec::new() }
    }

    pub(super) fn run(mut self, scene: &gltf::Scene<'a>) -> Parsed<RawMesh> {
        for node in scene.nodes() {
            self.place(node, DMat4::IDENTITY, 0, true)?;
        }
        for node in std::mem::take(&mut self.shown) {
            self.node(&node)?;
        }
        let outside =
            |node: &gltf::Node<'_>| node.mesh().is_some() && self.placed[node.index()].is_none();
        let outside = self.document.nodes().filter(outside).count();
        if outside > 0 {
            self.mesh.notes.push(Note::doubt(format!(
                "{outside} nodes with meshes are in other scenes than scene {}, or in none, and are passed over; put \
                 them into one scene",
                scene.index()
            )));
        }
        Ok(self.mesh)
    }

    fn place(
        &mut self,
        node: gltf::Node<'a>,
        outer: DMat4,
        depth: usize,
        shows: bool,
    ) -> Parsed<()> {
        let index = node.index();
        let placed = outer * self.frames.get(index).copied().unwrap_or_default();
        let fault = |problem: String| Err(MeshFault::new(format!("node {index}"), problem));
        if self.placed[index].replace(placed).is_some() {
            return fault(
                "has two parents; give it one, and each copy a node of its own".to_owned(),
            );
        }
        if depth > MAX_DEPTH {
            return fault(format!("is nested more than {MAX_DEPTH} nodes deep; flatten the tree"));
        }
        let visible = node.extension_value("KHR_node_visibility").map(|value| &value["visible"]);
        if visible.is_some_and(|visible| !visible.is_boolean() && !visible.is_null()) {
            return fault("says `visible` otherwise than by true or false; correct it".to_owned());
        }
        let hidden = visible.is_some_and(|visible| *visible == false);
        let shows = shows && !hidden;
        for child in node.children() {
            self.place(child, placed, depth + 1, shows)?;
        }
        if shows && node.mesh().is_some() {
            self.shown.push(node);
        }
        Ok(())
    }

    fn node(&mut self, node: &gltf::Node<'_>) -> Parsed<()> {
        let Some(mesh) = node.mesh() else { return Ok(()) };
        let fault = |problem| MeshFault::new(format!("node {}", node.index()), problem);
        let instances = node.extension_value("EXT_mesh_gpu_instancing");
        if instances.is_some() && node.skin().is_some() {
            return Err(fault(
                "has a skin and instances, which are not read together; export copies".to_owned(),
            ));
        }
        let placed = self.placed[node.index()].unwrap_or_default();
        let places = match instances {
            Some(value) => {
                self.instances(value).map_err(fault)?.iter().map(|m| placed * *m).collect()
            }
            None => vec![placed],
        };
        let joints = match node.skin() {
            Some(skin) => Some(self.joints(&skin).map_err(fault)?),
            None => None,
        };
        let weights = node.weights().or(mesh.weights()).unwrap_or_default();
        for primitive in mesh.primitives() {
            let name = format!("mesh {}, primitive {}", mesh.index(), primitive.index());
            self.primitive(&primitive, &places, joints.as_deref(), weights)
                .map_err(|problem| MeshFault::new(name, problem))?;
        }
        Ok(())
    }

    /// Where the copies of EXT_mesh_gpu_instancing stand, in the frame of their node.
    fn instances(&self, value: &serde_json::Value) -> Result<Vec<DMat4>, String> {
        let read = |name: &str, shape: Dimensions| {
            let Some(index) = value["attributes"].get(name) else { return Ok(None) };
            let accessor =
                index.as_u64().and_then(|index| self.accessors.get(usize::try_from(index).ok()?));
            let accessor =
                accessor.ok_or_else(|| format!("has instances whose {name} is no accessor"))?;
            self.data.read(accessor, shape).map(Some)
        };
        let moved = read("TRANSLATION", Dimensions::Vec3)?;
        let turned = read("ROTATION", Dimensions::Vec4)?;
        let scaled = read("SCALE", Dimensions::Vec3)?;
        let counts = [(&moved, 3), (&turned, 4), (&scaled, 3)];
        let mut counts =
            counts.iter().filter_map(|(list, size)| list.as_ref().map(|list| list.len() / size));
        let count = counts.next().ok_or("has instances without TRANSLATION, ROTATION or SCALE")?;
        if counts.any(|other| other != count) {
            return Err("has instances whose attributes differ in number".to_owned());
        }
        let three = |list: &Option<Vec<f64>>, i: usize, other: DVec3| {
            list.as_ref().map_or(other, |list| DVec3::from_slice(&list[3 * i..]))
        };
        let place = |i: usize| {
            let turn = turned
                .as_ref()
                .map_or(DQuat::IDENTITY, |list| DQuat::from_slice(&list[4 * i..]).normalize());
            DMat4::from_scale_rotation_translation(
                three(&scaled, i, DVec3::ONE),
                turn,
                three(&moved, i, DVec3::ZERO),
            )
        };
        Ok((0..count).map(place).collect())
    }

    /// Matrices of the joints of a skin: the node with the skin has no part in them.
    fn joints(&self, skin: &gltf::Skin<'_>) -> Result<Vec<DMat4>, String> {
        let inverse = skin.inverse_bind_matrices();
        let inverse =
            inverse.map(|accessor| self.data.read(&accessor, Dimensions::Mat4)).transpose()?;
        let matrix = |(i, joint): (usize, gltf::Node<'_>)| {
            let placed =
                self.placed[joint.index()].ok_or("has a skin with joints outside of its scene")?;
            let bind = match &inverse {
                None => DMat4::IDENTITY,
                Some(list) => {
                    let list = list.get(16 * i..16 * i + 16);
                    DMat4::from_cols_slice(list.ok_or("has a skin with more joints than matrices")?)
                }
            };
            Ok(placed * bind)
        };
        skin.joints().enumerate().map(matrix).collect()
    }

    fn primitive(
        &mut self,
        primitive: &gltf::Primitive<'_>,
        places: &[DMat4],
        joints: Option<&[DMat4]>,
        weights: &[f32],
    ) -> Result<(), String> {
        let mode = primitive.mode();
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            return Ok(());
        }
        let accessor = primitive.get(&Semantic::Positions).ok_or("has no positions")?;
        let is_packed = primitive.extension_value("KHR_draco_mesh_compression").is_some();
        if is_packed && accessor.view().is_none() && accessor.sparse().is_none() {
            let packed = "has its data in KHR_draco_mesh_compression alone, which is not read; export it without";
            return Err(packed.to_owned());
        }
        let count = accessor.count();
        let triangles = triangles(mode, primitive.indices().map_or(count, |i| i.count()))?;
        let fits = |have: usize, more: usize, most: usize| {
            more.checked_mul(places.len()).is_some_and(|more| have.saturating_add(more) <= most)
        };
        if !fits(self.mesh.faces.len(), triangles, MOST_TRIANGLES)
            || !fits(self.mesh.vertices.len(), count, MAX_VERTICES)
        {
            return Err(format!("is one too many: {MOST_TRIANGLES} triangles may be there"));
        }
        let points = self.positions(primitive, &accessor, weights)?;
        let indices = self.indices(primitive, count)?;
        let material = self.mesh.material(primitive.material().name());
        let mut add = |points: &mut dyn Iterator<Item = DVec3>| {
            let base = self.mesh.vertices.len() as u32;
            self.mesh.vertices.extend(points);
            let corner = |i: usize| indices[i] + base;
            (0..triangles).try_for_each(|i| {
                let face = match mode {
                    Mode::Triangles => [3 * i, 3 * i + 1, 3 * i + 2],
                    Mode::TriangleStrip if i % 2 == 1 => [i + 1, i, i + 2],
                    Mode::TriangleStrip => [i, i + 1, i + 2],
                    _ => [0, i + 1, i + 2],
                };
                self.mesh.triangle(face.map(corner), material)
            })
        };
        match joints {
            Some(joints) => {
                let matrices = skinned(&self.data, primitive, joints, count)?;
                add(&mut points
                    .iter()
                    .zip(&matrices)
                    .map(|(point, matrix)| matrix.transform_point3(*point)))
            }
            None => places.iter().try_for_each(|place| {
                add(&mut points.iter().map(|point| place.transform_point3(*point)))
            }),
        }
    }

    /// Positions with the morph targets that have a weight.
    fn positions(
        &self,
        primitive: &gltf::Primitive<'_>,
        accessor: &Accessor<'_>,
        weights: &[f32],
    ) -> Result<Vec<DVec3>, String> {
        let mut numbers = self.data.read(accessor, Dimensions::Vec3)?;
        let targets = primitive.morph_targets().count();
        if targets > 0 && ![0, targets].contains(&weights.len()) {
            let given = weights.len();
            return Err(format!(
                "has {targets} morph targets and {given} weights; give each its own"
            ));
        }
        for (target, weight) in
            primitive.morph_targets().zip(weights).filter(|(_, weight)| **weight != 0.0)
        {
            let Some(moves) = target.positions() else { continue };
            let moves = self.data.read(&moves, Dimensions::Vec3)?;
            if moves.len() != numbers.len() {
                return Err("has a morph target of another length".to_owned());
            }
            numbers
                .iter_mut()
                .zip(moves)
                .for_each(|(number, by)| *number += f64::from(*weight) * by);
        }
        Ok(numbers.chunks_exact(3).map(DVec3::from_slice).collect())
    }

    fn indices(&self, primitive: &gltf::Primitive<'_>, count: usize) -> Result<Vec<u32>, String> {
        let Some(accessor) = primitive.indices() else { return Ok((0..count as u32).collect()) };
        let known = matches!(accessor.data_type(), DataType::U8 | DataType::U16 | DataType::U32);
        if !known || accessor.normalized() {
            return Err("has indices that are not whole numbers".to_owned());
        }
        let indices = self.data.read(&accessor, Dimensions::Scalar)?;
        if let Some(index) = indices.iter().find(|&&i| i >= count as f64) {
            return Err(format!("refers to vertex {index}, it has {count}"));
        }
        Ok(indices.into_iter().map(|index| index as u32).collect())
    }
}

/// Triangles of a primitive with so many corners.
fn triangles(mode: Mode, corners: usize) -> Result<usize, String> {
    match mode {
        Mode::Triangles if !corners.is_multiple_of(3) => {
            Err(format!("has {corners} corners, which make no whole triangles; export it again"))
        }
        Mode::Triangles => Ok(corners / 3),
        _ => Ok(corners.saturating_sub(2)),
    }
}

/// Matrix of each vertex of a primitive with a skin: the mean of its joints by weight.
fn skinned(
    data: &Data,
    primitive: &gltf::Primitive<'_>,
    joints: &[DMat4],
    count: usize,
) -> Result<Vec<DMat4>, String> {
    let mut sums = vec![(DMat4::ZERO, 0.0); count];
    for set in 0..MOST_JOINT_SETS {
        let (Some(which), Some(share)) =
            (primitive.get(&Semantic::Joints(set)), primitive.get(&Semantic::Weights(set)))
        else {
            break;
        };
        let [which, share] =
            [data.read(&which, Dimensions::Vec4)?, data.read(&share, Dimensions::Vec4)?];
        if which.len() != 4 * count || share.len() != 4 * count {
            return Err("has joints or weights that differ in number from its vertices".to_owned());
        }
        for (i, (joint, weight)) in
            which.iter().zip(&share).enumerate().filter(|(_, (_, weight))| **weight != 0.0)
        {
            let matrix = joints
                .get(*joint as usize)
                .ok_or("refers to a joint that its skin does not have")?;
            let sum = &mut sums[i / 4];
            *sum = (sum.0 + *matrix * *weight, sum.1 + weight);
        }
    }
    let mean = |(sum, weight): (DMat4, f64)| match weight > 0.0 {
        true => Ok(sum * (1.0 / weight)),
        false => Err("has a skin, and vertices without joints or weights".to_owned()),
    };
    sums.into_iter().map(mean).collect()
}
