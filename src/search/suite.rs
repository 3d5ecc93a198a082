//! The scenes of a run: problems that share vehicle and rules, and their mirror images.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use super::error::SearchError;
use crate::problem::{Entropy, Modelled, Problem, spread};
use crate::vehicle::{Constraints, Placement};

/// Random draw of a search, counted from the draw that scores have.
pub(super) const SEARCHING: u64 = 1;

/// One scene of a [`Suite`], or its mirror image.
#[derive(Debug, Clone)]
pub struct Member {
    name: String,
    /// Problem of the scene; for a mirror image it has the scene's world and mirrored sensors.
    problem: Arc<Problem>,
    /// Number of the scene; a mirror image has the number of its original.
    scene: usize,
    mirrored: bool,
}

impl Member {
    /// Name of the scene; for a mirror image with `mirrored` behind it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Problem that an engine computes: the scene's own, or with mirrored sensors for a mirror image.
    pub fn problem(&self) -> &Arc<Problem> {
        &self.problem
    }

    /// Number of the scene, from 0; a mirror image has the number of its original.
    pub fn scene(&self) -> usize {
        self.scene
    }

    /// True if the scene is mirrored left to right.
    pub fn is_mirrored(&self) -> bool {
        self.mirrored
    }

    /// Placements as [`Self::problem`] needs them: mirrored for a mirror image. Its scores are then those of the
    /// mirrored placements in the scene itself.
    pub(crate) fn seen<'a>(&self, placements: &'a [Placement]) -> Cow<'a, [Placement]> {
        if self.mirrored {
            placements.iter().map(Placement::mirrored).collect()
        } else {
            Cow::Borrowed(placements)
        }
    }
}

/// Problems that a placement is scored in together: one vehicle in one scene or several.
///
/// Frames are numbered through all members.
#[derive(Debug, Clone)]
pub struct Suite {
    members: Vec<Member>,
}

impl From<Arc<Problem>> for Suite {
    fn from(problem: Arc<Problem>) -> Self {
        let name = "scene".to_owned();
        Self { members: vec![Member { name, problem, scene: 0, mirrored: false }] }
    }
}

impl From<&Arc<Problem>> for Suite {
    fn from(problem: &Arc<Problem>) -> Self {
        problem.clone().into()
    }
}

impl From<Problem> for Suite {
    fn from(problem: Problem) -> Self {
        Arc::new(problem).into()
    }
}

impl Suite {
    /// Several scenes by name; later scenes of an equal name get a number.
    ///
    /// # Errors
    /// No scene; one with another LiDAR or other rules of the mount than the first; of several, one in which
    /// nothing is uncertain, so that a gain is no share of it.
    pub fn new(
        scenes: impl IntoIterator<Item = (String, Arc<Problem>)>,
    ) -> Result<Self, SearchError> {
        let mut members: Vec<Member> = Vec::new();
        for (scene, (wanted, problem)) in scenes.into_iter().enumerate() {
            let taken = |name: &String| members.iter().any(|member| member.name == *name);
            let numbered = (2..).map(|n| format!("{wanted}-{n}"));
            let name = std::iter::once(wanted.clone()).chain(numbered).find(|name| !taken(name));
            let name = name.unwrap_or(wanted);
            members.push(Member { name, problem, scene, mirrored: false });
        }
        let first = members.first().ok_or(SearchError::NoScene)?;
        for Member { name, problem, scene, .. } in &members {
            let (name, scene, first_name) = (name.clone(), *scene, first.name.clone());
            if !problem.sensors().has_models_of(first.problem.sensors()) {
                return Err(SearchError::OtherLidar { scene, name, first: first_name });
            }
            if problem.constraints() != first.problem.constraints() {
                return Err(SearchError::OtherMount { scene, name, first: first_name });
            }
            if members.len() > 1 && Entropy::Classes.of(&problem.content().entropy_total()) == 0 {
                return Err(SearchError::NothingUncertain { scene, name });
            }
        }
        Ok(Self { members })
    }

    /// Copy of the suite in which each scene is followed by its mirror image.
    #[must_use]
    pub fn with_mirror_images(&self) -> Self {
        let both = |member: &Member| {
            let image = Member {
                name: format!("{} mirrored", member.name),
                problem: Arc::new(member.problem.mirrored()),
                scene: member.scene,
                mirrored: !member.mirrored,
            };
            [member.clone(), image]
        };
        Self { members: self.members.iter().flat_map(both).collect() }
    }

