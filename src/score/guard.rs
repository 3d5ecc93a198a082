//! Guards: reasons not to believe a placement's scores.

use std::sync::Arc;

use serde::{Serialize, Serializer};

use super::{lidar_name, percent_up};
use crate::maths;
use crate::near_field::in_frame;
use crate::problem::{Content, Entropy, Tally};
use crate::targets::BlindSector;
use crate::vehicle::{Constraints, Placement, Region, SensorName, SensorPose, Slot};

/// Information below this share of the reference layout's is too little.
const LEAST_INFORMATION: f64 = 0.5;
/// Hit share below this share of the reference layout's is too little.
const LEAST_HITS: f64 = 0.5;
/// A class covered below this share of the reference layout's coverage is neglected.
const LEAST_OF_CLASS: f64 = 0.1;
/// Classes with fewer covered voxels a frame in the reference layout are not judged: their counts are chance.
const COUNTABLE_VOXELS: f64 = 20.0;
/// A placement that loses more than this share of its information to its sensors' range.
const MOST_OUT_OF_RANGE: f64 = 0.01;
/// A LiDAR with which less than this share of the information is lost is redundant.
const LEAST_UNIQUE: f64 = 0.01;

/// Largest share of a LiDAR's beams that may end at the own vehicle; above it the guard `self_hit` is violated.
pub(crate) const MOST_SELF_HITS: f64 = 0.25;

/// Name of a blind sector in files; texts say `BLIND`.
pub(crate) const BLIND_SECTOR: &str = "blind_sector";

/// A reason not to believe a placement's scores, or a fact about a rig. Printed as `name: sentence`, a blind sector as
/// `BLIND: sentence`; files have [`Self::keyed`].
///
/// Scores alone can mislead: literal M-SOG is perfect for sensors that see only voxels that never change.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Guard {
    /// No beam enters a voxel of the region of interest.
    CoversNothing,
    /// Far less information than the reference layout gains.
    LowInformation {
        /// Share of the reference layout's information.
        share: f64,
    },
    /// Far fewer beams hit a surface than those of the reference layout.
    FewHits {
        /// Share of the beams that hit.
        hit_share: f64,
        /// Share of the reference layout's beams that hit.
        reference: f64,
    },
    /// A class that the reference layout sees is hardly covered.
    ClassUnseen {
        /// Name of the class.
        class: String,
        /// Share of the voxels that the reference layout covers.
        share: f64,
    },
    /// Information lies beyond the range of the sensors, or of the visibility.
    ShortSight {
        /// Share of the information that the same poses would gain without a limit of range.
        lost: f64,
    },
    /// A LiDAR that could be left out.
    RedundantLidar {
        /// Index of the LiDAR.
        lidar: usize,
        /// Share of the information that only it gains.
        share: f64,
    },
    /// A LiDAR below the ground; see [`crate::near_field`].
    BelowGround {
        /// Index of the LiDAR.
        lidar: usize,
        /// Its mount, where that has a name.
        mount: Option<String>,
        /// Metres from it up to the ground.
        depth: f64,
    },
    /// A LiDAR that looks at the own vehicle; see [`crate::near_field`].
    SelfHit {
        /// Index of the LiDAR.
        lidar: usize,
        /// Its mount, where that has a name.
        mount: Option<String>,
        /// Share of its beams that end at the own body.
        share: f64,
        /// Number of the frame where bodies move: the first with this share.
        frame: Option<usize>,
    },
    /// A car stands there and hardly a beam meets it; see [`crate::targets`].
    BlindSector(BlindSector),
    /// A guard that is violated in one of several scenes.
    InScene {
        /// Name of the scene.
        scene: String,
        /// Guard that is violated in the scene.
        guard: Box<Guard>,
    },
}

impl Guard {
    /// The LiDAR that could be left out, in some scene; `None` of other guards.
    pub(crate) fn redundant_lidar(&self) -> Option<usize> {
        match self {
            Self::RedundantLidar { lidar, .. } => Some(*lidar),
            Self::InScene { guard, .. } => guard.redundant_lidar(),
            _ => None,
        }
    }

    /// True for a reason not to believe the scores; false for a fact about the rig: a sector that it does not see, a LiDAR that
    /// could be left out.
    pub(crate) fn is_doubt(&self) -> bool {
        match self {
            Self::BlindSector(_) | Self::RedundantLidar { .. } => false,
            Self::InScene { guard, .. } => guard.is_doubt(),
            _ => true,
        }
    }

