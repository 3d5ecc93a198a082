//! Scores, counts and guards from integer tallies.
//!
//! Larger is better for all scores. Sums over covered voxels are means over frames: with c(v) the
//! share of frames in which voxel v is covered, N = Σ c(v) and every Σ is weighted by c(v). H is the
//! entropy of a voxel's class over the frames, in nats.

pub(crate) mod guard;
mod objective;
pub(crate) mod over_scenes;
mod requirement;
pub(crate) mod standing;
mod worst_frame;

use serde::{Serialize, Serializer};

use crate::near_field::BlindDepths;
use crate::problem::{Content, Entropy, Tally};
use crate::targets::{CAR_WEIGHT, RangeCard};
use objective::Tasks;

pub use guard::Guard;
pub(crate) use guard::{BLIND_SECTOR, MOST_SELF_HITS, guards_of, reference_layout, short_sight};
pub(crate) use objective::{NEAR_GAIN, NEAR_GAINS};
pub use objective::{Objective, ObjectiveError};
pub use over_scenes::Interval;
pub(crate) use over_scenes::{bootstrap, totals};
pub use requirement::{Between, Lost, RulePlaces, Seen};
pub(crate) use requirement::{
    HOLDS, SEEN, SHARED, all_held_in_words, lidar_name, metres_up, percent_down, percent_up,
};
pub use standing::Needed;
pub(crate) use standing::{Standing, kendall_tau, mean_height, spearman};
pub use worst_frame::WorstFrame;

/// Scores of one task, segmentation or detection, which tell classes apart differently.
///
/// `None` where nothing is covered.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct TaskScores {
    /// −(1/N) Σ H: literal eq. 5 of Place3D; closer to 0 is better.
    pub m_sog: Option<f64>,
    /// −(1/N²) Σ H: the reading of eq. 5 that fits the printed scale.
    pub m_sog_scaled: Option<f64>,
    /// Like `m_sog` with N the covered voxels that are occupied in some frame (eq. 3).
    pub m_sog_nonzero: Option<f64>,
    /// Like `m_sog_scaled` with N the covered voxels that are occupied in some frame.
    pub m_sog_scaled_nonzero: Option<f64>,
    /// Σ H over covered voxels, in nats.
    pub information_gain: Option<f64>,
    /// The information gain as a share of Σ H over all voxels; `None` also where that is zero.
    pub information_gain_share: Option<f64>,
}

