//! From a scene and a P-SOG to a problem: entropies by voxel, a tree for each part of the scene, and where
//! each stands in each frame.

use std::cmp::Reverse;
use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

use rayon::prelude::*;

use super::{
    Content, Entropy, Frame, GroundRequired, Instance, OccupiedVoxel, OverlapRequired, Problem,
    ProblemError, Required, Requirement, SceneSurface, Task, World,
};
use crate::psog::{EntropyKind, EntropyTable, Psog, fixed};
use crate::scene::{Coverage, EgoBody, Ground, Scene};
use crate::vehicle::{Sensors, Vehicle};
use lidar_cast::bvh::Bvh;
use lidar_cast::geom::{Pose, TriangleSoup};
use lidar_cast::grid::Roi;
use lidar_cast::maths;
use lidar_cast::memory::{self, OutOfMemory};
use sightline_files::json::check;

/// Entropies and classes of a P-SOG's occupied voxels.
///
/// `detection` holds the class ids that count as the detection target; the other classes are
/// merged into one. The P-SOG must have fewer than 2³¹ voxels, as every grid has.
pub fn content_of(psog: &Psog, detection: &[u16]) -> Content {
    let table = EntropyTable::new(psog.frames());
    let is_target: Vec<bool> =
        (0..psog.classes().len()).map(|c| detection.contains(&(c as u16))).collect();
    let mut occupied: Vec<OccupiedVoxel> = psog
        .index()
        .par_iter()
        .zip(psog.counts().par_chunks(psog.classes().len().max(1)))
        // A voxel may be listed with no frame in which it is occupied.
        .filter(|(_, row)| row.iter().any(|&count| count > 0))
        .map(|(&index, row)| {
            let (mut target, mut rest) = (0_u32, 0_u32);
            for (&count, &is_target) in row.iter().zip(&is_target) {
                *(if is_target { &mut target } else { &mut rest }) += u32::from(count);
            }
            OccupiedVoxel {
                index: index as u32,
                entropy: [
                    fixed(table.entropy(row, EntropyKind::Segmentation)),
                    fixed(table.entropy_of_two(target, rest)),
                    fixed(table.entropy(row, EntropyKind::Bernoulli)),
                    0,
                ],
            }
        })
        .collect();
    weigh_by_distance(&mut occupied, psog);
    let voxels_by_class = voxels_by_class(psog);
    let classes = psog.classes().to_vec();
    Content::new(classes, occupied, &voxels_by_class, !detection.is_empty())
}

/// Rows of a P-SOG that are gone through at once.
const ROWS: usize = 1 << 14;

/// The voxels in which each class occurs in some frame, rising.
fn voxels_by_class(psog: &Psog) -> Vec<Vec<u32>> {
    let classes = psog.classes().len();
    let rows = psog.counts().par_chunks(ROWS * classes.max(1));
    let of_rows = |(index, rows): (&[u64], &[u16])| {
        let mut by_class = vec![Vec::new(); classes];
        for (&voxel, row) in index.iter().zip(rows.chunks_exact(classes)) {
            for (voxels, &count) in by_class.iter_mut().zip(row) {
                if count > 0 {
                    voxels.push(voxel as u32);
                }
            }
        }
        by_class
    };
    let parts: Vec<Vec<Vec<u32>>> = psog.index().par_chunks(ROWS).zip(rows).map(of_rows).collect();
    (0..classes)
        .map(|class| parts.iter().flat_map(|part| &part[class]).copied().collect())
        .collect()
}

/// Largest share that a voxel has, in fixed point: with it sums of 2³² voxels fit into 64 bits.
const LARGEST_SHARE: f64 = (1u64 << 31) as f64;
/// Metres in plan from the origin of the ego frame within which information counts in full, and ground by itself.
const NEAR: f64 = 10.0;
/// Steps of the weight of distance: voxels of few entropies keep few weights, which an atlas sums up faster.
const STEPS: f64 = 8.0;
/// Share of all information given to near ground: its own entropy is low, since it hardly changes.
const GROUND_SHARE: f64 = 0.25;