    /// True for the guards that a scene's own body and ground are looked at for, `self_hit` and `below_ground`.
    pub(crate) fn is_of_body(&self) -> bool {
        matches!(self, Self::BelowGround { .. } | Self::SelfHit { .. })
    }

    /// `name: sentence`, as files and other programs have it: a blind sector has the name `blind_sector`.
    pub fn keyed(&self) -> String {
        match self {
            Self::BlindSector(sector) => format!("{BLIND_SECTOR}: {sector}"),
            Self::InScene { scene, guard } => format!("{} (in {scene})", guard.keyed()),
            other => other.to_string(),
        }
    }
}

/// Words on a LiDAR none of whose beams leaves the own vehicle.
const NONE_LEFT: &str = "; it stands inside the own body, or looks at nothing else";

impl std::fmt::Display for Guard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::CoversNothing => {
                write!(f, "covers_nothing: no beam enters a voxel of the region of interest")
            }
            Self::LowInformation { share } => write!(
                f,
                "low_information: gains {:.1} % of the reference layout's information, less than \
                 {:.0} %",
                (1e3 * share).floor() / 10.0,
                100.0 * LEAST_INFORMATION
            ),
            Self::FewHits { hit_share, reference } => write!(
                f,
                "few_hits: {:.1} % of the beams hit a surface; of the reference layout's, {:.1} % do",
                100.0 * hit_share,
                100.0 * reference
            ),
            Self::ClassUnseen { class, share } => write!(
                f,
                "class_unseen: covers {:.1} % of the {class} voxels that the reference layout \
                 covers",
                100.0 * share
            ),
            Self::ShortSight { lost } => write!(
                f,
                "short_sight: misses {:.1} % of the information because of its range, more than \
                 {:.0} %",
                percent_up(*lost),
                100.0 * MOST_OUT_OF_RANGE
            ),
            Self::RedundantLidar { lidar, share } => write!(
                f,
                "redundant_lidar: without LiDAR {lidar} only {:.2} % of the information is lost, less than \
                 {:.0} %",
                // Rounded down, so that it reads as less.
                (1e4 * share).floor() / 100.0,
                100.0 * LEAST_UNIQUE
            ),
            Self::BelowGround { lidar, mount, depth } => write!(
                f,
                "below_ground: {} is {depth:.2} m below the ground; heights are counted from the ground below \
                 the vehicle",
                lidar_name(*lidar, mount.as_deref())
            ),
            Self::SelfHit { lidar, mount, share, frame } => write!(
                f,
                "self_hit: {} ends {:.1} % of its beams at the own vehicle{}, more than {:.0} %{}",
                lidar_name(*lidar, mount.as_deref()),
                percent_up(*share),
                frame.map_or(String::new(), in_frame),
                100.0 * MOST_SELF_HITS,
                if *share >= 1.0 { NONE_LEFT } else { "" }
            ),
            Self::BlindSector(sector) => write!(f, "BLIND: {sector}"),
            Self::InScene { scene, guard } => write!(f, "{guard} (in {scene})"),
        }
    }
}

impl Serialize for Guard {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.keyed())
    }
}

/// Layout that guards compare with, as anybody would build it without a search.
///
/// One LiDAR sits in the middle of the mount's top; several stand level on the top's edge, evenly
/// around it, the first one front left. `models` are those of the LiDARs.
pub(crate) fn reference_layout(constraints: &Constraints, models: &[SensorName]) -> Placement {
    let nowhere = Arc::new(Region::default());
    let mut groups: Vec<(&Region, Vec<SensorName>)> = Vec::new();
    for (index, &model) in models.iter().enumerate() {
        let before = models[..index].iter().filter(|m| **m == model).count();
        let own: Vec<&Slot> =
            constraints.slots.iter().filter(|slot| slot.sensor == model).collect();
        let slots = if own.is_empty() { constraints.slots.iter().collect() } else { own };
        let region = slots.get(before % slots.len().max(1)).map_or(&nowhere, |slot| &slot.region);
        match groups.iter_mut().find(|(known, _)| **known == **region) {
            Some((_, group)) => group.push(model),
            None => groups.push((region, vec![model])),
        }
    }
    // From there on LiDARs of one model are their own mirror image.
    let from = |count: usize| if constraints.ties.symmetric { 0.5 / count as f64 } else { 0.125 };
    let lidars = groups.iter().flat_map(|(region, group)| around(region, group, from(group.len())));
    let lidars = lidars.collect();
    Placement { name: format!("reference-{}", models.len()), lidars }
}

