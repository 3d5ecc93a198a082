//! Robots in URDF: the visual or collision shapes of their links, with joints at rest or at given values.
//!
//! Read: `<link>` with `<visual>` and `<collision>` (box, cylinder, sphere, mesh), `<joint>` (type, origin, parent,
//! child, axis, limit, mimic). Passed over, since no shape depends on it: masses, materials, transmissions.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::{DMat3, DQuat, DVec3};
use roxmltree::{Document, Node, ParsingOptions};

use crate::vehicle::UrdfJoint;

use super::{Geometry, MeshFault, OriginAngles, Parsed, RobotFile, RobotPart, RobotShapes};
use lidar_cast::geom::Pose;
use sightline_files::files::stays_inside;
use sightline_files::json::{
    check, check_xml, counted, has_no_prefix, misplaced, nearest, plain_names,
};

/// Most elements, texts and comments of a file.
const MAX_NODES: u32 = 1_000_000;
/// Kinds of joints; at rest each stands as near to 0 as it can.
const JOINTS: [&str; 6] = ["fixed", "continuous", "floating", "planar", "prismatic", "revolute"];
/// Elements of a joint; no pose at rest depends on those from `calibration` on.
const OF_JOINT: [&str; 10] = [
    "origin", "parent", "child", "axis", "limit", "mimic", "calibration", "dynamics",
    "hardwareInterface", "safety_controller",
];
/// Elements of a link, further ones of simulators among them. One in capitals is told by its place.
const OF_LINK: [&str; 10] = [
    "visual", "collision", "inertial", "material", "sensor", "contact", "gravity", "kinematic",
    "self_collide", "verbose",
];
/// Elements of a shape; looks and contacts place nothing.
const OF_SHAPE: [&str; 6] =
    ["origin", "geometry", "material", "name", "verbose", "contact_coefficients"];
/// Where shapes and joints stand.
const PATHS: [&[&str]; 3] = [
    &["robot", "link", "visual", "geometry"],
    &["robot", "link", "collision", "geometry"],
    &["robot", "joint", "parent"],
];
/// Attributes of a shape's geometry.
const OF_GEOMETRY: [&str; 5] = ["size", "radius", "length", "filename", "scale"];
/// Largest scale of a mesh.
const MAX_SCALE: f64 = 1.0e6;

/// A link's place in the tree.
struct Joint {
    parent: usize,
    parent_from_child: Pose,
    rest: UrdfJoint,
}

fn fault(element: impl Into<String>, problem: impl Into<String>) -> MeshFault {
    MeshFault::new(element, problem)
}

/// An element in words: its tag and name.
fn called(node: Node) -> String {
    let tag = node.tag_name().name();
    /// Characters of a name that a message repeats.
    const MOST: usize = 40;
    match node.attribute("name") {
        Some(name) => format!("{tag} `{}`", name.chars().take(MOST).collect::<String>()),
        None => tag.to_owned(),
    }
}

/// The only child element of a name.
fn sole<'a, 'i>(node: Node<'a, 'i>, name: &str, of: &str) -> Parsed<Option<Node<'a, 'i>>> {
    let mut all = node.children().filter(|child| child.has_tag_name(name));
    let first = all.next();
    match all.next() {
        Some(_) => Err(fault(of, format!("has a second <{name}>; leave one out"))),
        None => Ok(first),
    }
}

fn attribute<'a>(node: Node<'a, '_>, key: &str, of: &str) -> Parsed<&'a str> {
    let tag = node.tag_name().name();
    node.attribute(key).ok_or_else(|| fault(of, format!("<{tag}> lacks `{key}`; add it")))
}

/// `N` finite numbers of an attribute.
fn numbers<const N: usize>(text: &str, key: &str, of: &str) -> Parsed<[f64; N]> {
    let read: Option<Vec<f64>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
    let read = read.filter(|read| read.iter().all(|v: &f64| v.abs() <= check::MAX_METRES));
    read.and_then(|read| read.try_into().ok()).ok_or_else(|| {
        let text: String = text.chars().take(40).collect();
        fault(
            of,
            format!("{key} of {text:?} is not {} within ±1e9; correct it", counted(N, "number")),
        )
    })
}

/// A length above 0 of an attribute.
fn length(node: Node, key: &str, of: &str) -> Parsed<f64> {
    let [value] = numbers(attribute(node, key, of)?, key, of)?;
    positive(value, key, of)
}

