//! Voxels, ground and targets of a scene by the number of LiDARs, and by the technologies, that see them.

use std::sync::Arc;

use serde::Serialize;

use super::counts::{PlacementModels, SeenBy, SeenByTechnologies, Sets, Sums, TargetSeenBy, bits};
use super::technologies::{ConeSite, Technologies, union};
use crate::engine::{Backend, BackendError};
use crate::near_field::{NearSite, place};
use crate::problem::Problem;
use crate::scene::{Scene, Target};
use crate::targets::{CARD_BEAMS, PlacedTarget, TargetQuestion, TargetSite};
use crate::vehicle::{Placement, SensorName};

/// Presets that are looked at where none is named.
pub const REDUNDANCY_TARGETS: [&str; 4] = ["car", "adult", "child", "tyre"];
/// Distances of a target's places, every 5 m up to 50 m.
const DISTANCES: usize = 10;
/// Bearings of a target's places, counter-clockwise from straight ahead.
const BEARINGS: usize = 16;

/// Targets at 5 to 50 m in sixteen bearings; a LiDAR sees one with five beams or more.
pub fn redundancy_question(targets: Vec<Target>) -> TargetQuestion {
    TargetQuestion {
        targets,
        distances: (1..=DISTANCES).map(|k| 5.0 * k as f64).collect(),
        bearings: (0..BEARINGS).map(|k| k as f64 * 360.0 / BEARINGS as f64).collect(),
        beams: CARD_BEAMS,
        of_frames: 1,
    }
}

/// A scene whose voxels, ground and targets are looked at, as far as it is the same for every placement.
pub struct RedundancySite {
    scene: String,
    problem: Arc<Problem>,
    /// Ground near the body, or the sentence that says why there is none.
    near: Result<NearSite, String>,
    /// Vehicle on level ground; `None` with coverage `through`.
    targets: Option<TargetSite>,
    /// Sensors of other technologies; `None` where the vehicle has none.
    cones: Option<ConeSite>,
}

/// Things of a scene by the number of LiDARs of a placement that see them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Redundancy {
    /// Name of the scene.
    pub scene: String,
    /// Name of the placement.
    pub placement: String,
    /// Model of each LiDAR.
    pub lidars: Vec<SensorName>,
    /// Frames averaged over.
    pub frames: usize,
    /// Voxels that are occupied in some frame of the P-SOG.
    pub occupied: SeenBy,
    /// All voxels of the region of interest.
    pub voxels: SeenBy,
    /// Ground cells within 3 m of the own body, as the near field counts them; `None` without ground or body.
    pub ground_3m: Option<SeenBy>,
    /// Ground cells within 10 m of the own body; `None` without ground or body.
    pub ground_10m: Option<SeenBy>,
    /// Reason why there is no ground to look at.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_ground: Option<String>,
    /// Places of each target on level ground; none with coverage `through`.
    pub targets: Vec<TargetSeenBy<SeenBy>>,
    /// Things by the technologies that see them; `None` where the vehicle has LiDARs alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub technologies: Option<Technologies>,
}

/// Things by the number of LiDARs, and by technology where the vehicle has other ones.
struct CountedThings {
    by_lidars: SeenBy,
    by_technologies: Option<SeenByTechnologies>,
}

/// Sums over frames of [`CountedThings`].
#[derive(Default)]
struct SeenSums {
    by_lidars: Sums,
    by_technologies: Sums,
}

/// Targets by the LiDARs that see them, and by technologies.
type TargetsSeen = (Vec<TargetSeenBy<SeenBy>>, Vec<TargetSeenBy<SeenByTechnologies>>);

impl SeenSums {
    fn mean(&self, models: &PlacementModels, cones: Option<&ConeSite>) -> CountedThings {
        CountedThings {
            by_lidars: self.by_lidars.mean(models),
            by_technologies: cones.map(|cones| cones.mean(&self.by_technologies)),
        }
    }
}

