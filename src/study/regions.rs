//! Information gained by parts of the region, and classes covered.

use super::scene::StudyScene;
use super::table::{Cases, check_distinct, numbers};
use super::{Row, StudyError, Table, TablePlot};
use crate::maths;
use crate::problem::{Content, Entropy};
use crate::psog::{Roi, to_nats};
use crate::score::Objective;
use crate::search::Evaluator;
use crate::vehicle::Placement;

/// Most regions that a chart shows.
const DRAWN: usize = 8;

pub(super) fn regions(scene: &StudyScene, cases: &mut Cases) -> Result<Table, StudyError> {
    let mut regions = Subregion::standard();
    regions.extend(scene.settings.regions.iter().cloned());
    let names = regions.iter().map(|region| region.name.as_str());
    let names: Vec<&str> = names.collect();
    let (own, given) = names.split_at(Subregion::standard().len());
    if let Some(name) = given.iter().find(|name| own.contains(name)) {
        return Err(StudyError::BuiltInRegion { name: (*name).to_owned() });
    }
    check_distinct(names, "regions", "give each --box a name of its own")?;
    let is_given = !scene.settings.placements.is_empty();
    let mut evaluator = if is_given { scene.evaluator()? } else { scene.evaluator_of_rig()? };
    let mut placements: Vec<(String, Option<&Placement>)> =
        scene.layouts.iter().map(|p| (p.name.clone(), Some(p))).collect();
    placements.extend((!is_given).then(|| ("optimized".into(), None)));
    let rows = cases.each(placements, |placement, _| {
        let placement = match placement {
            Some(placement) => Some(placement.clone()),
            None => scene.optimize(&evaluator)?,
        };
        match placement {
            Some(placement) => seen_by(scene, placement, &regions, &mut evaluator),
            None => Ok(scene.none_found()),
        }
    })?;
    let classes = evaluator.problem().content().classes();
    let parts = regions.iter().map(|region| &region.name).chain(classes);
    let columns: Vec<String> =
        std::iter::once("placement".to_owned()).chain(parts.map(|p| format!("{p} %"))).collect();
    let notes = vec![
        "Regions: share of the information that lies there and is gained; near ends at 10 m, middle at \
         25 m; front and rear are 90° wide. Classes: share of the voxels in which the class ever occurs \
         that are covered; empty where the scene has none."
            .to_owned(),
    ];
    let drawing = TablePlot::ByCase {
        columns: (0..regions.len().min(DRAWN)).collect(),
        y_title: "share of the region's information gained, %".into(),
        line: false,
    };
    let title = scene.title("what is seen where, and of what");
    Ok(Table::new(title, columns.iter().map(String::as_str), rows, notes, drawing))
}

/// Per cent of each region's information that a placement gains, then of each class's voxels that it
/// covers.
fn seen_by(
    scene: &StudyScene,
    placement: Placement,
    regions: &[Subregion],
    evaluator: &mut Evaluator,
) -> Result<Row, StudyError> {
    let problem = evaluator.shared_problem();
    let frames = 0..problem.frame_count();
    let covered: Vec<Vec<u64>> = frames
        .map(|frame| evaluator.backend_mut().covered(&placement, frame))
        .collect::<Result<_, _>>()?;
    let content = problem.content();
    let percent = |part: f64, whole: f64| (whole > 0.0).then(|| 100.0 * part / whole);
    let gains = gains_by_region(problem.roi(), content, regions, &covered);
    let mut values: Vec<Option<f64>> =
        gains.iter().map(|gain| percent(gain.gained, gain.total)).collect();
    let scores = scene.score(evaluator, &placement)?;
    for (class, (_, seen)) in scores.covered_by_class.iter().enumerate() {
        values.push(percent(*seen, content.voxels_of_class(class).len() as f64));
    }
    Ok(Row::scored(values, placement, &scores))
}

/// Information of one region: the whole, and the part that was gained.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct RegionGain {
    /// Σ H over the region's voxels, in nats.
    total: f64,
    /// Σ c(v) H over them, in nats; c(v) is the share of frames in which v is covered.
    gained: f64,
}

