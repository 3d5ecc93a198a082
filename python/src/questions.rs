//! Questions about one placement in a scene, each with the answer of the study of that name.

use numpy::{PyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use sightline::job::{MOST_ABOUT, MOST_TILT, RoomSteps, Sweep, SweptField, moves_of};
use sightline::near_field::NearSite;
use sightline::scene::Target;
use sightline::shared::{LEAST_SHARED, Overlap, REDUNDANCY_TARGETS, redundancy_question};
use sightline::targets::{
    GroundBelow, RangeCard, TargetQuestion, TargetRow, TargetTable, is_bearing, is_distance,
};
use sightline::{Note, Placement};

use crate::arguments::{self, room_for};
use crate::arrays::{misshapen, numbers, shaped};
use crate::engine::{Built, counted};
use crate::errors::{bad, raised, warn_of};
use crate::scenes::PyScene;
use crate::wait::{Progress, answer, interruptible};

// Python shows defaults that are literals.
const _: () = assert!(LEAST_SHARED == 500);

/// Values of a sweep that are scored between two looks whether to stop.
const AT_ONCE: usize = 16;
const MOST_VALUES: usize = 10_000;
/// Bytes of a row of a table, with its names and the beams of each LiDAR.
const ROW_BYTES: usize = size_of::<TargetRow>() + 128;

#[pymethods]
impl PyScene {
    /// Range card of one placement, as a `dict`: distances in metres at which five beams or more meet a target.
    ///
    /// Targets are a car, an adult and a tyre, on level ground with the own body in the way, or on the ground of the scene
    /// where that leaves z = 0 by more than 0.2 m (`ground` names it). Sixteen bearings are in
    /// degrees counter-clockwise from straight ahead. The card names the sectors that lose a car between 5 and 50 m,
    /// or up to the longest range of the sensors where that is less (`blind_between`).
    /// `None` with coverage `through`. Raises `ValueError` as `score`, and for several placements.
    #[pyo3(signature = (poses, *, sensors = None, phases = None))]
    fn range_card<'py>(
        &self,
        py: Python<'py>,
        poses: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = arguments::sensors)] sensors: Option<Vec<String>>,
        phases: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (built, placement) = self.one(poses, sensors, phases)?;
        let card = answer(py, None, move |_| {
            let site = built.job.card_site().map_err(raised)?;
            let card = site.map(|site| RangeCard::new(site, &placement.lidars)).transpose();
            card.map_err(|unknown| bad(unknown.to_string()))
        })?;
        self.built.told.warn_once(py, &self.built.job)?;
        Ok(card)
    }

    /// u32 `[targets, bearings, distances, lidars]`: beams of one placement that end at each target, alone on level ground
    /// with the own body in the way. `targets` are presets (`"car"`, `"child"`, …) or target files, `distances` metres from
    /// the ego origin to the middle of the target, `bearings` degrees counter-clockwise from straight ahead. Raises
    /// `ValueError` for an unknown target and with coverage `through`. Distances beyond the range of all LiDARs, and places in
    /// the own body, are warned of.
    #[pyo3(signature = (poses, targets, distances, bearings, *, sensors = None, phases = None))]
    fn beams_on<'py>(
        &self,
        py: Python<'py>,
        poses: &Bound<'py, PyAny>,
        targets: &Bound<'py, PyAny>,
        distances: &Bound<'py, PyAny>,
        bearings: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = arguments::sensors)] sensors: Option<Vec<String>>,
        phases: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArrayDyn<u32>>> {
        let (built, placement) = self.one(poses, sensors, phases)?;
        let question = target_question(targets, distances, bearings)?;
        let site = built.job.target_site().map_err(raised)?;
        let beyond = site.and_then(|site| question.beyond(site.sensors(), &placement.lidars));
        if let Some((range, beyond)) = beyond {
            let beyond: Vec<String> = beyond.iter().map(ToString::to_string).collect();
            let doubt = format!(
                "distances: the LiDARs reach {range} m at most and meet no target at {} m: this lies beyond their range; leave \
                 them out, or take sensors of longer range",
                beyond.join(", ")
            );
            warn_of(py, &[Note::doubt(doubt)])?;
        }
        let shape = [
            question.targets.len(),
            question.bearings.len(),
            question.distances.len(),
            placement.lidars.len(),
        ];
        let table = interruptible(py, move |_| on_level_ground(&built, &question, &placement))??;
        let within: Vec<&TargetRow> = table.rows.iter().filter(|row| row.overlaps).collect();
        if let [first, ..] = within[..] {
            let place = format!("{} at {} m and {}°", first.target, first.distance, first.bearing);
            let note = format!(
                "beams on targets that stand in the own body mean nothing: {} of {} places do, the first is {place}",
                within.len(),
                table.rows.len()
            );
            warn_of(py, &[Note::doubt(note)])?;
        }
        shaped(py, table.rows.into_iter().flat_map(|row| row.by_lidar).collect(), &shape)
    }

    /// How many LiDARs of one placement see voxels, ground near the vehicle and targets, as a `dict`.
    ///
    /// It has the row that `sightline study redundancy` prints: `occupied`, `voxels`, `ground_3m`, `ground_10m` and
    /// `targets`. Each has `all`, and `by` and `share` for none, one, two, three and more LiDARs. `targets` are presets
    /// or target files (default: car, adult, child, tyre). A vehicle with `other_sensors` adds `technologies`: which
    /// technologies see each, and the part that is blind to all. Raises `ValueError` for an unknown target.
    #[pyo3(signature = (poses, *, targets = None, sensors = None, phases = None))]
    fn redundancy<'py>(
        &self,
        py: Python<'py>,
        poses: &Bound<'py, PyAny>,
        targets: Option<&Bound<'py, PyAny>>,
        #[pyo3(from_py_with = arguments::sensors)] sensors: Option<Vec<String>>,
        phases: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (built, placement) = self.one(poses, sensors, phases)?;
        let question = redundancy_targets(targets)?;
        answer(py, None, move |watch| {
            built.psog(watch)?;
            let site = built.job.scenes()[0].redundancy_site().map_err(raised)?;
            built.evaluate(watch, |evaluator| {
                let frames = evaluator.shared_problem().distinct_frames().len();
                // Voxels first, then ground where there is any.
                let casts = frames * (1 + usize::from(site.no_ground().is_none()));
                let look = counted(evaluator.backend_mut(), watch, casts, |engine| {
                    site.look(engine, &question, &placement)
                });
                look.map_err(raised)
            })
        })
    }

    /// Ground near the vehicle that one placement sees, as a `dict` with the row that `sightline study nearfield`
    /// prints.
    ///
    /// - `near_field` and `ring`: shares of the ground within 10 m and 3 m; `blind_area` in m²
    /// - `zone`: depth of the blind zone in metres `ahead`, `behind`, `left` and `right` (`None`: beyond 10 m), and its
    ///   lanes; `lost`: sides on which ground behind the nearest ground seen is unseen again over 2 m or more
    /// - `poles` of standards, and `beams` by LiDAR
    /// - where bodies of the vehicle move: `worst_frame` of both shares, and `worst_frames` of the sides of the zone
    ///
    /// Means over the scored frames. Raises `ValueError` for a scene without geometry or own body.
    #[pyo3(signature = (poses, *, sensors = None, phases = None))]
    fn near_field<'py>(
        &self,
        py: Python<'py>,
        poses: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = arguments::sensors)] sensors: Option<Vec<String>>,
        phases: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (built, placement) = self.one(poses, sensors, phases)?;
        answer(py, None, move |watch| {
            built.evaluate(watch, |evaluator| {
                let problem = evaluator.shared_problem();
                let site = NearSite::new(&built.scene, &problem).map_err(raised)?;
                let frames = problem.distinct_frames().len();
                let look = counted(evaluator.backend_mut(), watch, frames, |engine| {
                    site.look(engine, &placement)
                });
                look.map_err(raised)
            })
        })
    }

    /// Beams of one placement on each target at each place, and distances of detection, as a `dict` with `rows` and
    /// `detections` that `sightline study targets` prints. In the scored frames each target stands alone on the ground of
    /// the scene, all that is there in the way; with `level` on level ground, as for `beams_on`. A target is detected with
    /// `beams` or more in `of_frames` of the frames (all for `None`). Raises `ValueError` as `beams_on`, and for more frames than
    /// are looked at.
    #[pyo3(signature = (poses, targets, distances, bearings, *, beams = 5, of_frames = None, level = false, sensors = None,
        phases = None))]
    fn detections<'py>(
        &self,
        py: Python<'py>,
        poses: &Bound<'py, PyAny>,
        targets: &Bound<'py, PyAny>,
        distances: &Bound<'py, PyAny>,
        bearings: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = arguments::beams)] beams: u32,
        #[pyo3(from_py_with = arguments::of_frames)] of_frames: Option<u32>,
        level: bool,
        #[pyo3(from_py_with = arguments::sensors)] sensors: Option<Vec<String>>,
        phases: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (built, placement) = self.one(poses, sensors, phases)?;
        let frames = if level { 1 } else { self.built.scored_frames().len() };
        let of_frames = of_frames.map_or(frames, |of| of as usize);
        if of_frames > frames {
            return Err(bad(format!(
                "of_frames: is {of_frames}; frames that are looked at: {frames}"
            )));
        }
        let question = target_question(targets, distances, bearings)?;
        let question = TargetQuestion { beams, of_frames, ..question };
        answer(py, None, move |watch| {
            if level {
                return on_level_ground(&built, &question, &placement);
            }
            let site = built.job.target_site().map_err(raised)?.ok_or_else(ends_at_nothing)?;
            let ground = GroundBelow::new(&built.scene);
            built.evaluate(watch, |evaluator| {
                let problem = evaluator.shared_problem();
                let frames = problem.frame_count();
                let found = counted(evaluator.backend_mut(), watch, frames, |engine| {
                    question.in_scene(site, (&problem, &ground), engine, &placement)
                });
                Ok(found.map_err(raised)?.of_scene(built.scene.name()))
            })
        })
    }

    /// One placement with all its LiDARs and with each lost in turn, as a `dict` of `scores` and `losses`.
    ///
    /// A loss has `lidar`, `name`, `scores` of the others, `broken` (requirements that all together meet and the others
    /// do not), `already_missed` (requirements that all together miss, too) and `blind` (sectors that are blind without it alone). Raises `ValueError` as `score`, and for several
    /// placements. `progress` as for `optimize`.
    #[pyo3(signature = (poses, *, sensors = None, phases = None, progress = None))]
    fn losses<'py>(
        &self,
        py: Python<'py>,
        poses: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = arguments::sensors)] sensors: Option<Vec<String>>,
        phases: Option<&Bound<'py, PyAny>>,
        progress: Option<Progress>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (built, placement) = self.one(poses, sensors, phases)?;
        answer(py, progress, move |watch| {
            built.evaluate(watch, |evaluator| {
                let (mut done, looks) = (0, evaluator.looks(1 + placement.lidars.len()));
                let go_on = &mut || {
                    let goes_on = watch.reach("parts of the scores", done.min(looks), looks);
                    done += 1;
                    goes_on
                };
                let losses =
                    built.job.losses_while(evaluator, &placement, go_on).map_err(raised)?;
                watch.reach("parts of the scores", looks, looks);
                Ok(losses)
            })
        })
    }

    /// Surfaces and directions that pairs of LiDARs of one placement share, as a `dict` with the row that
    /// `sightline study overlap` prints.
    ///
    /// - matrices: `shared_voxels` (a mean over frames), `overlap` (as a share of the voxels of the LiDAR with fewer)
    ///   and `shared_directions` (shares of the sphere)
    /// - `overlap_up_to`: the share that a requirement on overlap finds
    /// - `connected`, `connected_up_to`, `groups`, `cut_off`, `chain`
    ///
    /// Pairs of `least_shared` voxels or more count. Raises `ValueError` for
    /// one LiDAR, and with coverage `through`.
    #[pyo3(signature = (poses, *, least_shared = 500, sensors = None, phases = None))]
    fn overlap<'py>(
        &self,
        py: Python<'py>,
        poses: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = arguments::least_shared)] least_shared: u64,
        #[pyo3(from_py_with = arguments::sensors)] sensors: Option<Vec<String>>,
        phases: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (built, placement) = self.one(poses, sensors, phases)?;
        answer(py, None, move |watch| {
            built.psog(watch)?;
            let problem = built.job.problem().map_err(raised)?;
            built.evaluate(watch, |evaluator| {
                let frames = problem.distinct_frames().len();
                let found = counted(evaluator.backend_mut(), watch, frames, |engine| {
                    Overlap::new(&built.scene, &problem, engine, &placement, least_shared)
                });
                found.map_err(raised)
            })
        })
    }

    /// Scores of one placement with one pose field of one LiDAR at each of some values, as a `dict` with the sweep that
    /// `sightline study sweep` prints: `rows` with `value`, `as_given`, `broken_rules` and `scores`, the placement as it is
    /// first. On a symmetric vehicle its mirror image moves, too (`mirrored_lidar`). Field `of` is `"LIDAR.FIELD"` (`"0.pitch"`, `"roof.z"`: a number from 0, a mount or a model); `values` `[N]` are metres, or
    /// degrees of an angle, not radians as all poses are (positive pitch looks down). Raises `ValueError` for an unknown LiDAR or field and for values
    /// that a placement may not have. `progress` as for `optimize`.
    #[pyo3(signature = (poses, of, values, *, sensors = None, phases = None, progress = None))]
    fn sweep<'py>(
        &self,
        py: Python<'py>,
        poses: &Bound<'py, PyAny>,
        of: &str,
        values: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = arguments::sensors)] sensors: Option<Vec<String>>,
        phases: Option<&Bound<'py, PyAny>>,
        progress: Option<Progress>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (built, placement) = self.one(poses, sensors, phases)?;
        let field = SweptField::find(of, &placement, &self.built.scene.rules());
        let field = field.map_err(|error| bad(format!("of: {error}")))?;
        let values = row("values", values, "metres or degrees", f64::is_finite)?;
        if values.is_empty() || values.len() > MOST_VALUES {
            let count = values.len();
            return Err(bad(format!("values: has {count} values; give 1 to {MOST_VALUES}")));
        }
        field.check(&placement, &values).map_err(|error| bad(format!("values: {error}")))?;
        let ends = [f64::min, f64::max].map(|of| values.iter().copied().fold(values[0], of));
        let doubt = field.doubt(ends).map(|doubt| Note::doubt(format!("values: {doubt}")));
        warn_of(py, doubt.as_slice())?;
        answer(py, progress, move |watch| {
            let values = values.into_iter().map(Some);
            let values: Vec<Option<f64>> = std::iter::once(None).chain(values).collect();
            built.evaluate(watch, |evaluator| {
                let mut rows = Vec::new();
                for some in values.chunks(AT_ONCE) {
                    let go_on = &mut || watch.reach("values", rows.len(), values.len());
                    let more = built.job.sweep_rows(evaluator, &placement, field, some, go_on);
                    let Some(more) = more.map_err(raised)? else { break };
                    rows.extend(more);
                }
                watch.reach("values", rows.len(), values.len());
                Ok(Sweep::new(&placement, field, rows))
            })
        })
    }

    /// How far each pose field of each LiDAR of one placement may be off, and how far the body may tilt, until a requirement
    /// of the vehicle breaks.
    ///
    /// The `dict` has the row that `sightline study tolerance` prints. `missed` names requirements that are not met
    /// anyway, and are left out of all else. `fields` have `down` and `up`, each with `holds_to`, `breaks_at` and
    /// `breaks`, in mm or degrees. `tilt` has its `directions`; then there are `copies` and `alone`,
    /// whose `breaks` names the requirement that breaks first beyond `holds_within`.
    ///
    /// Fields move up to `most_mm` millimetres and `most_deg` degrees, in `steps` steps to either side. The whole
    /// vehicle tilts up to `most_tilt_deg` degrees about the point `tilt_about` `(x, y)` of the ground, metres of the ego
    /// frame, or its origin. Raises `ValueError` where the vehicle requires nothing. `progress` as for `optimize`.
    #[pyo3(signature = (
        poses, *, most_mm = 100.0, most_deg = 5.0, most_tilt_deg = 3.0, tilt_about = None, steps = 10,
        sensors = None, phases = None, progress = None
    ))]
    fn tolerance<'py>(
        &self,
        py: Python<'py>,
        poses: &Bound<'py, PyAny>,
        most_mm: f64,
        most_deg: f64,
        most_tilt_deg: f64,
        tilt_about: Option<[f64; 2]>,
        #[pyo3(from_py_with = arguments::steps)] steps: u32,
        #[pyo3(from_py_with = arguments::sensors)] sensors: Option<Vec<String>>,
        phases: Option<&Bound<'py, PyAny>>,
        progress: Option<Progress>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (built, placement) = self.one(poses, sensors, phases)?;
        for (name, value, most) in [
            ("most_mm", most_mm, 10_000.0),
            ("most_deg", most_deg, 180.0),
            ("most_tilt_deg", most_tilt_deg, MOST_TILT),
        ] {
            if !(value > 0.0 && value <= most) {
                return Err(bad(format!(
                    "{name}: is {value}; give a number above 0, up to {most}"
                )));
            }
        }
        let tilt_about = tilt_about.unwrap_or_default();
        if !tilt_about.iter().all(|metres| metres.abs() <= MOST_ABOUT) {
            let found = format!("tilt_about: is {tilt_about:?}");
            return Err(bad(format!("{found}; give x and y in metres within ±{MOST_ABOUT}")));
        }
        let steps = RoomSteps { most_mm, most_deg, most_tilt_deg, tilt_about, steps };
        answer(py, progress, move |watch| {
            let (mut done, moves) = (0, moves_of(&placement) as usize);
            let go_on = &mut |more: u64| {
                done += more as usize;
                watch.reach("moves", done, moves)
            };
            built.evaluate(watch, |evaluator| {
                built.job.room_while(evaluator, &placement, &steps, go_on).map_err(raised)
            })
        })
    }
}

