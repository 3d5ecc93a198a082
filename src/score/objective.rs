//! Objective of a search: one score, or a weighted sum of several, by name.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::json::{nearest, spoken};

use super::over_scenes::totals;
use super::{Guard, Scores, TaskScores};
use crate::problem::{Content, Entropy, REPEATS, Tally};
use crate::psog::to_nats;

/// One score by name, of segmentation or of detection.
#[derive(Debug, Clone, Copy)]
struct Metric {
    name: &'static str,
    detection: bool,
    of: Getter,
}

/// Reads a value from the scores of all tasks and of one task.
type Getter = fn(&Tasks, &TaskScores) -> Option<f64>;

/// Near gains by the number of LiDARs that a voxel counts for at most.
pub(crate) const NEAR_GAINS: [&str; 1 + REPEATS] = ["near_gain", "near_gain_2", "near_gain_3"];
pub(crate) const NEAR_GAIN: &str = NEAR_GAINS[0];

/// Every score that a search may maximize; all are "larger is better".
const METRICS: [(&str, Getter); 10] = [
    (NEAR_GAIN, |tasks, _| tasks.near_gain),
    (NEAR_GAINS[1], |tasks, _| tasks.near_gain_2),
    (NEAR_GAINS[2], |tasks, _| tasks.near_gain_3),
    ("information_gain", |_, task| task.information_gain),
    ("m_sog_scaled", |_, task| task.m_sog_scaled),
    ("m_sog", |_, task| task.m_sog),
    ("m_sog_scaled_nonzero", |_, task| task.m_sog_scaled_nonzero),
    ("m_sog_nonzero", |_, task| task.m_sog_nonzero),
    ("information_gain_share", |_, task| task.information_gain_share),
    ("s_mig", |tasks, _| tasks.s_mig),
];

impl Metric {
    /// True for a gain in which a voxel counts again for a second LiDAR that covers it.
    fn is_repeated(&self) -> bool {
        NEAR_GAINS[1..].contains(&self.name)
    }
}

const DETECTION: &str = "detection.";

/// Scores of all classes together: segmentation and detection have no values of their own.
const OF_NO_TASK: [&str; 4] = [NEAR_GAINS[0], NEAR_GAINS[1], NEAR_GAINS[2], "s_mig"];

/// Weighted sum of scores, as `m_sog_scaled` or `0.5*m_sog_scaled + 0.5*detection.m_sog_scaled`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Objective {
    text: String,
    terms: Vec<(f64, Metric)>,
}

/// Why a text is no objective.
#[derive(Debug, thiserror::Error, PartialEq)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the message tells the fields")]
pub enum ObjectiveError {
    /// No score of that name.
    #[error(
        "`{name}` is no score; {}there are {known}; all but {} also with `detection.` before them",
        nearest.as_ref().map(|near| format!("did you mean `{near}`? ")).unwrap_or_default(), OF_NO_TASK.join(", ")
    )]
    UnknownMetric { name: String, nearest: Option<String>, known: String },
    /// A score of all classes together, written with `detection.` before it.
    #[error("`{DETECTION}{name}`: {name} is of all classes together; write `{name}`")]
    OfNoTask { name: &'static str },
    /// Weights that leave nothing to maximize.
    #[error(
        "`{text}`: every weight is 0, so that all placements are worth the same; give a weight above 0"
    )]
    AllZero { text: String },
    /// A factor that is no finite number.
    #[error("`{weight}` is no weight; write a finite number before the `*`, as in `0.5*m_sog`")]
    BadWeight { weight: String },
}

impl Default for Objective {
    /// The near gain: its optima see more of the ground near the vehicle than those of the three other scores that were
    /// searched. For what learners recognize it could not be told apart from the information gain (`docs/evidence.md`).
    /// Like that gain it is monotone in the set of sensors, comparable between any number and kind of them, and comes with
    /// a bound on every other placement.
    fn default() -> Self {
        let (name, of) = METRICS[0];
        let metric = Metric { name, detection: false, of };
        Self { text: name.to_owned(), terms: vec![(1.0, metric)] }
    }
}

impl PartialEq for Objective {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text
    }
}

impl TryFrom<String> for Objective {
    type Error = ObjectiveError;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        text.parse()
    }
}

impl From<Objective> for String {
    fn from(objective: Objective) -> Self {
        objective.text
    }
}

impl FromStr for Objective {
    type Err = ObjectiveError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let terms = text.split('+').map(term).collect::<Result<Vec<_>, _>>()?;
        if terms.iter().all(|(weight, _)| *weight == 0.0) {
            return Err(ObjectiveError::AllZero { text: text.trim().to_owned() });
        }
        Ok(Self { text: text.trim().to_owned(), terms })
    }
}