/// Gains by region; `covered` holds the rising voxel indices of each frame.
fn gains_by_region(
    roi: &Roi,
    content: &Content,
    regions: &[Subregion],
    covered: &[Vec<u64>],
) -> Vec<RegionGain> {
    let mut gains = vec![RegionGain::default(); regions.len()];
    let (min, edge) = (roi.min(), roi.voxel());
    for voxel in content.occupied() {
        let index = u64::from(voxel.index);
        let coords = roi.coords(index);
        let centre = [0, 1, 2].map(|k| min[k] + (f64::from(coords[k]) + 0.5) * edge[k]);
        let frames = covered.iter().filter(|frame| frame.binary_search(&index).is_ok()).count();
        let share = frames as f64 / covered.len() as f64;
        let worth = to_nats(u64::from(Entropy::Classes.of(&voxel.entropy)));
        for (gain, region) in gains.iter_mut().zip(regions) {
            if region.holds(centre) {
                gain.total += worth;
                gain.gained += share * worth;
            }
        }
    }
    gains
}

/// A part of the region of interest, by the centres of its voxels in the ego frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Subregion {
    /// Name of its column.
    pub name: String,
    extent: Extent,
}

#[derive(Debug, Clone, PartialEq)]
enum Extent {
    /// Horizontal distance from the ego origin, in metres: from, up to.
    Ring(f64, f64),
    /// Angle between forward (0) and rear (π), on either side: from, up to.
    Sector(f64, f64),
    /// Lower and upper corner, in metres.
    Box([f64; 3], [f64; 3]),
}

/// Distances in metres that part near, middle and far.
const RINGS: [f64; 2] = [10.0, 25.0];
/// Angles from forward that part front, side and rear.
const SECTORS: [f64; 2] = [std::f64::consts::FRAC_PI_4, 3.0 * std::f64::consts::FRAC_PI_4];

impl Subregion {
    /// Near, middle and far; front, side and rear.
    pub(super) fn standard() -> Vec<Self> {
        let [near, far] = RINGS;
        let [front, rear] = SECTORS;
        let ring =
            |name: &str, from, to| Self { name: name.into(), extent: Extent::Ring(from, to) };
        let sector =
            |name: &str, from, to| Self { name: name.into(), extent: Extent::Sector(from, to) };
        vec![
            ring("near", 0.0, near),
            ring("middle", near, far),
            ring("far", far, f64::INFINITY),
            sector("front", 0.0, front),
            sector("side", front, rear),
            sector("rear", rear, f64::INFINITY),
        ]
    }

    /// A box from its corners, in metres.
    pub fn of_box(name: &str, min: [f64; 3], max: [f64; 3]) -> Self {
        Self { name: name.to_owned(), extent: Extent::Box(min, max) }
    }

    /// True if a point of the ego frame lies in the region; lower ends belong to it, upper ends do not.
    pub(super) fn holds(&self, point: [f64; 3]) -> bool {
        let [x, y, _] = point;
        match &self.extent {
            Extent::Ring(from, to) => (*from..*to).contains(&maths::hypot(x, y)),
            Extent::Sector(from, to) => (*from..*to).contains(&maths::atan2(y.abs(), x)),
            Extent::Box(min, max) => (0..3).all(|k| (min[k]..max[k]).contains(&point[k])),
        }
    }
}

/// Weights of detection; segmentation has the rest up to 1.
const WEIGHTS: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];