/// Writes the information of [`Entropy::Near`], in the unit in which the largest is 2³¹.
///
/// Voxel v has H(v) e(v) / Σ H e, and ¼ / G more if it is one of the G voxels of near ground. The weight
/// e = 10 m / max(10 m, d) is rounded to eighths, at least one eighth. Here d is the distance in plan from the ego
/// origin to the voxel's middle. Ground voxels have a class of ground as their commonest class (ties: the first); near
/// ones have d ≤ 10 m.
fn weigh_by_distance(occupied: &mut [OccupiedVoxel], psog: &Psog) {
    let (roi, names) = (psog.roi(), psog.classes());
    let (min, edge) = (roi.min(), roi.voxel());
    let is_class_ground = Ground::among(names);
    let rows = psog.counts().par_chunks(names.len().max(1));
    let some = rows.filter(|row| row.iter().any(|&count| count > 0));
    let is_ground: Vec<bool> = some
        .map(|row| {
            let commonest = (0..row.len()).max_by_key(|&class| (row[class], Reverse(class)));
            commonest.is_some_and(|class| is_class_ground[class])
        })
        .collect();
    let weigh = |(voxel, &is_ground): (&OccupiedVoxel, &bool)| {
        let at = roi.coords(u64::from(voxel.index));
        let [x, y] = [0, 1].map(|k| min[k] + (f64::from(at[k]) + 0.5) * edge[k]);
        let distance = maths::hypot(x, y);
        let eighths = (STEPS * NEAR / distance.max(NEAR)).round().max(1.0);
        (f64::from(Entropy::Classes.of(&voxel.entropy)) * eighths, is_ground && distance <= NEAR)
    };
    let weighed: Vec<(f64, bool)> = occupied.par_iter().zip(&is_ground).map(weigh).collect();
    let total: f64 = weighed.iter().map(|(information, _)| information).sum();
    let ground = weighed.iter().filter(|(_, is_near_ground)| *is_near_ground).count();
    let of_ground = GROUND_SHARE / ground.max(1) as f64;
    let share = |&(information, is_near_ground): &(f64, bool)| {
        information / total.max(1.0) + if is_near_ground { of_ground } else { 0.0 }
    };
    let largest = weighed.iter().map(share).fold(f64::MIN_POSITIVE, f64::max);
    for (voxel, weight) in occupied.iter_mut().zip(&weighed) {
        voxel.entropy[Entropy::Near as usize] =
            (share(weight) / largest * LARGEST_SHARE).round() as u32;
    }
}

impl Problem {
    /// The problem that a scene poses with a P-SOG, over some of the scene's frames.
    ///
    /// # Errors
    /// The P-SOG is on another grid than the scene's region of interest.
    pub fn from_scene(
        scene: &Scene,
        psog: &Psog,
        sensors: impl Into<Sensors>,
        frames: &[usize],
    ) -> Result<Self, ProblemError> {
        let bounds = scene.roi();
        let roi = psog.roi();
        let same = |a: [f64; 3], b: [f64; 3]| {
            // Half a thousandth of a voxel: decimals in two files may differ by it.
            (0..3).all(|k| (a[k] - b[k]).abs() <= 5e-4 * bounds.voxel[k])
        };
        if roi.shape() != bounds.shape
            || !same(roi.min(), bounds.min)
            || !same(roi.voxel(), bounds.voxel)
        {
            let words = |min: [f64; 3], voxel: [f64; 3], shape: [u32; 3]| {
                format!("{shape:?} voxels of {voxel:?} m from {min:?} on")
            };
            return Err(ProblemError::Refused(format!(
                "the P-SOG has {} and the scene's roi {}; build the P-SOG with the same roi or correct the roi",
                words(roi.min(), roi.voxel(), roi.shape()),
                words(bounds.min, bounds.voxel, bounds.shape)
            )));
        }
        Self::on_grid_of(psog, scene, sensors, frames)
    }