fn term(text: &str) -> Result<(f64, Metric), ObjectiveError> {
    let (weight, name) = match text.split_once('*') {
        Some((weight, name)) => {
            let weight = weight.trim();
            let parsed = weight.parse().ok().filter(|w: &f64| w.is_finite());
            (parsed.ok_or_else(|| ObjectiveError::BadWeight { weight: weight.into() })?, name)
        }
        None => (1.0, text),
    };
    let name = name.trim();
    let bare = name.strip_prefix(DETECTION).unwrap_or(name);
    let detection = bare.len() < name.len();
    match METRICS.iter().find(|(metric, _)| *metric == bare) {
        Some(&(name, _)) if detection && OF_NO_TASK.contains(&name) => {
            Err(ObjectiveError::OfNoTask { name })
        }
        Some(&(name, of)) => Ok((weight, Metric { name, detection, of })),
        None => Err(ObjectiveError::UnknownMetric {
            name: name.to_owned(),
            nearest: nearest(bare, METRICS.map(|metric| metric.0)),
            known: METRICS.map(|m| m.0).join(", "),
        }),
    }
}

impl std::fmt::Display for Objective {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.text)
    }
}

impl Objective {
    /// The objective's value; `None` where a score it needs does not exist.
    pub fn value(&self, scores: &Scores) -> Option<f64> {
        self.value_of(&Tasks::of(scores))
    }

    /// The value of a placement of which only the sums over covered voxels are known: the same number
    /// as from its scores, without its guards.
    pub fn value_of_tally(&self, tally: &Tally, content: &Content, frames: usize) -> Option<f64> {
        self.value_of(&Tasks::new(tally, content, frames))
    }

    /// Like [`Self::value_of_tally`], over several scenes: of their scores together, see
    /// [`Scores::over_scenes`]. Each scene has the tally over its frames, its content and their number.
    pub(crate) fn value_over_scenes<'a>(
        &self,
        scenes: impl IntoIterator<Item = (Tally, &'a Content, usize)>,
    ) -> Option<f64> {
        let of_scene = |(tally, content, frames): (Tally, &Content, usize)| {
            (Tasks::new(&tally, content, frames), totals(content))
        };
        let tasks: Vec<_> = scenes.into_iter().map(of_scene).collect();
        self.value_of(&Tasks::over_scenes(&tasks))
    }

    fn value_of(&self, tasks: &Tasks) -> Option<f64> {
        self.terms.iter().try_fold(0.0, |sum, (weight, metric)| {
            let task = if metric.detection { tasks.detection? } else { tasks.segmentation };
            Some(sum + weight * (metric.of)(tasks, &task)?)
        })
    }

    /// A weighted sum of objectives.
    pub(crate) fn mixed(parts: &[(f64, &Self)]) -> Self {
        let term = |weight: f64| move |(own, metric): &(f64, Metric)| (weight * own, *metric);
        let terms: Vec<(f64, Metric)> =
            parts.iter().flat_map(|(weight, part)| part.terms.iter().map(term(*weight))).collect();
        let words = |(weight, metric): &(f64, Metric)| {
            let task = if metric.detection { DETECTION } else { "" };
            format!("{weight}*{task}{}", metric.name)
        };
        let text = terms.iter().map(words).collect::<Vec<_>>().join(" + ");
        Self { text, terms }
    }

    /// True if a placement that covers every voxel has a value; if that one has none, no placement has one.
    pub(crate) fn exists_in(&self, content: &Content) -> bool {
        let occupied = content.occupied().len() as u64;
        let all = Tally {
            covered: occupied.max(1),
            covered_nonzero: occupied,
            entropy: content.entropy_total(),
            ..Tally::default()
        };
        self.value_of_tally(&all, content, 1).is_some()
    }

    /// True if the objective is a positive multiple of gains alone, and so monotone and submodular in the set of
    /// sensors.
    ///
    /// A gain is a sum over voxels of a weight times a concave function of the number of LiDARs that cover the voxel.
    /// The function is the same for all voxels.
    pub(crate) fn is_information_gain(&self) -> bool {
        const GAINS: [&str; 3] = ["information_gain", "information_gain_share", NEAR_GAIN];
        let gain = |metric: &Metric| GAINS.contains(&metric.name) || metric.is_repeated();
        self.terms.iter().all(|(weight, metric)| *weight > 0.0 && gain(metric))
    }

    /// True if the weight of a voxel depends on its position.
    pub(crate) fn weighs_place(&self) -> bool {
        self.near_most().is_some()
    }