pub(super) fn tasks(scene: &StudyScene, cases: &mut Cases) -> Result<Table, StudyError> {
    if !scene.job.problem()?.content().has_detection() {
        return Err(StudyError::OneTask { scene: scene.place() });
    }
    let mut evaluator = scene.evaluator_of_rig()?;
    let weights = WEIGHTS.map(|weight| (format!("{weight:.2}"), weight)).to_vec();
    let rows = cases.each(weights, |weight, _| {
        let share = "information_gain_share";
        let text = format!("{}*{share} + {weight}*detection.{share}", 1.0 - weight);
        let objective: Objective = text.parse()?;
        let best = scene.optimize_from(&evaluator, &objective, &scene.rig()?.starts)?;
        let Some(best) = best else { return Ok(scene.none_found()) };
        let scores = scene.score(&mut evaluator, &best)?;
        let percent = |share: Option<f64>| share.map(|v| 100.0 * v);
        let values = vec![
            percent(scores.segmentation.information_gain_share),
            percent(scores.detection.and_then(|d| d.information_gain_share)),
        ];
        Ok(Row::scored(values, best, &scores))
    })?;
    let points: Vec<(f64, f64)> = numbers(&rows, 0).into_iter().zip(numbers(&rows, 1)).collect();
    let front: Vec<&str> = rows
        .iter()
        .zip(front(&points))
        .filter(|(_, on_front)| *on_front)
        .map(|(row, _)| row.name.as_str())
        .collect();
    let notes = vec![format!(
        "Not beaten in both tasks (Pareto front): weight {}. Others were cut short by the {} evaluations \
         of each search.",
        front.join(", "),
        scene.settings.evaluations
    )];
    let drawing = TablePlot::Against {
        column: 1,
        x_title: "segmentation: share of the information gained, %".into(),
        y_title: "detection: share of the information gained, %".into(),
    };
    let title = scene.title("one placement for two tasks");
    let columns = ["weight of detection", "segmentation gain %", "detection gain %"];
    Ok(Table::new(title, columns, rows, notes, drawing))
}

/// True for each point on the front: no other is as good in both numbers and better in one. A point without numbers
/// is not on the front.
fn front(points: &[(f64, f64)]) -> Vec<bool> {
    let beaten = |a: &(f64, f64)| points.iter().any(|b| b.0 >= a.0 && b.1 >= a.1 && b != a);
    points.iter().map(|point| !point.0.is_nan() && !beaten(point)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::OccupiedVoxel;
    use crate::psog::fixed;

    #[test]
    fn regions_part_the_plane() {
        let regions = Subregion::standard();
        let of = |x: f64, y: f64| -> Vec<&str> {
            let held = regions.iter().filter(|r| r.holds([x, y, 1.0]));
            held.map(|r| r.name.as_str()).collect()
        };
        assert_eq!(of(5.0, 1.0), ["near", "front"]);
        assert_eq!(of(0.0, -10.0), ["middle", "side"]);
        assert_eq!(of(-30.0, 4.0), ["far", "rear"]);
        assert_eq!(of(-3.0, 0.0), ["near", "rear"], "straight back too");
        let kerb = Subregion::of_box("kerb", [0.0, -4.0, 0.0], [10.0, -3.0, 0.3]);
        assert!(kerb.holds([0.0, -3.5, 0.1]) && !kerb.holds([10.0, -3.5, 0.1]));
    }

    #[test]
    fn gains_are_means_over_frames() {
        let roi = Roi::new([0.0, -1.0, 0.0], [10.0, 2.0, 1.0], [3, 1, 1]).unwrap();
        let voxel = |index| OccupiedVoxel { index, entropy: [fixed(1.0); 4] };
        let content =
            Content::new(vec!["a".into()], vec![voxel(0), voxel(2)], &[vec![0, 2]], false);
        let covered = [vec![0, 1, 2], vec![0]];
        let gains = gains_by_region(&roi, &content, &Subregion::standard()[..3], &covered);
        let gain = |total, gained| RegionGain { total, gained };
        assert_eq!(gains, [gain(1.0, 1.0), gain(0.0, 0.0), gain(1.0, 0.5)]);
    }

    #[test]
    fn the_front_by_hand() {
        let points =
            [(3.0, 1.0), (2.0, 2.0), (2.0, 1.0), (1.0, 3.0), (2.0, 2.0), (f64::NAN, f64::NAN)];
        assert_eq!(front(&points), [true, true, false, true, true, false]);
    }
}