    /// Like [`Self::from_scene`], over the P-SOG's own grid, whatever the scene's region of interest is.
    ///
    /// # Errors
    /// A part of space that must be seen has no voxel; the trees do not fit into memory.
    pub fn on_grid_of(
        psog: &Psog,
        scene: &Scene,
        sensors: impl Into<Sensors>,
        frames: &[usize],
    ) -> Result<Self, ProblemError> {
        let frames = if scene.has_geometry() { frames } else { &[] };
        let ends_at_hits = matches!(scene.coverage(), Coverage::FirstHit);
        Self::in_world(psog, scene, sensors, frames, ends_at_hits, |far| {
            world_of(scene, frames, far, EgoBody::Include)
        })
    }

    /// Like [`Self::on_grid_of`], in the world that `make_world` returns for those frames; its argument is the longest
    /// range in metres. Without frames there is no world.
    pub fn in_world(
        psog: &Psog,
        scene: &Scene,
        sensors: impl Into<Sensors>,
        frames: &[usize],
        ends_at_hits: bool,
        make_world: impl FnOnce(f32) -> Result<World, OutOfMemory>,
    ) -> Result<Self, ProblemError> {
        let roi = psog.roi();
        let content = content_of(psog, &scene.detection_among(psog.classes()));
        let required = &scene.vehicle().require;
        let content = content.with_areas(roi, required);
        if let Some(index) = content.areas().iter().position(|area| area.voxels == 0) {
            let position = scene.vehicle().require_order.get(index).copied();
            let (index, area) = (position.unwrap_or(index), &required[index]);
            let (name, mend) = (&area.name, mend_of_area(content, roi, area));
            let told = format!(
                ": `{name}` holds no voxel of the scene's roi, so that no share of it can be seen; {mend}"
            );
            return Err(ProblemError::Rule(index, told));
        }
        let sensors = sensors.into().riding(scene.rides());
        let far = Task::far_range_of(roi, sensors.longest_range());
        let world = if frames.is_empty() { World::default() } else { make_world(far)? };
        let task = Task::new(*roi, content, sensors, world, ends_at_hits).numbered(frames);
        let body = own_bodies(scene, far);
        let Vehicle { targets, ground, overlap, require_order, .. } = scene.vehicle();
        let names = targets.iter().map(|rule| &rule.name);
        let names = names.chain(ground.iter().map(|rule| &rule.name));
        let mut names = names.chain(overlap.iter().map(|rule| &rule.name));
        if let Some(name) = names.next().filter(|_| !task.ends_at_hits()) {
            return Err(ProblemError::Refused(format!(
                "the vehicle requires `{name}`, and beams end at nothing in this scene; give the scene geometry and \
                 \"coverage\": \"first-hit\", or leave `{name}` out of `require`"
            )));
        }
        let own = scene.triangles(EgoBody::Exclude);
        let required = Arc::new(Required {
            targets: targets.clone(),
            ground: ground_required(scene)?,
            overlap: OverlapRequired { rules: overlap.clone(), own },
            surface: surface_required(scene, &task)?,
            order: require_order.clone(),
        });
        let problem =
            Self::from(task).with_constraints(scene.constraints()).with_rules(scene.rules());
        Ok(Self { body, required, ..problem })
    }
}

/// Mend of an area without a voxel: metres where the area would have one in millimetres.
fn mend_of_area(content: Content, roi: &Roi, area: &Requirement) -> String {
    let metres = |corners: &[[f64; 3]; 2]| corners.map(|corner| corner.map(|at| at / 1000.0));
    let without = area.without.iter().map(metres).collect();
    let scaled = Requirement { inside: metres(&area.inside), without, ..area.clone() };
    let content = content.with_areas(roi, &[scaled]);
    let far = area.inside.as_flattened().iter().copied();
    let far = far.reduce(|far, at| if at.abs() > far.abs() { at } else { far }).unwrap_or_default();
    match content.areas().last().is_some_and(|area| area.voxels > 0) {
        true => check::millimetres(far),
        false => "move it into the roi, or take less of it away with `without`".to_owned(),
    }
}