/// Scores, counts and guards of one placement.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Scores {
    /// Name of the placement.
    pub name: String,
    /// Segmentation: every class for itself.
    #[serde(flatten)]
    pub segmentation: TaskScores,
    /// −Σ H over covered voxels with H that of "occupied or not" (S-MIG, Hu et al. 2022).
    pub s_mig: Option<f64>,
    /// Near gain: the covered share of the weights w(v) of all voxels, from 0 to 1. `None` where nothing is covered or
    /// known.
    ///
    /// A voxel weighs H(v) · 10 m / max(10 m, d(v)), the factor in eighths, with d its distance in plan from the origin
    /// of the ego frame. Voxels of ground within 10 m share a quarter of that sum in addition, in equal parts. Near
    /// things matter sooner, and ground near the vehicle has hardly any entropy. Chosen because its optima see more
    /// near ground, not for what learners recognize: `docs/evidence.md`.
    pub near_gain: Option<f64>,
    /// Near gain where each voxel counts by the number c of LiDARs that cover it, up to two: Σ w·min(c, 2) / (2·Σ w) with
    /// the weights w of [`Self::near_gain`]. From 0 to 1, half the near gain where no voxel is covered twice.
    pub near_gain_2: Option<f64>,
    /// Like [`Self::near_gain_2`] up to three: Σ w·min(c, 3) / (3·Σ w).
    pub near_gain_3: Option<f64>,
    /// Share of the ground within 10 m of the own body with a hit close by, as
    /// [`crate::near_field::NearField::near_field`]; `None` where it was not looked for: it takes casts of its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub near_field: Option<f64>,
    /// Share of the ground within 3 m of the own body with a hit close by; `None` where it was not looked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub near_ring: Option<f64>,
    /// Σ H over covered voxels, in nats; the information gain by its other name.
    pub entropy_sum: Option<f64>,
    /// Covered voxels, a mean over frames.
    #[serde(serialize_with = "whole_if_whole")]
    pub covered: f64,
    /// Covered voxels that are occupied in at least one frame of the P-SOG.
    #[serde(serialize_with = "whole_if_whole")]
    pub covered_nonzero: f64,
    /// Covered voxels in which a class occurs in at least one frame of the P-SOG, by class.
    #[serde(serialize_with = "map_of_counts")]
    pub covered_by_class: Vec<(String, f64)>,
    /// Beams cast a frame.
    pub beams: u64,
    /// Share of the beams that hit a surface; `None` with coverage `through`.
    pub hit_share: Option<f64>,
    /// Detection: the target classes against all others; `None` where no class is a target.
    pub detection: Option<TaskScores>,
    /// Share of the information that only this LiDAR gains, by LiDAR.
    pub unique_share: Vec<f64>,
    /// Requirements on areas, then on targets, each with the share that is seen.
    #[serde(rename = "requirements", skip_serializing_if = "Vec::is_empty")]
    pub required: Vec<Seen>,
    /// Share of copies within the mounting tolerance that still meet all requirements; `None` where not looked at.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub requirements_hold_in: Option<f64>,
    /// Most millimetres and degrees by which these copies are off; `None` where not looked at.
    #[serde(skip)]
    pub copies_off: Option<[f64; 2]>,
    /// Distances of detection by target and bearing; `None` where not computed, or with coverage `through`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_card: Option<RangeCard>,
    /// Depth of the blind zone on each side, over up to four frames, twelve where bodies of the vehicle move; `None` where not
    /// computed, with coverage `through`, and without own body or ground.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub blind_zone: Option<BlindDepths>,
    /// Missing share of beams on cars all round at 5 to 50 m, where five beams on a car are enough. `None` where a
    /// search does not look. See [`crate::targets::Sight`].
    #[serde(skip)]
    pub car_missing: Option<f64>,
    /// Violated guards: doubts about the scores, and blind sectors; empty if there are none.
    pub guards: Vec<Guard>,
    /// Rules of the vehicle or of the mount that a given placement breaks, in words; empty where it keeps all, or where
    /// nobody looked.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub broken_rules: Vec<String>,
}

/// A count without a decimal point where it is whole.
fn whole_if_whole<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    if value.fract() == 0.0 {
        serializer.serialize_u64(*value as u64)
    } else {
        serializer.serialize_f64(*value)
    }
}