/// Targets by preset or file, at distances in metres and bearings in degrees.
fn target_question(
    targets: &Bound<'_, PyAny>,
    distances: &Bound<'_, PyAny>,
    bearings: &Bound<'_, PyAny>,
) -> PyResult<TargetQuestion> {
    let targets = named(&arguments::targets(targets)?)?;
    let above_0 = "metres above 0 and up to 1000";
    let distances = row("distances", distances, above_0, is_distance)?;
    let bearings = row("bearings", bearings, "degrees from -360 to 360", is_bearing)?;
    let rows = [targets.len(), bearings.len(), distances.len()];
    let rows = rows.into_iter().fold(1, usize::saturating_mul);
    room_for("beams on targets", rows, ROW_BYTES)?;
    Ok(TargetQuestion { targets, distances, bearings, beams: 1, of_frames: 1 })
}

/// Targets by preset or file.
fn named(names: &[String]) -> PyResult<Vec<Target>> {
    let named = |name: &String| Target::named(name).map_err(raised);
    names.iter().map(named).collect()
}

/// Targets whose redundancy is counted; the usual presets for `None`.
fn redundancy_targets(targets: Option<&Bound<'_, PyAny>>) -> PyResult<TargetQuestion> {
    let names = match targets {
        Some(targets) => arguments::targets(targets)?,
        None => REDUNDANCY_TARGETS.map(str::to_owned).to_vec(),
    };
    Ok(redundancy_question(named(&names)?))
}

/// Numbers in a row that `is_allowed`.
fn row(
    what: &str,
    given: &Bound<'_, PyAny>,
    allowed: &str,
    is_allowed: fn(f64) -> bool,
) -> PyResult<Vec<f64>> {
    let wanted = format!("[N] {allowed}");
    let array = numbers::<f64>(what, given, &wanted)?;
    let values: Vec<f64> = array.as_array().iter().copied().collect();
    if array.ndim() != 1 {
        return Err(misshapen(what, array.shape(), wanted));
    }
    match values.iter().position(|value| !is_allowed(*value)) {
        Some(at) => Err(bad(format!("{what}[{at}]: is {}; give {allowed}", values[at]))),
        None => Ok(values),
    }
}

fn ends_at_nothing() -> PyErr {
    bad("beams end at nothing in this scene; give it geometry and a body")
}

/// Beams of a placement on each target at each bearing and distance, on level ground.
fn on_level_ground(
    built: &Built,
    question: &TargetQuestion,
    placement: &Placement,
) -> PyResult<TargetTable> {
    let site = built.job.target_site().map_err(raised)?.ok_or_else(ends_at_nothing)?;
    question.on_level_ground(site, placement).map_err(|unknown| bad(unknown.to_string()))
}