impl Redundancy {
    /// Means over several scenes, a row a placement, from rows of `placements` placements in one scene after the other;
    /// empty where there is one scene. Ground counts in the scenes that have any.
    pub fn means(rows: &[Self], placements: usize) -> Vec<Self> {
        let first = rows.iter().take(placements).enumerate();
        let of = |(k, row): (usize, &Self)| {
            let of: Vec<&Self> = rows.iter().skip(k).step_by(placements).collect();
            let mean = |part: &dyn Fn(&Self) -> Option<&SeenBy>| {
                SeenBy::mean(&of.iter().filter_map(|row| part(row)).collect::<Vec<_>>())
            };
            let target = |(k, target): (usize, &TargetSeenBy<SeenBy>)| TargetSeenBy {
                target: target.target.clone(),
                seen: mean(&|row| row.targets.get(k).map(|of| &of.seen))
                    .unwrap_or_else(|| target.seen.clone()),
            };
            Self {
                scene: format!("mean of {} scenes", of.len()),
                frames: of.iter().map(|row| row.frames).sum(),
                occupied: mean(&|row| Some(&row.occupied)).unwrap_or_else(|| row.occupied.clone()),
                voxels: mean(&|row| Some(&row.voxels)).unwrap_or_else(|| row.voxels.clone()),
                ground_3m: mean(&|row| row.ground_3m.as_ref()),
                ground_10m: mean(&|row| row.ground_10m.as_ref()),
                no_ground: None,
                targets: row.targets.iter().enumerate().map(target).collect(),
                technologies: Technologies::mean(
                    &of.iter().filter_map(|row| row.technologies.as_ref()).collect::<Vec<_>>(),
                ),
                ..row.clone()
            }
        };
        let means: Vec<Self> = first.map(of).collect();
        if means.len() < rows.len() { means } else { Vec::new() }
    }
}

impl RedundancySite {
    /// The site of a scene and of the problem that was made of it; `targets` is its vehicle on level ground.
    pub fn new(scene: &Scene, problem: Arc<Problem>, targets: Option<TargetSite>) -> Self {
        let near = match problem.ends_at_hits() {
            true => NearSite::new(scene, &problem).map_err(|error| error.to_string()),
            false => {
                Err(format!("{}: beams end at nothing, so that no ground is seen", place(scene)))
            }
        };
        let cones = ConeSite::new(&scene.vehicle().other_sensors);
        Self { scene: scene.name().to_owned(), problem, near, targets, cones }
    }

    /// Sentences about sensors of other technologies whose view the own body blocks for the most part.
    pub fn notes(&self) -> Vec<String> {
        let cones = self.cones.as_ref().filter(|_| self.problem.ends_at_hits());
        cones.map(|cones| cones.notes(self.problem.body())).unwrap_or_default()
    }

    /// True if the vehicle has sensors of other technologies.
    pub(crate) fn has_cones(&self) -> bool {
        self.cones.is_some()
    }

    /// Reason why there is no ground to look at.
    pub fn no_ground(&self) -> Option<&str> {
        self.near.as_ref().err().map(String::as_str)
    }

    /// Looks at a placement with an engine of the site's problem.
    ///
    /// # Errors
    /// A sensor of a model that the vehicle does not have, or as [`Backend::bitmaps`].
    pub fn look(
        &self,
        engine: &mut dyn Backend,
        question: &TargetQuestion,
        placement: &Placement,
    ) -> Result<Redundancy, BackendError> {
        let sensors = self.problem.sensors();
        let name = |lidar| Ok(sensors.models()[sensors.number(lidar)?].name);
        let names = placement.lidars.iter().map(name).collect::<Result<Vec<_>, BackendError>>()?;
        let models = PlacementModels::new(names.iter().copied());
        let (occupied, voxels) = self.voxels(engine, placement, &models)?;
        let ground = self.ground(engine, placement, &models)?;
        let ([ground_10m, ground_3m], of_ground) = match ground.map(|seen| seen.map(split)) {
            Some([(near, of_near), (ring, of_ring)]) => {
                ([Some(near), Some(ring)], [of_near, of_ring])
            }
            None => ([None, None], [None, None]),
        };
        let (targets, of_targets) = self.targets(question, placement, &models)?;
        let (occupied, of_occupied) = split(occupied);
        let technologies = self.cones.as_ref().zip(of_occupied).map(|(cones, occupied)| {
            let [ground_10m, ground_3m] = of_ground;
            let sensors = cones.sensors(names.len());
            Technologies { sensors, occupied, ground_3m, ground_10m, targets: of_targets }
        });
        Ok(Redundancy {
            scene: self.scene.clone(),
            placement: placement.name.clone(),
            lidars: names,
            frames: self.problem.frame_count(),
            occupied,
            voxels,
            ground_3m,
            ground_10m,
            no_ground: self.no_ground().map(str::to_owned),
            targets,
            technologies,
        })
    }