fn map_of_counts<S: Serializer>(
    counts: &[(String, f64)],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct Count(#[serde(serialize_with = "whole_if_whole")] f64);
    serializer.collect_map(counts.iter().map(|(name, count)| (name, Count(*count))))
}

/// Shares of the areas of a content.
fn required(tally: &Tally, content: &Content, frames: usize) -> Vec<Seen> {
    let counts = tally.by_class.iter().skip(content.classes().len());
    let seen = content.areas().iter().zip(counts).map(|(area, &count)| Seen {
        name: area.required.name.clone(),
        share: count as f64 / (frames as u64 * area.voxels).max(1) as f64,
        done: SEEN,
        least: area.required.share,
        ..Seen::default()
    });
    seen.collect()
}

impl Scores {
    /// Scores of tasks alone.
    fn of_tasks(tasks: Tasks) -> Self {
        let Tasks { segmentation, detection, s_mig, near_gain, near_gain_2, near_gain_3 } = tasks;
        Self {
            segmentation,
            detection,
            s_mig,
            near_gain,
            near_gain_2,
            near_gain_3,
            entropy_sum: segmentation.information_gain,
            ..Self::default()
        }
    }

    /// Scores from a placement's tally over `frames` frames.
    ///
    /// `reference` is the tally of the reference layout with as many LiDARs, which the guards compare
    /// with; `None` leaves out the guards that need it. `has_hits` tells whether beams end at hits.
    pub fn new(
        name: &str,
        tally: &Tally,
        content: &Content,
        frames: usize,
        has_hits: bool,
        reference: Option<&Tally>,
    ) -> Self {
        let mean = |sum: u64| sum as f64 / frames as f64;
        let gained = Entropy::Classes.of(&tally.entropy);
        let unique = |&own: &u64| if gained == 0 { 0.0 } else { own as f64 / gained as f64 };
        let by_class =
            content.classes().iter().cloned().zip(tally.by_class.iter().copied().map(mean));
        Self {
            name: name.to_owned(),
            covered: mean(tally.covered),
            covered_nonzero: mean(tally.covered_nonzero),
            covered_by_class: by_class.collect(),
            beams: tally.beams / frames as u64,
            hit_share: has_hits.then(|| tally.hits as f64 / tally.beams as f64),
            unique_share: tally.unique.iter().map(unique).collect(),
            required: required(tally, content, frames),
            guards: guards_of(tally, content, has_hits, frames, reference),
            ..Self::of_tasks(Tasks::new(tally, content, frames))
        }
    }

    /// Penalty of a search for a car that is not seen all round; 0 where it does not look.
    pub(crate) fn blindness(&self) -> f64 {
        CAR_WEIGHT * self.car_missing.unwrap_or(0.0)
    }

    /// Sentence on the share of copies within the mounting tolerance that meet all of several requirements. `None` for
    /// a single requirement, where one is not met anyway, or where no copies were looked at.
    pub(crate) fn holds_in_words(&self) -> Option<String> {
        let is_met = self.required.len() > 1 && self.required.iter().all(Seen::is_met);
        self.requirements_hold_in.filter(|_| is_met).map(all_held_in_words)
    }

    /// Share of copies within the mounting tolerance that meet all requirements, where the placement does and fewer than
    /// [`HOLDS`] of its copies do; `None` elsewhere.
    pub(crate) fn holds_on_paper(&self) -> Option<f64> {
        let [met, of] = self.met();
        self.requirements_hold_in.filter(|&share| met == of && share < HOLDS)
    }

    /// Met requirements on targets that are missed at places closer together, in words; `None` without one.
    pub(crate) fn missed_between(&self) -> Option<String> {
        let missed = self.required.iter().filter(|seen| seen.is_missed_between());
        let titles: Vec<String> = missed.map(Seen::title).collect();
        (!titles.is_empty()).then(|| {
            format!("at places closer together too little is seen ({})", titles.join(", "))
        })
    }

    /// Number of requirements that are met, and of all.
    pub(crate) fn met(&self) -> [usize; 2] {
        [self.required.iter().filter(|seen| seen.is_met()).count(), self.required.len()]
    }

    /// Number of guards that are reasons not to believe the scores.
    pub fn doubts(&self) -> usize {
        self.guards.iter().filter(|guard| guard.is_doubt()).count()
    }

    /// Missing share of the requirements, summed.
    pub fn missing(&self) -> f64 {
        self.required.iter().map(|seen| (seen.least - seen.share).max(0.0)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::OccupiedVoxel;
    use crate::psog::fixed;

    /// Two voxels worth ln 2 and one worth nothing, seen in classes a, a and b.
    fn content() -> Content {
        let worth = |h: f64| [fixed(h), fixed(h), fixed(h / 2.0), u32::from(h > 0.0)];
        let ln2 = std::f64::consts::LN_2;
        let occupied = [(3, ln2), (5, ln2), (9, 0.0)];
        let occupied =
            occupied.map(|(index, h)| OccupiedVoxel { index, entropy: worth(h) }).to_vec();
        Content::new(vec!["a".into(), "b".into()], occupied, &[vec![3, 5], vec![9]], false)
    }

    #[test]
    fn scores_worked_out_by_hand() {
        // Frame 1 covers 10 voxels, one of them worth ln 2; frame 2 covers 6, two worth ln 2 each.
        let ln2 = std::f64::consts::LN_2;
        let content = content();
        let one = u64::from(fixed(ln2));
        let half = u64::from(fixed(ln2 / 2.0));
        let tally = Tally {
            covered: 16,
            covered_nonzero: 4,
            entropy: [3 * one, 0, 3 * half, 5],
            near_repeated: [2, 1],
            by_class: vec![3, 1],
            unique: vec![one, 0],
            hits: 30,
            beams: 80,
        };
        let scores = Scores::new("x", &tally, &content, 2, true, None);
        let close = |got: Option<f64>, want: f64| {
            let got = got.expect("a score");
            assert!((got - want).abs() < 1e-8 * want.abs(), "{got} is not {want}");
        };
        // N = 8, Σ H = 1.5 ln 2, of 2 ln 2 in all.
        close(scores.segmentation.information_gain, 1.5 * ln2);
        close(scores.segmentation.information_gain_share, 0.75);
        close(scores.segmentation.m_sog, -1.5 * ln2 / 8.0);
        close(scores.segmentation.m_sog_scaled, -1.5 * ln2 / 64.0);
        close(scores.segmentation.m_sog_nonzero, -1.5 * ln2 / 2.0);
        close(scores.s_mig, -0.75 * ln2);
        // 5 units in two frames, of 2 there are.
        close(scores.near_gain, 1.25);
        close(scores.near_gain_2, 7.0 / 8.0);
        close(scores.near_gain_3, 8.0 / 12.0);
        assert_eq!((scores.covered, scores.covered_nonzero), (8.0, 2.0));
        assert_eq!(scores.covered_by_class, [("a".into(), 1.5), ("b".into(), 0.5)]);
        assert_eq!((scores.beams, scores.hit_share), (40, Some(0.375)));
        close(Some(scores.unique_share[0]), 1.0 / 3.0);
        assert!(scores.detection.is_none());
        let json = serde_json::to_value(&scores).unwrap();
        assert_eq!(json["covered"], 8);
        assert_eq!(json["covered_by_class"]["a"], 1.5);
        assert!(json["m_sog"].is_f64());
    }

    #[test]
    fn a_requirement_without_any_one_lidar_has_the_intact_rig_beside_it() {
        let lost = Some(Lost { intact: 0.4305, worst: Some(2), ..Lost::default() });
        let mut seen =
            Seen { share: 0.188, lost, ..Seen::of("ground to 3 m, any one LiDAR lost", 0.0) };
        let words = "NOT MET: ground to 3 m, any one LiDAR lost: 18.8 % seen with the worst LiDAR lost (43.0 % with all), \
                     90.0 % required; worst without LiDAR 2";
        assert_eq!(seen.to_string(), words);
        for (share, told) in [
            (0.188, " lost in frame 3 (43.0 % with all), "),
            (0.09, " lost (43.0 % with all; 9.0 % in frame 3), "),
        ] {
            let worst_frame = Some(WorstFrame { frame: 3, share });
            let seen = Seen { worst_frame, ..seen.clone() };
            assert!(seen.to_string().contains(told), "{seen}");
        }
        // A name that does not say so is followed by it.
        seen.name = "ring".into();
        assert_eq!(seen.to_string(), words.replace("ground to 3 m", "ring"));
        seen.name = "ring, one lost".into();
        assert_eq!(seen.title(), seen.name, "a name that says so in other words");
        seen.name = "ring".into();
        let json = serde_json::to_value(&seen).unwrap();
        assert_eq!(
            (json["intact"].as_f64(), json["worst_without"].as_u64()),
            (Some(0.4305), Some(2))
        );
        assert!(serde_json::to_value(Seen::of("ring", 1.0)).unwrap().get("intact").is_none());
    }

    #[test]
    fn a_share_below_what_is_required_never_reads_as_met() {
        let read = |share, least| (percent_down(share), percent_up(least));
        assert_eq!(read(0.900_3, 0.900_4), (90.0, 90.1));
        assert_eq!(read(0.07, 0.07), (7.0, 7.0));
        assert_eq!(read(0.95, 0.95), (95.0, 95.0));
    }

    #[test]
    fn covering_nothing_is_null_and_guarded() {
        let scores = Scores::new("x", &Tally::zero(2, 1), &content(), 1, false, None);
        let json = serde_json::to_value(&scores).unwrap();
        for key in ["m_sog", "m_sog_scaled", "information_gain", "s_mig", "entropy_sum"] {
            assert!(json[key].is_null(), "{key} is {}", json[key]);
        }
        assert_eq!(json["covered"], 0);
        let guard = json["guards"][0].as_str().unwrap();
        assert!(guard.starts_with("covers_nothing: "), "{guard}");
    }
}
