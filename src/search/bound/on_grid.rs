//! Both bounds of a run: before its result is known, and beside it in numbers and words.

use serde::{Deserialize, Serialize};

use super::branch_and_bound::{Effort, GainBound, bound_gain};
use super::required::BoundRequirements;
use super::sample::{GridSample, LipschitzBound};
use crate::json::{counted, spoken};
use crate::search::atlases::Atlases;
use crate::search::climb::{Check, Moves};
use crate::search::error::SearchError;
use crate::search::evaluator::Evaluator;
use crate::search::grid_search::{GridPlacement, GridSearch};
use crate::search::observer::{Event, Watch, Work};
use crate::search::settings::{Settings, coarse_grid};
use crate::search::swaps::{MISSING, SWAP_SPACING};
use crate::vehicle::{Constraints, PoseGrid, PoseGridError};

/// Least spacing of the bound's grid where none is given, as a multiple of that of the swaps; every pose of it is cast.
const COARSE: u32 = 2;
/// Pairs of placements sampled for the constants of the paper's bound and for the findings.
const SAMPLES: usize = 24;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(in crate::search) struct Bounds {
    pub sample: GridSample,
    /// The bound on the gain, or why there is none.
    pub gain: Result<GainBound, String>,
}

/// Bounds the gain over all placements on a grid and samples that grid, within about `memory` bytes; where there
/// is no bound, the grid of the swaps is sampled.
pub(in crate::search) fn bounds(
    evaluator: &mut Evaluator,
    settings: &Settings,
    memory: u64,
    watch: &mut Watch,
) -> Result<Bounds, SearchError> {
    let mut search = match gain_search(evaluator, settings, memory, watch)? {
        Ok(search) => search,
        Err(why) => {
            let (grid, _) = settings.grid(evaluator.constraints())?;
            let mut search = grid_search(evaluator, settings, &grid, memory);
            let sample = sample(&mut search, evaluator, settings, watch)?;
            return Ok(Bounds { sample, gain: Err(why) });
        }
    };
    let gain = gain(&mut search, evaluator, settings, memory, watch)?;
    let sample = sample(&mut search, evaluator, settings, watch)?;
    Ok(Bounds { sample, gain })
}

fn sample(
    search: &mut GridSearch,
    evaluator: &mut Evaluator,
    settings: &Settings,
    watch: &Watch,
) -> Result<GridSample, SearchError> {
    GridSample::draw(search, evaluator, SAMPLES, settings.seed, &|| !watch.is_over())
}

/// A search whose atlas has room for every pose of the bound's grid, or why there is no bound.
fn gain_search(
    evaluator: &Evaluator,
    settings: &Settings,
    memory: u64,
    watch: &Watch,
) -> Result<Result<GridSearch, String>, SearchError> {
    let objective = &settings.objective;
    if !objective.is_information_gain() {
        return Ok(Err(format!(
            "no bound is known for `{objective}`: only the information gain is submodular in the set of \
             sensors"
        )));
    }
    if watch.is_over() {
        return Ok(Err(ended_before(watch)));
    }
    let mut search =
        grid_search(evaluator, settings, &grid(evaluator.constraints(), settings)?, memory);
    let (poses, atlas) = (search.atlas().grid().len() as usize, search.atlas());
    if poses > atlas.capacity() {
        return Ok(Err(format!(
            "no bound was computed: the {poses} sensor poses of the grid take {} MiB, more than half of \
             --memory; widen --delta",
            (poses * atlas.page_bytes()) >> 20
        )));
    }
    search.constraints = search.constraints.untied();
    Ok(Ok(search))
}

/// Why there is no bound where the run ends before it.
fn ended_before(watch: &Watch) -> String {
    let why = if watch.interrupted { "the run was interrupted" } else { "the time was over" };
    format!("no bound was computed: {why} before")
}

/// Words on the placements of a bound: other sensors and other counts are none of them.
const OF_THESE: &str = ", with these sensors on their mounts,";