    /// Scenes and mirror images, in order.
    pub fn members(&self) -> &[Member] {
        &self.members
    }

    /// True if there is one scene alone, and no mirror image.
    pub(crate) fn is_single(&self) -> bool {
        self.members.len() == 1
    }

    /// Scenes, mirror images not counted.
    pub(crate) fn scene_count(&self) -> usize {
        self.members.iter().map(|member| member.scene + 1).max().unwrap_or(0)
    }

    /// The rules of the mount, which all members share.
    pub fn constraints(&self) -> &Constraints {
        self.members[0].problem.constraints()
    }

    /// The rules of given placements, which all members share.
    pub fn rules(&self) -> &Constraints {
        self.members[0].problem.rules()
    }

    /// Frames of all members together.
    pub fn frame_count(&self) -> usize {
        self.members.iter().map(|member| member.problem.frame_count()).sum()
    }

    /// Size of the model over all scenes; mirror images add frames alone.
    pub fn modelled(&self) -> Modelled {
        let mut all = self.members[0].problem.modelled();
        let mut triangles = all.triangles * all.frames as u64;
        for member in &self.members[1..] {
            let one = member.problem.modelled();
            triangles += one.triangles * one.frames as u64;
            all.frames += one.frames;
            all.distinct_frames += one.distinct_frames;
            if !member.mirrored {
                all.voxels += one.voxels;
                all.occupied_voxels += one.occupied_voxels;
                all.informative_voxels += one.informative_voxels;
                all.voxel_bytes += one.voxel_bytes;
                all.tree_bytes += one.tree_bytes;
                all.bitmap_bytes = all.bitmap_bytes.max(one.bitmap_bytes);
            }
        }
        Modelled { triangles: triangles / all.frames.max(1) as u64, ..all }
    }

    /// Numbers of `wanted` frames of each member, spread evenly; all frames for `None`.
    pub fn spread(&self, wanted: Option<u32>) -> Vec<usize> {
        let ranges = self.frame_ranges().into_iter();
        ranges.flat_map(|r| spread(r.len(), wanted).into_iter().map(move |f| r.start + f)).collect()
    }

    /// Numbers of the frames of each member.
    pub(crate) fn frame_ranges(&self) -> Vec<Range<usize>> {
        let mut start = 0;
        let range = |member: &Member| {
            let frames = start..start + member.problem.frame_count();
            start = frames.end;
            frames
        };
        self.members.iter().map(range).collect()
    }

    /// Copy at another random draw, which sets free phases and which beams return through weather: the own one and `more`.
    pub(super) fn at_draw(&self, more: u64) -> Self {
        self.changed(|problem| {
            let sensors = problem.sensors().with_seed(problem.sensors().seed().wrapping_add(more));
            problem.with_sensors(sensors)
        })
    }

    fn changed(&self, change: impl Fn(Problem) -> Problem) -> Self {
        let member = |member: &Member| {
            let problem = change(Problem::clone(&member.problem));
            Member { problem: Arc::new(problem), ..member.clone() }
        };
        Self { members: self.members.iter().map(member).collect() }
    }

    /// The suite as a search sees it: at another draw than scores where they depend on one, so that a result does not live on
    /// lucky phases or lucky beams.
    pub(super) fn for_search(&self) -> Self {
        if self.is_left_to_chance() { self.at_draw(SEARCHING) } else { self.clone() }
    }

    /// A copy that searches poses of some equipment. Given placements are still judged by the rules that they had.
    #[must_use]
    pub(crate) fn with_equipment(&self, constraints: &Constraints) -> Self {
        self.changed(|problem| problem.with_equipment(constraints.clone()))
    }

    /// A copy without requirements.
    #[must_use]
    pub fn without_requirements(&self) -> Self {
        self.changed(|problem| problem.without_requirements())
    }