    /// Lowest level of the near gains that the objective names: 1 for `near_gain`, 2 for `near_gain_2`, 3 for
    /// `near_gain_3`. `None` where it names none.
    pub(crate) fn near_most(&self) -> Option<usize> {
        let most = |metric: &Metric| NEAR_GAINS.iter().position(|name| *name == metric.name);
        self.terms.iter().filter_map(|(_, metric)| most(metric)).min().map(|place| place + 1)
    }

    /// Value that no placement exceeds, where the objective is a sum of shares from 0 to 1; `None` for other scores.
    pub fn most(&self) -> Option<f64> {
        let is_share = |name| NEAR_GAINS.contains(&name) || name == "information_gain_share";
        let most =
            |(weight, metric): &(f64, Metric)| is_share(metric.name).then(|| weight.max(0.0));
        self.terms.iter().map(most).sum()
    }

    /// A value in a sentence: per cent where the objective is a share from 0 to 1, else five significant digits.
    pub(crate) fn spoken(&self, value: f64) -> String {
        if self.is_share() { format!("{:.2} %", 100.0 * value) } else { spoken(value) }
    }

    pub(crate) fn is_share(&self) -> bool {
        self.most() == Some(1.0)
    }

    /// True if voxels count again for a second LiDAR that covers them.
    fn wants_redundancy(&self) -> bool {
        self.terms.iter().any(|(weight, metric)| *weight > 0.0 && metric.is_repeated())
    }

    /// True if a guard is worth telling. An objective that wants voxels covered by several LiDARs, as `near_gain_2`, is
    /// not told of a LiDAR that gains little alone.
    pub(crate) fn tells(&self, guard: &Guard) -> bool {
        !(self.wants_redundancy() && guard.redundant_lidar().is_some())
    }

    pub(crate) fn needs_detection(&self) -> bool {
        self.terms.iter().any(|(_, metric)| metric.detection)
    }
}

/// The scores that an objective is made of.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tasks {
    pub segmentation: TaskScores,
    pub detection: Option<TaskScores>,
    pub s_mig: Option<f64>,
    pub near_gain: Option<f64>,
    pub near_gain_2: Option<f64>,
    pub near_gain_3: Option<f64>,
}

impl Tasks {
    /// From sums over `frames` frames.
    pub(crate) fn new(tally: &Tally, content: &Content, frames: usize) -> Self {
        let mean = |sum: u64| sum as f64 / frames as f64;
        let gain = |kind: Entropy| to_nats(kind.of(&tally.entropy)) / frames as f64;
        let task = |kind: Entropy| {
            let total = to_nats(kind.of(&content.entropy_total()));
            task_scores(gain(kind), total, mean(tally.covered), mean(tally.covered_nonzero))
        };
        let all = Entropy::Near.of(&content.entropy_total());
        let once = Entropy::Near.of(&tally.entropy);
        let [twice, thrice] = tally.near_repeated;
        let exists = tally.covered > 0 && all > 0;
        let share = |sum: u64, times: f64| {
            exists.then(|| sum as f64 / (times * frames as f64 * all as f64))
        };
        Self {
            segmentation: task(Entropy::Classes),
            detection: content.has_detection().then(|| task(Entropy::Detection)),
            s_mig: (tally.covered > 0).then(|| negated(gain(Entropy::Occupancy))),
            near_gain: share(once, 1.0),
            near_gain_2: share(once + twice, 2.0),
            near_gain_3: share(once + twice + thrice, 3.0),
        }
    }

    /// Tasks among the scores of a placement.
    pub(crate) fn of(scores: &Scores) -> Self {
        let Scores { segmentation, detection, s_mig, near_gain, near_gain_2, near_gain_3, .. } =
            *scores;
        Self { segmentation, detection, s_mig, near_gain, near_gain_2, near_gain_3 }
    }
}

/// −`value`, without a minus before zero.
fn negated(value: f64) -> f64 {
    0.0 - value
}