/// LiDARs on the top edge of a region, evenly around it from a part of a turn on; one alone in the middle.
fn around<'a>(
    region: &'a Region,
    models: &'a [SensorName],
    from: f64,
) -> impl Iterator<Item = SensorPose> + 'a {
    let (lower, upper, lidars) = (&region.lower, &region.upper, models.len());
    let middle = |k: usize| 0.5 * (lower[k] + upper[k]);
    let level = |k: usize| 0.0_f64.clamp(lower[k], upper[k]);
    models.iter().enumerate().map(move |(index, &sensor)| {
        let turn = std::f64::consts::TAU * (index as f64 / lidars as f64 + from);
        // A circle around the corners, pressed onto the edge of the box.
        let on_edge = |k: usize, direction: f64| {
            let half = 0.5 * (upper[k] - lower[k]);
            let offset =
                if lidars == 1 { 0.0 } else { half * std::f64::consts::SQRT_2 * direction };
            (middle(k) + offset).clamp(lower[k], upper[k])
        };
        let (x, y) = (on_edge(0, maths::cos(turn)), on_edge(1, maths::sin(turn)));
        region.pose([x, y, region.plain_height(), level(3), level(4), level(5)], sensor)
    })
}

/// Information of all classes told apart.
fn gained(tally: &Tally) -> u64 {
    Entropy::Classes.of(&tally.entropy)
}

/// The guard that a placement violates when its range hides information: `unlimited` is its tally
/// with beams that reach every voxel.
pub(crate) fn short_sight(tally: &Tally, unlimited: &Tally) -> Option<Guard> {
    let lost = 1.0 - gained(tally) as f64 / gained(unlimited) as f64;
    (gained(unlimited) > 0 && tally.covered > 0 && lost > MOST_OUT_OF_RANGE)
        .then_some(Guard::ShortSight { lost })
}