/// Surface of a scene in the first frame of a task, where a rule on a target stands on it.
///
/// # Errors
/// There is no scene, only level ground.
fn surface_required(scene: &Scene, task: &Task) -> Result<Option<SceneSurface>, ProblemError> {
    let Vehicle { targets, require, require_order, .. } = scene.vehicle();
    let Some(first) = targets.iter().position(|rule| rule.on_scene) else { return Ok(None) };
    let (index, name) = (require.len() + first, &targets[first].name);
    let geometry = task.geometry(0).filter(|_| !scene.is_level_ground).cloned();
    let geometry = geometry.ok_or_else(|| {
        let told = format!(
            ".ground: `{name}` stands on the ground of a scene, and there is none; give the command a scene, or leave \
             `ground` out for level ground"
        );
        ProblemError::Rule(require_order.get(index).copied().unwrap_or(index), told)
    })?;
    let mut is_ground = ground_triangles(scene);
    is_ground.resize(scene.triangles(EgoBody::Include), false);
    Ok(Some(SceneSurface { geometry, frame: task.number_of(0), is_ground }))
}

/// Rules of a scene's vehicle on the ground, and which triangles of its frames are ground.
///
/// # Errors
/// Ground is required, and there is none, or no own body to measure from.
fn ground_required(scene: &Scene) -> Result<GroundRequired, ProblemError> {
    let rules = scene.vehicle().ground.clone();
    let Some(first) = rules.first() else { return Ok(GroundRequired::default()) };
    let without = |lacks| ProblemError::ground_without(&first.name, lacks);
    let is_ground = ground_triangles(scene);
    if scene.triangles(EgoBody::Include) == scene.triangles(EgoBody::Exclude) {
        return Err(without("own body (`ego.body` of the scene, or `body` of the vehicle)"));
    }
    if !is_ground.contains(&true) {
        return Err(without("triangle of a class of ground, as `road`"));
    }
    Ok(GroundRequired { rules, is_ground })
}

/// True for ground, by triangle of a frame; the own body's triangles have no entry.
pub fn ground_triangles(scene: &Scene) -> Vec<bool> {
    let ground_classes = Ground::among(scene.classes());
    let is_ground = |class: u16| ground_classes.get(usize::from(class)) == Some(&true);
    scene.face_classes(EgoBody::Exclude).into_iter().map(is_ground).collect()
}

/// Bytes a triangle while a tree is built: soup, items of the builder, triangle, nodes, blocks.
const TREE_BYTES: u64 = 300;
/// Triangles below which memory is not checked: the check takes longer than building the tree.
const FEW: u64 = 1 << 12;
/// Instances in all frames from which on memory is checked.
const MANY: u64 = 1 << 16;

/// The world of some frames of a scene, with trees for hits up to `far` metres away: each part of the
/// scene one tree, equal parts the same.
///
/// # Errors
/// The trees do not fit into memory.
pub fn world_of(
    scene: &Scene,
    frames: &[usize],
    far: f32,
    body: EgoBody,
) -> Result<World, OutOfMemory> {
    world_of_parts(scene, frames, far, body, |part| scene.part(part))
}

/// World of some frames with other triangles than the scene's: `soup_of` returns those of a part, in its frame.
///
/// # Errors
/// The trees do not fit into memory.
pub fn world_of_parts(
    scene: &Scene,
    frames: &[usize],
    far: f32,
    body: EgoBody,
    soup_of: impl Fn(usize) -> TriangleSoup,
) -> Result<World, OutOfMemory> {
    let parts = scene.parts(body);
    let mut trees = Vec::with_capacity(parts.len());
    let mut built: HashMap<u64, Vec<(TriangleSoup, Arc<Bvh>)>> = HashMap::new();
    for part in parts.clone() {
        let triangles = scene.part_triangles(part) as u64;
        if triangles > FEW {
            memory::check("the trees", TREE_BYTES * triangles)?;
        }
        let soup = soup_of(part);
        let mut hasher = DefaultHasher::new();
        bits(&soup).hash(&mut hasher);
        let alike = built.entry(hasher.finish()).or_default();
        let found = alike.iter().find(|(other, _)| bits(other) == bits(&soup));
        let tree = match found {
            Some((_, tree)) => tree.clone(),
            None => Arc::new(Bvh::build(&soup, far)),
        };
        // The static world is the largest part, and never equal to another.
        if part > 0 && found.is_none() {
            alike.push((soup, tree.clone()));
        }
        trees.push(tree);
    }
    let instances = frames.len() as u64 * parts.len() as u64;
    if instances > MANY {
        // The lists, and the keys that equal ones are found by.
        let each = size_of::<Instance>() as u64 + 14 * size_of::<u64>() as u64;
        memory::check("the poses of actors", instances * each)?;
    }
    let frame = |&t: &usize| Arc::new(standing(&trees, &scene.part_poses(t)));
    Ok(World::new(frames.iter().map(frame).collect()))
}