fn positive(value: f64, key: &str, of: &str) -> Parsed<f64> {
    let is_good = value > 0.0;
    is_good.then_some(value).ok_or_else(|| {
        fault(of, format!("{key} of {value} is not a length above 0 in metres; correct it"))
    })
}

/// The pose in the `<origin>` of an element; without one, that which changes nothing.
fn origin(node: Node, of: &str) -> Parsed<Pose> {
    let Some(origin) = sole(node, "origin", of)? else { return Ok(Pose::IDENTITY) };
    let known = |name: &str| ["xyz", "rpy", "quat_xyzw"].contains(&name);
    let own = |a: &roxmltree::Attribute| a.namespace().is_none() && has_no_prefix(a.name());
    let odd = |a: &roxmltree::Attribute| own(a) && !known(a.name());
    if let Some(odd) = origin.attributes().find(odd) {
        let problem = format!("<origin> has {:?}; give xyz, rpy or quat_xyzw", odd.name());
        return Err(fault(of, problem));
    }
    let three = |key: &str| numbers(origin.attribute(key).unwrap_or("0 0 0"), key, of);
    let (at, [roll, pitch, yaw]) = (DVec3::from(three("xyz")?), three("rpy")?);
    let Some(text) = origin.attribute("quat_xyzw") else {
        return Ok(Pose::new(at, roll, pitch, yaw));
    };
    let quaternion = DQuat::from_array(numbers(text, "quat_xyzw", of)?);
    if (quaternion.length() - 1.0).abs() > 1e-3 {
        return Err(fault(of, format!("quat_xyzw of {text:?} is no unit quaternion; correct it")));
    }
    Ok(Pose { rotation: DMat3::from_quat(quaternion.normalize()), translation: at })
}