fn grid_search(
    evaluator: &Evaluator,
    settings: &Settings,
    grid: &PoseGrid,
    memory: u64,
) -> GridSearch {
    let objective = &settings.objective;
    let atlas = Atlases::new(evaluator, grid, objective.needed(), memory);
    GridSearch::new(atlas, objective.clone(), evaluator)
}

fn gain(
    search: &mut GridSearch,
    evaluator: &mut Evaluator,
    settings: &Settings,
    memory: u64,
    watch: &mut Watch,
) -> Result<Result<GainBound, String>, SearchError> {
    let poses = search.atlas().grid().len();
    watch.note(&format!("bounding the gain over {poses} sensor poses"));
    let all: Vec<u32> = (0..poses).collect();
    let effort = Effort::of(settings.evaluations, settings.gap, memory);
    // Overlaps of pairs have no first pose to count.
    let mut go_on = |[done, total]: [u64; 2]| match total {
        1 => watch.goes_on(),
        _ => watch.tell(&Event::Progress { work: Work::Bounds, done, total }),
    };
    if search.hold_while(evaluator, &all, &mut |_| go_on([0, 1]))?.len() < all.len() {
        return Ok(Err(ended_before(watch)));
    }
    let required = BoundRequirements::of(search.atlas());
    if let Some(why) = required.and_then(|required| required.out_of_reach(&search.places())) {
        let frames = counted(evaluator.frame_count(), "frame");
        return Ok(Err(format!(
            "no placement on the grid of {poses} sensor poses{OF_THESE} meets the requirements over {frames}: {why}"
        )));
    }
    let Some(greedy) = search.greedy(evaluator, &all)? else {
        return Ok(Err(format!("no placement on the grid{OF_THESE} keeps the distance asked for")));
    };
    let anywhere = Moves::Anywhere;
    let ask = &mut |_| go_on([0, 1]);
    let Some(top) = search.ascend(evaluator, &greedy.poses, anywhere, Check::Nothing, ask)? else {
        return Ok(Err(ended_before(watch)));
    };
    if !top.value.is_finite() {
        return Ok(Err(format!(
            "no bound was computed: no placement on the grid{OF_THESE} has a value"
        )));
    }
    let top = meeting(search, evaluator, top, &mut |_| go_on([0, 1]))?;
    Ok(Ok(bound_gain(search, evaluator, &top, &effort, &mut go_on)?))
}

/// The end of a climb from a placement that puts requirements first, if it meets them; else the placement.
fn meeting(
    search: &mut GridSearch,
    evaluator: &mut Evaluator,
    top: GridPlacement,
    go_on: &mut dyn FnMut(u64) -> bool,
) -> Result<GridPlacement, SearchError> {
    let meets = |search: &GridSearch, poses: &[u32]| {
        BoundRequirements::of(search.atlas()).is_none_or(|required| required.meets(poses))
    };
    if meets(search, &top.poses) {
        return Ok(top);
    }
    search.require(MISSING * top.value.abs());
    let end = search.ascend(evaluator, &top.poses, Moves::Anywhere, Check::Nothing, go_on)?;
    search.require(0.0);
    let Some(end) = end.filter(|end| meets(search, &end.poses)) else { return Ok(top) };
    let value = search.value(evaluator, &end.poses)?;
    Ok(GridPlacement { value, ..end })
}

/// The grid of the bound on the gain: as given, or a coarse one of no more poses than the swaps cast.
fn grid(constraints: &Constraints, settings: &Settings) -> Result<PoseGrid, PoseGridError> {
    if let Some(spacing) = settings.delta {
        return PoseGrid::new(constraints, spacing);
    }
    let most = settings.poses_for_swaps(constraints.lidars());
    Ok(coarse_grid(constraints, SWAP_SPACING, COARSE, most)?.0)
}

/// Bounds on how much better than the result another placement could be.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Certificate {
    /// The paper's bound; `None` where nothing could be sampled.
    pub lipschitz: Option<LipschitzBound>,
    /// `lipschitz` in words.
    pub lipschitz_says: String,
    /// The bound on the grid; `None` for objectives that have none, or where it was not computed.
    pub gain: Option<GainBound>,
    /// `gain` in words, or why there is no bound.
    pub gain_says: String,
}