/// Every guard that a tally over `frames` frames violates.
pub(crate) fn guards_of(
    tally: &Tally,
    content: &Content,
    has_hits: bool,
    frames: usize,
    reference: Option<&Tally>,
) -> Vec<Guard> {
    if tally.covered == 0 {
        return vec![Guard::CoversNothing];
    }
    let mut guards = Vec::new();
    if let Some(reference) = reference {
        // Where the reference has nothing, a ratio is infinite or NaN, and no guard is violated.
        let ratio = |ours: u64, theirs: u64| ours as f64 / theirs as f64;
        let share = ratio(gained(tally), gained(reference));
        guards.extend((share < LEAST_INFORMATION).then_some(Guard::LowInformation { share }));
        let [hit_share, reference_hits] = [tally, reference].map(|of| ratio(of.hits, of.beams));
        let are_few = has_hits && hit_share < LEAST_HITS * reference_hits;
        guards.extend(are_few.then_some(Guard::FewHits { hit_share, reference: reference_hits }));
        for (class, name) in content.classes().iter().enumerate() {
            let theirs = reference.by_class[class];
            let share = ratio(tally.by_class[class], theirs);
            if theirs as f64 / frames as f64 >= COUNTABLE_VOXELS && share < LEAST_OF_CLASS {
                guards.push(Guard::ClassUnseen { class: name.clone(), share });
            }
        }
    }
    if tally.unique.len() > 1 && gained(tally) > 0 {
        let shares = tally.unique.iter().map(|&unique| unique as f64 / gained(tally) as f64);
        let few = shares.enumerate().filter(|(_, share)| *share < LEAST_UNIQUE);
        guards.extend(few.map(|(lidar, share)| Guard::RedundantLidar { lidar, share }));
    }
    guards
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::Violation;

    fn constraints() -> Constraints {
        Constraints {
            min_distance: 0.2,
            ..Constraints::in_box(
                [-0.6, -0.4, 2.2, -0.3, 0.0, 0.0],
                [0.6, 0.4, 2.8, 0.3, 0.0, 0.0],
                4,
            )
        }
    }

    #[test]
    fn the_reference_layout_stands_on_the_corners() {
        let layout = |of: &Constraints, lidars: usize| {
            reference_layout(of, &vec![SensorName::default(); lidars])
        };
        let four = layout(&constraints(), 4);
        let corners = four.lidars.iter().map(|l| (l.x, l.y, l.z));
        let want = [(0.6, 0.4), (-0.6, 0.4), (-0.6, -0.4), (0.6, -0.4)];
        for ((x, y, z), (want_x, want_y)) in corners.zip(want) {
            assert!((x - want_x).abs() < 1e-9 && (y - want_y).abs() < 1e-9, "{x} {y}");
            assert_eq!(z, 2.8);
        }
        let mut tied = constraints();
        tied.ties.symmetric = true;
        for count in 1..=6 {
            let broken = tied.violations(&layout(&tied, count));
            assert!(
                !broken.iter().any(|v| matches!(v, Violation::NotMirrored { .. })),
                "{broken:?}"
            );
        }
        let single = layout(&constraints(), 1);
        assert_eq!((single.lidars[0].x, single.lidars[0].y), (0.0, 0.0));
        for count in 1..=16 {
            let broken = constraints().violations(&layout(&constraints(), count));
            assert!(
                !broken.iter().any(|v| matches!(v, Violation::OutsideMount { .. })),
                "{broken:?}"
            );
        }
    }

    #[test]
    fn a_blind_sector_is_a_word_in_texts_and_a_key_in_files() {
        let sector = BlindSector::lost([165.0, -165.0], [20.0, 25.0]);
        let (guard, words) = (Guard::BlindSector(sector.clone()), sector.to_string());
        assert_eq!(guard.to_string(), format!("BLIND: {words}"));
        assert_eq!(serde_json::json!(guard), format!("blind_sector: {words}"));
        let inner = Guard::InScene { scene: "yard".into(), guard: Box::new(guard) };
        assert_eq!(inner.to_string(), format!("BLIND: {words} (in yard)"));
        assert_eq!(inner.keyed(), format!("blind_sector: {words} (in yard)"));
    }

    #[test]
    fn a_lidar_all_of_whose_beams_end_at_the_body_stands_inside_it() {
        let told = |share| Guard::SelfHit { lidar: 3, mount: None, share, frame: None }.to_string();
        let half = "self_hit: LiDAR 3 ends 50.6 % of its beams at the own vehicle, more than 25 %";
        assert_eq!(told(0.506), half);
        assert_eq!(
            told(1.0),
            "self_hit: LiDAR 3 ends 100.0 % of its beams at the own vehicle, more than 25 %; it stands inside the own body, \
             or looks at nothing else"
        );
    }

    #[test]
    fn each_guard_has_its_trigger() {
        let classes = vec!["car".to_owned(), "pole".to_owned()];
        let content = Content::new(classes, vec![], &[vec![], vec![]], false);
        let good = Tally {
            covered: 1000,
            covered_nonzero: 300,
            entropy: [1000, 0, 0, 0],
            near_repeated: [0; 2],
            by_class: vec![100, 40],
            unique: vec![100, 200],
            hits: 80,
            beams: 100,
        };
        let guards = |tally: &Tally| guards_of(tally, &content, true, 1, Some(&good));
        assert_eq!(guards(&good), []);
        let low = Tally { entropy: [499, 0, 0, 0], ..good.clone() };
        assert_eq!(guards(&low), [Guard::LowInformation { share: 0.499 }]);
        let sky = Tally { hits: 39, ..good.clone() };
        assert_eq!(guards(&sky), [Guard::FewHits { hit_share: 0.39, reference: 0.8 }]);
        let blind = Tally { by_class: vec![9, 40], ..good.clone() };
        assert_eq!(guards(&blind), [Guard::ClassUnseen { class: "car".into(), share: 0.09 }]);
        let stacked = Tally { unique: vec![100, 9], ..good.clone() };
        assert_eq!(guards(&stacked), [Guard::RedundantLidar { lidar: 1, share: 0.009 }]);
        assert_eq!(guards(&Tally::zero(2, 2)), [Guard::CoversNothing]);
        let far = Tally { entropy: [1100, 0, 0, 0], ..good.clone() };
        assert_eq!(short_sight(&good, &good), None);
        let Some(Guard::ShortSight { lost }) = short_sight(&good, &far) else { panic!() };
        assert!((lost - 100.0 / 1100.0).abs() < 1e-12);
        // The redundancy of a single LiDAR means nothing.
        let single = Tally { unique: vec![0], ..good.clone() };
        assert_eq!(guards(&single), []);
    }
}