impl RobotFile<'_> {
    /// Shapes of all links, without the ones to leave out; `text` is the file's content.
    pub(super) fn shapes(&self, text: &str) -> Parsed<RobotShapes> {
        let plain = plain_names(text);
        let document = document(text, &plain)?;
        let robot = document.root_element();
        let (links, names) = links(robot)?;
        let mut left_out = vec![false; links.len()];
        for name in self.without {
            let Some(&link) = names.get(name.as_str()) else {
                let near = nearest(name, names.keys().copied());
                let near = near.map(|near| format!("did you mean `{near}`?"));
                let mend = near.unwrap_or_else(|| "take it out of `without`".to_owned());
                return Err(fault("without", format!("no link is called {name:?}; {mend}")));
            };
            left_out[link] = true;
        }
        let mut above = joints(robot, &names, links.len())?;
        let moved = moved(&mut above, self.joints)?;
        let poses = at_rest(&above, &links)?;
        let other = if self.tag == "visual" { "collision" } else { "visual" };
        let (mut parts, mut missing) = (Vec::new(), Vec::new());
        for (link, &root_from_link) in poses.iter().enumerate().filter(|(k, _)| !left_out[*k]) {
            let has = |tag: &str| links[link].children().any(|node| node.has_tag_name(tag));
            if has(other) && !has(self.tag) {
                missing.extend(links[link].attribute("name").map(str::to_owned));
            }
            for shape in links[link].children().filter(|node| node.has_tag_name(self.tag)) {
                let of = called(links[link]);
                let root_from_part = root_from_link.compose(&origin(shape, &of)?);
                parts.push(RobotPart { geometry: self.geometry(shape, &of)?, root_from_part });
            }
        }
        if parts.is_empty() {
            let problem = format!(
                "has no <{}> in the links that are meant; write `\"geometry\": \"{other}\"`, or name another file",
                self.tag
            );
            return Err(fault("file", problem));
        }
        let includes = robot.children().filter(|node| node.has_tag_name("include")).count();
        let mut strange = strange(robot);
        strange.extend(misplaced(&plain, &PATHS, &["gazebo"]));
        Ok(RobotShapes { parts, origins: self.angles(robot), missing, moved, includes, strange })
    }

    /// Roll, pitch and yaw of every origin that counts, with its joint or link.
    fn angles(&self, robot: Node) -> Vec<OriginAngles> {
        let origins = robot.descendants().filter(|node| node.has_tag_name("origin"));
        let angles = |origin: Node| {
            let owner = origin.parent()?;
            let of = match owner.has_tag_name(self.tag) {
                true => owner.parent()?,
                false => Some(owner).filter(|owner| owner.has_tag_name("joint"))?,
            };
            let text = origin.attribute("rpy").filter(|_| origin.attribute("quat_xyzw").is_none());
            let angles = numbers(text?, "rpy", "").ok()?;
            Some(OriginAngles { of: called(of), angles })
        };
        origins.filter_map(angles).collect()
    }

    fn folder(&self) -> &Path {
        self.file.parent().unwrap_or(Path::new(""))
    }

    fn geometry(&self, shape: Node, of: &str) -> Parsed<Geometry> {
        let geometry = sole(shape, "geometry", of)?;
        let mut kinds =
            geometry.into_iter().flat_map(|node| node.children()).filter(Node::is_element);
        let kind = kinds.next();
        if let Some(second) = kinds.next() {
            let second = second.tag_name().name();
            let problem = format!(
                "<geometry> has a second shape, <{second}>; give each a <{}> of its own",
                self.tag
            );
            return Err(fault(of, problem));
        }
        let wanted = "give a box, cylinder, sphere or mesh";
        let Some(kind) = kind else {
            return Err(fault(of, format!("<{}> has no <geometry>; {wanted}", self.tag)));
        };
        match kind.tag_name().name() {
            "box" => {
                let [x, y, z] = numbers(attribute(kind, "size", of)?, "size", of)?;
                let edges = [x, y, z].map(|edge| positive(edge, "size", of));
                let [x, y, z] = edges;
                Ok(Geometry::Box(DVec3::new(x?, y?, z?)))
            }
            "cylinder" => {
                Ok(Geometry::Cylinder(length(kind, "radius", of)?, length(kind, "length", of)?))
            }
            "sphere" => Ok(Geometry::Sphere(length(kind, "radius", of)?)),
            "mesh" => {
                let name = attribute(kind, "filename", of)?;
                let file = self.mesh_file(name, of)?;
                let scale = numbers(kind.attribute("scale").unwrap_or("1 1 1"), "scale", of)?;
                let scale = DVec3::from(scale);
                let most = scale.abs().max_element();
                if scale.abs().min_element() == 0.0 || most > MAX_SCALE {
                    let problem =
                        "is not three numbers other than 0 and at most 1000000; correct it";
                    return Err(fault(of, format!("scale of {scale} {problem}")));
                }
                if !file.is_file() {
                    let problem =
                        format!("{name:?} is no file; copy the mesh to {}", file.display());
                    return Err(fault(of, problem));
                }
                Ok(Geometry::Mesh(file, scale))
            }
            other => Err(fault(of, format!("<{other}> is not read; {wanted}"))),
        }
    }

    fn mesh_file(&self, name: &str, of: &str) -> Parsed<PathBuf> {
        let refused = |error: sightline_files::files::FileError| fault(of, error.to_string());
        let schemes = ["package://", "model://"];
        let in_package = schemes.iter().find_map(|scheme| name.strip_prefix(scheme));
        let Some(in_package) = in_package else {
            let name = name.strip_prefix("file://").unwrap_or(name);
            if name.contains("://") {
                let problem = format!("{name:?} is not a file; copy the mesh beside the URDF");
                return Err(fault(of, problem));
            }
            return stays_inside(self.folder(), name).map_err(refused);
        };
        let (package, rest) = in_package.split_once('/').unwrap_or((in_package, ""));
        let folder = self.package(package).ok_or_else(|| {
            let problem = match self.packages {
                Some(packages) => format!(
                    "{name:?}: `\"packages\"`, {}, holds no folder `{package}`; give the folder that does, or copy the \
                     package there",
                    packages.display()
                ),
                None => format!(
                    "{name:?}: no folder `{package}` is beside the file, and none with a package.xml above it; give \
                     `\"packages\"`, the folder that holds `{package}`"
                ),
            };
            fault(of, problem)
        })?;
        stays_inside(&folder, rest).map_err(refused)
    }

    /// Folder of a ROS package: in `packages`; else beside the file, or the folder above the file of that name with a
    /// `package.xml`.
    fn package(&self, name: &str) -> Option<PathBuf> {
        // A name alone, so that no package leads out of a folder.
        if name.is_empty() || name.starts_with('.') || name.contains(['\\', ':']) {
            return None;
        }
        if let Some(packages) = self.packages {
            return Some(packages.join(name)).filter(|folder| folder.is_dir());
        }
        let beside = self.folder().join(name);
        if beside.is_dir() {
            return stays_inside(self.folder(), name).ok();
        }
        let folder = self.folder();
        let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        let here = here.canonicalize().ok()?;
        let is_it = |folder: &&Path| {
            folder.file_name().is_some_and(|own| own == name)
                && folder.join("package.xml").is_file()
        };
        here.ancestors().find(is_it).map(Path::to_owned)
    }
}