impl Certificate {
    /// Puts both bounds into words. `found` is the objective of the result; `gain` is the bound, or
    /// why there is none.
    pub(crate) fn new(
        lipschitz: Option<LipschitzBound>,
        gain: Result<GainBound, String>,
        found: f64,
    ) -> Self {
        let lipschitz_says = match &lipschitz {
            None => "nothing could be sampled on the grid".to_owned(),
            Some(LipschitzBound { c_m, k_g, delta, bound, samples }) => format!(
                "C_M + k_G·δ = {} + {} · {} = {}, from {samples} sampled \
                 placements: as large as the whole range of their scores, so it tells nothing about \
                 this result",
                spoken(*c_m),
                spoken(*k_g),
                spoken(*delta),
                spoken(*bound)
            ),
        };
        let (gain, gain_says) = match gain {
            Err(why) => (None, why),
            Ok(gain) => {
                let more = 100.0 * (gain.upper / found - 1.0);
                let short = gain.short.as_ref().map_or_else(String::new, |why| {
                    format!("; the gap asked for was not reached: {why}")
                });
                let that = gain.heeds.as_ref().map(|heeds| format!(" that meets {heeds}"));
                let (that, poses) = (that.unwrap_or_default(), gain.poses);
                let says = if gain.upper <= found {
                    format!(
                        "no placement{that} on the grid of {poses} sensor poses{OF_THESE} is better than the \
                         result"
                    )
                } else if found <= 0.0 {
                    format!(
                        "the best placement{that} on the grid of {poses} sensor poses{OF_THESE} gains {} at \
                         most, the result nothing",
                        spoken(gain.upper)
                    )
                } else if gain.proven {
                    format!(
                        "the best placement{that} on the grid of {poses} sensor poses{OF_THESE} is {more:.2} % \
                         better than the result (proven)"
                    )
                } else {
                    format!(
                        "the best placement{that} on the grid of {poses} sensor poses{OF_THESE} is at most \
                         {more:.2} % better than the result{short}"
                    )
                };
                (Some(gain), says)
            }
        };
        Self { lipschitz, lipschitz_says, gain, gain_says }
    }
}

#[cfg(test)]
pub(in crate::search) mod tests {
    use super::*;

    /// A bound on a grid of 784 poses that is not proven.
    pub(crate) fn bound_of(upper: f64, heeds: Option<&str>) -> GainBound {
        GainBound {
            poses: 784,
            best: GridPlacement { poses: vec![1, 2], value: 500.0 },
            upper,
            heeds: heeds.map(str::to_owned),
            upper_at_root: upper,
            nodes: 1,
            proven: false,
            short: None,
        }
    }

    #[test]
    fn an_interruption_is_no_end_of_the_time() {
        let told = |interrupted| ended_before(&Watch::new(&mut |_: &Event| true, interrupted));
        assert_eq!(told(true), "no bound was computed: the run was interrupted before");
        assert_eq!(told(false), "no bound was computed: the time was over before");
    }

    #[test]
    fn words_name_the_requirements_that_are_heeded() {
        let says = |heeds, upper: f64, found: f64| {
            Certificate::new(None, Ok(bound_of(upper, heeds)), found).gain_says
        };
        let grid = "on the grid of 784 sensor poses, with these sensors on their mounts,";
        let most = "is at most 5.00 % better than the result";
        assert_eq!(says(None, 525.0, 500.0), format!("the best placement {grid} {most}"));
        for heeds in ["the requirements", "the requirements but those on overlap"] {
            let those = format!("placement that meets {heeds} {grid}");
            let [more, none, zero] = [[525.0, 500.0], [500.0, 500.0], [525.0, 0.0]];
            assert_eq!(says(Some(heeds), more[0], more[1]), format!("the best {those} {most}"));
            let none = says(Some(heeds), none[0], none[1]);
            assert_eq!(none, format!("no {those} is better than the result"));
            let zero = says(Some(heeds), zero[0], zero[1]);
            assert!(zero.starts_with(&format!("the best {those} gains 525")), "{zero}");
        }
    }
}