    /// Occupied voxels, and all by the number of LiDARs.
    fn voxels(
        &self,
        engine: &mut dyn Backend,
        placement: &Placement,
        models: &PlacementModels,
    ) -> Result<(CountedThings, SeenBy), BackendError> {
        let content = self.problem.content().occupied();
        let (count, all) = (content.len() as u64, self.problem.roi().voxel_count());
        let (mut sums, mut of_all) = (SeenSums::default(), Sums::default());
        for (k, (frame, weight)) in self.problem.distinct_frames().into_iter().enumerate() {
            let bitmaps = engine.bitmaps(&placement.lidars, frame)?;
            let order = bitmaps.order;
            let sets = Sets::new(&bitmaps.sensors().collect::<Vec<_>>(), models);
            let occupied = order.bitmap(content.iter().map(|voxel| order.bit_of(voxel.index)));
            sums.by_lidars.add(weight, &sets, count, Some(&occupied));
            of_all.add(weight, &sets, all, None);
            if let Some(cones) = &self.cones {
                let any = union(bitmaps.sensors());
                let is_seen = |index: u32| {
                    let bit = order.bit_of(index) as usize;
                    any[bit / 64] >> (bit % 64) & 1 == 1
                };
                let lidars = bits(content.iter().map(|voxel| is_seen(voxel.index)));
                let sets = cones.sets(lidars, &cones.occupied(&self.problem)[k]);
                sums.by_technologies.add(weight, &sets, count, None);
            }
        }
        Ok((sums.mean(models, self.cones.as_ref()), of_all.mean(models)))
    }

    /// Ground within 10 m and within 3 m of the own body; `None` where there is none.
    fn ground(
        &self,
        engine: &mut dyn Backend,
        placement: &Placement,
        models: &PlacementModels,
    ) -> Result<Option<[CountedThings; 2]>, BackendError> {
        let Ok(near) = &self.near else { return Ok(None) };
        let mut sums = [SeenSums::default(), SeenSums::default()];
        for (k, frame) in near.seen_by_lidar(engine, placement)?.into_iter().enumerate() {
            let seen: Vec<Vec<u64>> =
                frame.seen_by.iter().map(|seen| bits(seen.iter().copied())).collect();
            let seen: Vec<&[u64]> = seen.iter().map(Vec::as_slice).collect();
            let sets = Sets::new(&seen, models);
            let by_technology = self.cones.as_ref().map(|cones| {
                cones.sets(union(seen.iter().copied()), &cones.ground(near, &self.problem)[k])
            });
            for (sums, counts) in sums.iter_mut().zip([&frame.near, &frame.ring]) {
                let all = counts.iter().filter(|counts| **counts).count() as u64;
                let mask = bits(counts.iter().copied());
                sums.by_lidars.add(frame.weight, &sets, all, Some(&mask));
                if let Some(sets) = &by_technology {
                    sums.by_technologies.add(frame.weight, sets, all, Some(&mask));
                }
            }
        }
        Ok(Some(sums.map(|sums| sums.mean(models, self.cones.as_ref()))))
    }

    /// Places of each target that lie beside the own body; none by technology where there are LiDARs alone.
    fn targets(
        &self,
        question: &TargetQuestion,
        placement: &Placement,
        models: &PlacementModels,
    ) -> Result<TargetsSeen, BackendError> {
        let (mut found, mut by_technology) = (Vec::new(), Vec::new());
        let Some(site) = &self.targets else { return Ok((found, by_technology)) };
        let standing = question.on_level();
        let places = question.bearings.len() * question.distances.len();
        for (target, standing) in question.targets.iter().zip(standing.chunks(places.max(1))) {
            let has_room =
                |&&PlacedTarget { target, at }: &&PlacedTarget<'_>| site.has_room(target, at);
            let standing: Vec<_> = standing.iter().filter(has_room).copied().collect();
            let mut seen: Vec<Vec<u64>> = Vec::new();
            for lidar in &placement.lidars {
                let beams = site.beams(lidar, &standing, question.beams)?;
                seen.push(bits(beams.iter().map(|&beams| beams >= question.beams)));
            }
            let seen: Vec<&[u64]> = seen.iter().map(Vec::as_slice).collect();
            let (name, mut sums) = (&target.name, SeenSums::default());
            let count = standing.len() as u64;
            sums.by_lidars.add(1, &Sets::new(&seen, models), count, None);
            if let Some(cones) = &self.cones {
                let sets = cones.sets(
                    union(seen.iter().copied()),
                    &cones.targets(self.problem.body(), &standing),
                );
                sums.by_technologies.add(1, &sets, count, None);
            }
            let (by_lidars, of_technologies) = split(sums.mean(models, self.cones.as_ref()));
            found.push(TargetSeenBy { target: name.clone(), seen: by_lidars });
            by_technology
                .extend(of_technologies.map(|seen| TargetSeenBy { target: name.clone(), seen }));
        }
        Ok((found, by_technology))
    }
}

fn split(seen: CountedThings) -> (SeenBy, Option<SeenByTechnologies>) {
    (seen.by_lidars, seen.by_technologies)
}