/// The document of a text, whose names are `plain` ones.
fn document<'t>(text: &str, plain: &'t str) -> Parsed<Document<'t>> {
    let unexpanded = || fault("file", "is xacro; expand it with `xacro FILE > robot.urdf`");
    let parsed = check_xml(plain).and_then(|()| {
        let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
        Document::parse_with_options(plain, options).map_err(|error| error.to_string())
    });
    let document = parsed.map_err(|problem| match text.contains("<xacro:") {
        true => unexpanded(),
        false => fault("file", format!("is not XML: {problem}; correct it")),
    })?;
    let is_xacro = |node: Node| {
        let waits = |value: &str| value.contains("${") || value.contains("$(");
        node.tag_name().namespace().is_some_and(|space| space.contains("xacro"))
            || node.attributes().any(|attribute| waits(attribute.value()))
    };
    if document.descendants().any(is_xacro) {
        return Err(unexpanded());
    }
    let root = document.root_element().tag_name().name();
    if root != "robot" {
        return Err(fault("file", format!("is a <{root}>, not a <robot>; give a URDF")));
    }
    Ok(document)
}

/// Elements and attributes that a joint or a shape does not have, and origins that place nothing, with their link or joint.
fn strange(robot: Node) -> Vec<String> {
    let mut told = Vec::new();
    for of in robot.children().filter(|of| of.has_tag_name("joint") || of.has_tag_name("link")) {
        let is_joint = of.has_tag_name("joint");
        for node in of.children().filter(Node::is_element) {
            let tag = node.tag_name().name();
            let inner = node.children().filter(Node::is_element).map(|node| node.tag_name().name());
            let odd = match tag {
                "visual" | "collision" => inner.filter(|tag| !OF_SHAPE.contains(tag)).collect(),
                "parent" | "child" if is_joint => inner.collect(),
                _ if is_joint && !OF_JOINT.contains(&tag) => vec![tag],
                _ if !is_joint && !OF_LINK.iter().any(|of| of.eq_ignore_ascii_case(tag)) => {
                    vec![tag]
                }
                _ => Vec::new(),
            };
            let plain = odd.into_iter().filter(|tag| has_no_prefix(tag));
            told.extend(plain.map(|tag| format!("<{tag}> of {}", called(of))));
            let shapes = node.children().filter(|node| node.has_tag_name("geometry"));
            for shape in shapes.flat_map(|node| node.children()).filter(Node::is_element) {
                let names = shape.attributes().map(|attribute| attribute.name());
                let odd = names.filter(|name| !OF_GEOMETRY.contains(name) && has_no_prefix(name));
                let tag = shape.tag_name().name();
                told.extend(odd.map(|name| format!("`{name}` in <{tag}> of {}", called(of))));
            }
        }
    }
    told
}

/// All links in the order of the file, and the number of each by its name.
fn links<'a, 'i>(robot: Node<'a, 'i>) -> Parsed<(Vec<Node<'a, 'i>>, HashMap<&'a str, usize>)> {
    let (mut links, mut names) = (Vec::new(), HashMap::new());
    for link in robot.children().filter(|node| node.has_tag_name("link")) {
        let name = attribute(link, "name", "link")?;
        if names.insert(name, links.len()).is_some() {
            return Err(fault(called(link), "comes twice; give each link a name of its own"));
        }
        links.push(link);
    }
    match links.is_empty() {
        true => Err(fault("file", "has no <link>; give a URDF with shapes")),
        false => Ok((links, names)),
    }
}