    /// Copy over some of the frames; a member without any of them is left out.
    ///
    /// # Panics
    /// A frame that does not exist.
    #[must_use]
    pub fn over(&self, frames: &[usize]) -> Self {
        let some = self.members.iter().zip(self.frame_ranges()).filter_map(|(member, range)| {
            let own = frames.iter().filter(|frame| range.contains(frame));
            let own: Vec<usize> = own.map(|frame| frame - range.start).collect();
            let problem = match own.len() {
                0 => return None,
                all if all == range.len() => member.problem.clone(),
                _ => Arc::new(member.problem.over(&own)),
            };
            Some(Member { problem, ..member.clone() })
        });
        Self { members: some.collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::Bvh;
    use crate::geom::TriangleSoup;
    use crate::problem::{Content, OccupiedVoxel, Task};
    use crate::psog::Roi;
    use crate::vehicle::{BeamTable, SensorPose};

    fn problem(frames: usize, range: f64) -> Arc<Problem> {
        let roi = Roi::new([0.0; 3], [1.0; 3], [4, 4, 4]).unwrap();
        let beam = std::iter::once([1.0, 0.5, 0.0].into());
        let table = BeamTable::from_directions(beam, range).unwrap();
        let tree = Arc::new(Bvh::build(&TriangleSoup::default(), 10.0));
        let occupied = vec![OccupiedVoxel { index: 3, entropy: [7; 4] }];
        let content = Content::new(vec![], occupied, &[], false);
        Arc::new(Task::new(roi, content, table, vec![tree; frames], true).into())
    }

    fn suite(frames: &[usize]) -> Suite {
        Suite::new(frames.iter().map(|&f| ("road".to_owned(), problem(f, 10.0)))).unwrap()
    }

    #[test]
    fn frames_are_numbered_through_and_names_told_apart() {
        let suite = suite(&[3, 2, 4]);
        let names: Vec<&str> = suite.members().iter().map(Member::name).collect();
        assert_eq!(names, ["road", "road-2", "road-3"]);
        assert_eq!((suite.frame_count(), suite.scene_count()), (9, 3));
        assert_eq!(suite.spread(Some(1)), [0, 3, 5]);
        assert_eq!(suite.spread(None), (0..9).collect::<Vec<_>>());
        let some = suite.over(&[0, 2, 5, 6, 7, 8]);
        let left: Vec<_> =
            some.members().iter().map(|m| (m.scene(), m.problem().frame_count())).collect();
        assert_eq!(left, [(0, 2), (2, 4)]);
        assert!(Arc::ptr_eq(some.members()[1].problem(), suite.members()[2].problem()));
    }

    #[test]
    fn a_mirror_image_shares_the_scene_and_sees_mirrored_placements() {
        let both = suite(&[2, 1]).with_mirror_images();
        let told: Vec<_> = both.members().iter().map(|m| (m.name(), m.scene())).collect();
        let want = [("road", 0), ("road mirrored", 0), ("road-2", 1), ("road-2 mirrored", 1)];
        assert_eq!(told, want);
        assert_eq!((both.scene_count(), both.frame_count()), (2, 6));
        let [scene, image, ..] = both.members() else { panic!("four members") };
        let beam = |member: &Member| member.problem().sensors().table(0).directions()[0];
        assert_eq!(beam(scene).map(|v| v.abs()), beam(image).map(|v| v.abs()));
        assert_eq!(beam(scene)[1], -beam(image)[1]);
        let pose = SensorPose::from_values([1.0, 0.5, 2.0, 0.1, 0.0, -0.2]);
        let placements = [Placement { name: "p".into(), lidars: vec![pose] }];
        assert_eq!(scene.seen(&placements)[..], placements);
        let seen = image.seen(&placements)[0].lidars[0];
        assert_eq!((seen.x, seen.y, seen.roll, seen.yaw), (1.0, -0.5, -0.1, 0.2));
    }

    #[test]
    fn scenes_of_other_sensors_or_mounts_are_refused() {
        let named = |problem| ("road".to_owned(), problem);
        let refused = |second: Arc<Problem>| {
            Suite::new([named(problem(1, 10.0)), named(second)]).unwrap_err().to_string()
        };
        let error = refused(problem(1, 12.0));
        assert!(error.contains("`road-2` has another LiDAR than `road`"), "{error}");
        let rules = Constraints::in_box([0.0; 6], [0.0; 6], 7);
        let error = refused(Arc::new((*problem(1, 10.0)).clone().with_constraints(rules)));
        assert!(error.contains("`road-2` has another mount than `road`"), "{error}");
        assert!(Suite::new([]).is_err());
    }
}