fn task_scores(gain: f64, total: f64, covered: f64, nonzero: f64) -> TaskScores {
    if covered == 0.0 {
        return TaskScores::default();
    }
    let of_nonzero = |value: f64| (nonzero > 0.0).then_some(value);
    TaskScores {
        m_sog: Some(negated(gain / covered)),
        m_sog_scaled: Some(negated(gain / (covered * covered))),
        m_sog_nonzero: of_nonzero(negated(gain / nonzero)),
        m_sog_scaled_nonzero: of_nonzero(negated(gain / (nonzero * nonzero))),
        information_gain: Some(gain),
        information_gain_share: (total > 0.0).then(|| gain / total),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::{Content, KINDS, OccupiedVoxel, Tally};

    #[test]
    fn shares_are_spoken_in_per_cent() {
        for (text, said) in [
            ("near_gain", "57.58 %"),
            ("0.5*near_gain + 0.5*information_gain_share", "57.58 %"),
            ("2*near_gain", "0.57582"),
            ("m_sog", "0.57582"),
        ] {
            assert_eq!(text.parse::<Objective>().unwrap().spoken(0.575_82), said, "{text}");
        }
    }

    #[test]
    fn the_default_is_the_near_gain() {
        let named: Objective = "near_gain".parse().unwrap();
        let json = serde_json::to_string(&Objective::default()).unwrap();
        assert_eq!((Objective::default(), json.as_str()), (named, "\"near_gain\""));
        assert_eq!(serde_json::from_str::<Objective>(&json).unwrap(), Objective::default());
        assert!(Objective::default().is_information_gain());
        assert!(serde_json::from_str::<Objective>("\"gain\"").is_err());
        assert!(!Objective::default().wants_redundancy());
        assert!("near_gain + near_gain_2".parse::<Objective>().unwrap().wants_redundancy());
        let refused = "detection.near_gain".parse::<Objective>().unwrap_err().to_string();
        assert_eq!(
            refused,
            "`detection.near_gain`: near_gain is of all classes together; write `near_gain`"
        );
    }

    #[test]
    fn shares_have_a_largest_value_and_other_scores_have_none() {
        for (text, most) in [
            ("near_gain", Some(1.0)),
            ("near_gain + 0.5*detection.information_gain_share", Some(1.5)),
            ("near_gain + -1*near_gain_2", Some(1.0)),
            ("information_gain", None),
            ("near_gain + m_sog", None),
        ] {
            assert_eq!(text.parse::<Objective>().unwrap().most(), most, "{text}");
        }
    }

    #[test]
    fn a_weighted_sum_of_two_tasks() {
        let content = Content::new(vec!["car".into()], vec![], &[vec![]], true);
        let tally = Tally {
            covered: 10,
            covered_nonzero: 4,
            entropy: [40 << 28, 20 << 28, 0, 0],
            near_repeated: [0; REPEATS],
            by_class: vec![0],
            unique: vec![0],
            hits: 0,
            beams: 100,
        };
        let scores = Scores::new("x", &tally, &content, 1, false, None);
        let value = |text: &str| {
            let objective: Objective = text.parse().unwrap();
            let value = objective.value(&scores).unwrap();
            assert_eq!(objective.value_of_tally(&tally, &content, 1), Some(value));
            value
        };
        assert_eq!(value("m_sog"), -4.0);
        assert_eq!(value("detection.m_sog"), -2.0);
        assert_eq!(value("0.5*m_sog + 2 * detection.m_sog_scaled"), -2.0 - 0.4);
        let [m_sog, both] =
            ["m_sog", "m_sog + 2*detection.m_sog"].map(|text| text.parse::<Objective>().unwrap());
        let mixed = Objective::mixed(&[(0.5, &m_sog), (3.0, &both)]);
        assert_eq!(mixed.to_string(), "0.5*m_sog + 3*m_sog + 6*detection.m_sog");
        assert_eq!(mixed.value(&scores), Some(-2.0 - 12.0 - 12.0));
        assert_eq!(mixed.to_string().parse(), Ok(mixed));
    }

    #[test]
    fn a_share_of_nothing_does_not_exist() {
        let exists = |text: &str, entropy: u32| {
            let occupied = vec![OccupiedVoxel { index: 3, entropy: [entropy; KINDS] }];
            let content = Content::new(vec!["car".into()], occupied, &[vec![3]], true);
            text.parse::<Objective>().unwrap().exists_in(&content)
        };
        for text in ["near_gain", "m_sog + information_gain_share"] {
            assert!(exists(text, 1 << 28) && !exists(text, 0), "{text}");
        }
        assert!(exists("information_gain", 0) && exists("m_sog_scaled_nonzero", 0));
    }

    #[test]
    fn unknown_names_are_answered_with_the_nearest() {
        let all = "all but near_gain, near_gain_2, near_gain_3, s_mig also with `detection.`";
        for (text, words) in [
            ("m_sog_scald", "did you mean `m_sog_scaled`?"),
            ("m_sog_scald", all),
            ("near_gain_4", "near_gain, near_gain_2, near_gain_3, information_gain,"),
            ("detection.near_gain_2", "all classes together; write `near_gain_2`"),
        ] {
            let error = text.parse::<Objective>().unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
        let error = "much*m_sog".parse::<Objective>().unwrap_err();
        assert_eq!(error, ObjectiveError::BadWeight { weight: "much".into() });
    }

    #[test]
    fn zero_has_no_minus() {
        assert!(negated(0.0).is_sign_positive());
    }
}