/// The joint above each link, none above a root.
fn joints(robot: Node, names: &HashMap<&str, usize>, count: usize) -> Parsed<Vec<Option<Joint>>> {
    let mut above: Vec<Option<Joint>> = (0..count).map(|_| None).collect();
    for joint in robot.children().filter(|node| node.has_tag_name("joint")) {
        let of = called(joint);
        let kind = attribute(joint, "type", &of)?;
        if !JOINTS.contains(&kind) {
            return Err(fault(of, format!("type {kind:?} is none of {}", JOINTS.join(", "))));
        }
        let link = |key: &str| {
            let element = sole(joint, key, &of)?;
            let element = element.ok_or_else(|| fault(&*of, format!("has no <{key}>; add it")))?;
            let name = attribute(element, "link", &of)?;
            names.get(name).copied().ok_or_else(|| {
                let near = nearest(name, names.keys().copied());
                let mend = near.map_or_else(
                    || "add the link".to_owned(),
                    |near| format!("did you mean `{near}`?"),
                );
                fault(&*of, format!("no link is called {name:?}, its {key}; {mend}"))
            })
        };
        let (parent, child) = (link("parent")?, link("child")?);
        let get = |tag: &str, key: &str| {
            joint.children().find(|node| node.has_tag_name(tag))?.attribute(key)
        };
        let name = joint.attribute("name").unwrap_or_default();
        let names = |tag: &str| {
            let element = joint.children().find(|node| node.has_tag_name(tag));
            element.map_or_else(Vec::new, |node| node.attributes().map(|a| a.name()).collect())
        };
        let rest = UrdfJoint::refuse_others(names).and_then(|()| UrdfJoint::read(name, kind, get));
        let rest = rest.map_err(|problem| fault(&*of, problem))?;
        let place = Joint { parent, parent_from_child: origin(joint, &of)?, rest };
        if let Some(other) = &above[child] {
            let problem = format!("joint `{}` has the same child; leave one out", other.rest.name);
            return Err(fault(of, problem));
        }
        above[child] = Some(place);
    }
    Ok(above)
}

/// Moves each joint to its value in `stated`, or to its rest. Joints at rest that cannot stand at 0 are told in words.
fn moved(above: &mut [Option<Joint>], stated: &[(String, f64)]) -> Parsed<Vec<String>> {
    let joints: Vec<UrdfJoint> = above.iter().flatten().map(|joint| joint.rest.clone()).collect();
    let given = UrdfJoint::given(&joints, stated).map_err(|problem| fault("joints", problem))?;
    let values = UrdfJoint::values(&joints, &given)
        .map_err(|(k, problem)| fault(format!("joint `{}`", joints[k].name), problem))?;
    let mut told = Vec::new();
    for (joint, value) in above.iter_mut().flatten().zip(values) {
        joint.parent_from_child = joint.parent_from_child.compose(&joint.rest.pose(value));
        let is_stated = stated.iter().any(|(name, _)| *name == joint.rest.name);
        if value != 0.0 && !is_stated {
            told.push(format!("joint `{}` at {}", joint.rest.name, joint.rest.words(value)));
        }
    }
    Ok(told)
}

/// Takes each link's frame to the root's.
fn at_rest(above: &[Option<Joint>], links: &[Node]) -> Parsed<Vec<Pose>> {
    let mut below: Vec<Vec<usize>> = vec![Vec::new(); above.len()];
    let mut roots = Vec::new();
    for (link, joint) in above.iter().enumerate() {
        match joint {
            Some(joint) => below[joint.parent].push(link),
            None => roots.push(link),
        }
    }
    if let [first, second, ..] = roots[..] {
        let problem = format!(
            "no joint leads to it, nor to {}; connect all links to one root",
            called(links[first])
        );
        return Err(fault(called(links[second]), problem));
    }
    let mut poses: Vec<Option<Pose>> = vec![None; above.len()];
    let mut open: Vec<(usize, Pose)> =
        roots.into_iter().map(|root| (root, Pose::IDENTITY)).collect();
    while let Some((link, pose)) = open.pop() {
        poses[link] = Some(pose);
        for &next in &below[link] {
            let step = above[next].as_ref().map_or(Pose::IDENTITY, |joint| joint.parent_from_child);
            open.push((next, pose.compose(&step)));
        }
    }
    let place = |(link, pose): (usize, Option<Pose>)| {
        let circle = "joints lead in a circle to it; connect it to the root";
        pose.ok_or_else(|| fault(called(links[link]), circle))
    };
    poses.into_iter().enumerate().map(place).collect()
}