/// The bodies of the ego vehicle alone in frame 0, with trees for hits up to `far` metres away.
pub fn own_bodies(scene: &Scene, far: f32) -> Frame {
    let tree = |part: usize| Arc::new(Bvh::build(&scene.part(part), far));
    let trees: Vec<Arc<Bvh>> = scene.own_parts().map(tree).collect();
    standing(&trees, &scene.part_poses(0)[scene.own_parts()])
}

/// Trees where they stand, their triangles numbered one after the other.
fn standing(trees: &[Arc<Bvh>], poses: &[Pose]) -> Frame {
    let mut first_prim = 0;
    Frame::new(trees.iter().zip(poses).map(|(tree, &ego_from_instance)| {
        let instance = Instance { tree: tree.clone(), ego_from_instance, first_prim };
        first_prim += tree.triangles.len() as u32;
        instance
    }))
}

/// All that a tree depends on.
fn bits(soup: &TriangleSoup) -> [&[u8]; 2] {
    [bytemuck::cast_slice(&soup.vertices), bytemuck::cast_slice(&soup.faces)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::psog::Roi;

    #[test]
    fn classes_of_more_frames_than_a_count_holds_are_added_up_whole() {
        let roi = Roi::new([0.0; 3], [1.0; 3], [1, 1, 1]).unwrap();
        let classes = ["road", "car", "truck"].map(str::to_owned).to_vec();
        let psog = Psog::new(roi, 100_000, classes, vec![0], vec![0, 40_000, 40_000]).unwrap();
        let content = content_of(&psog, &[1, 2]);
        let want = -(0.8_f64 * 0.8_f64.ln() + 0.2 * 0.2_f64.ln());
        assert_eq!(Entropy::Detection.of(&content.occupied()[0].entropy), fixed(want));
    }

    #[test]
    fn what_is_far_counts_for_less_and_near_ground_by_itself() {
        // Middles at x = 0.5 to 39.5 m, y = 0.
        let roi = Roi::new([0.0, -0.5, 0.0], [1.0; 3], [40, 1, 1]).unwrap();
        let classes = vec!["road".to_owned(), "building".to_owned()];
        // Road in half of the frames at 5.5 m and in all at 7.5 m, a house in half of them at 20.5 m, road in half
        // of them at 39.5 m.
        let counts = vec![1, 0, 2, 0, 0, 1, 1, 0];
        let psog = Psog::new(roi, 2, classes, vec![5, 7, 20, 39], counts).unwrap();
        let content = content_of(&psog, &[]);
        // Eighths: 8, –, round(80 / 20.5) = 4, round(80 / 39.5) = 2; two voxels of near ground.
        let shares = [8.0 / 14.0 + 0.125, 0.125, 4.0 / 14.0, 2.0 / 14.0];
        let total: f64 = shares.iter().sum();
        for (voxel, share) in content.occupied().iter().zip(shares) {
            let got = f64::from(Entropy::Near.of(&voxel.entropy));
            let got = got / Entropy::Near.of(&content.entropy_total()) as f64;
            assert!((got - share / total).abs() < 1e-8, "{}: {got}", voxel.index);
        }
    }
}
