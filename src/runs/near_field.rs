//! Near fields of placements in a scene file: the ground and the poles near the vehicle that they see.

use std::io::Write;
use std::path::PathBuf;

use serde::Serialize;

use super::given::{Given, held};
use super::opening::{self, LoadTimes, Loaded};
use super::{Computing, GRACE, RunError, figures};
use crate::files::{Session, writable_file, write_whole};
use crate::job::Job;
use crate::near_field::{Footprint, NearField, NearSite};
use crate::report::near_field::near_field_svg;
use crate::scan::conditions::{Condition, in_words};
use crate::vehicle::{Placement, read_placements};

/// Placements whose near field is looked at.
#[derive(Debug, Clone, Default)]
pub struct NearFieldRequest {
    /// Scene file.
    pub scene: PathBuf,
    /// File of placements; if none the layouts of Table 7, for the paper's car alone.
    pub placements: Option<PathBuf>,
    /// SVG file for blind zones and poles from above.
    pub out: Option<PathBuf>,
    /// Folder for a drawing of each placement.
    pub figures: Option<PathBuf>,
    /// Frames to average over; all if none.
    pub frames: Option<u32>,
    /// Weather and faults. Ground that only lost beams reach counts as unseen.
    pub conditions: Vec<Condition>,
}

/// Near fields in one scene; an interrupted answer holds the first ones.
#[derive(Debug, Serialize)]
pub struct NearFields {
    /// Name of the scene.
    pub scene: String,
    /// Frames averaged over.
    pub frames: usize,
    /// Weather and faults, as they are written.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub conditions: Vec<String>,
    /// Outline of the own vehicle.
    pub footprint: Footprint,
    /// Ground within 10 m in m², mean of the frames.
    pub ground_area: f64,
    /// Near field of each placement, in order.
    pub near_fields: Vec<NearField>,
}

/// Looks at the near field of each placement, and draws it where the request names a file.
///
/// # Errors
/// Files that cannot be read or written, a scene without geometry or own body, a condition given twice.
pub fn near_fields(
    request: &NearFieldRequest,
    computing: &Computing<'_>,
) -> Result<NearFields, RunError> {
    let _session = Session::begin();
    let watcher = computing.watcher;
    let read = request.placements.as_deref().map(read_placements).transpose()?;
    let mend = "static shapes, actors and an ego body";
    let scene = opening::geometry(&request.scene, mend, computing)?;
    opening::note_frames(&scene, request.frames, watcher);
    if let Some(file) = &request.out {
        writable_file(file)?;
    }
    figures::wanted(request.figures.as_deref())?;
    opening::note_conditions(&in_words(&request.conditions), watcher);
    let job = Job::new(scene).geometry_alone().frames(request.frames);
    let job = job.conditions(&request.conditions).engine(computing.engine.clone());
    let mut loaded = Loaded { job, times: LoadTimes::default() };
    let mut evaluator = loaded.evaluator(computing)?;
    let scene = loaded.job.scene();
    let placements = match request.placements.as_deref().zip(read) {
        Some((file, mut read)) => {
            Given::in_problem(file, evaluator.problem(), computing).all(&mut read)?;
            read
        }
        None => held(scene.vehicle(), evaluator.problem().sensors(), computing)?,
    };
    if request.placements.is_none() && placements.is_empty() {
        return Err(RunError::Usage(format!(
            "{}: the vehicle is not the paper's car, whose layouts are looked at by default; give a file of placements \
             behind the scene",
            request.scene.display()
        )));
    }
    let site = NearSite::new(scene, &evaluator.shared_problem())?;
    watcher.listen(GRACE);
    let bar = watcher.bar(placements.len() as u64, Some("placements"));
    let mut all = Vec::new();
    for placement in placements.iter().take_while(|_| watcher.goes_on()) {
        all.push(site.look(evaluator.backend_mut(), placement)?);
        bar.advance(1);
    }
    drop(bar);
    if watcher.goes_on() {
        let drawn: Vec<(&Placement, &NearField)> = placements.iter().zip(&all).collect();
        draw(request, site.footprint(), &drawn)?;
    } else {
        watcher.note_interrupted(request.out.as_deref().or(request.figures.as_deref()));
    }
    Ok(NearFields {
        scene: scene.name().to_owned(),
        frames: evaluator.problem().frame_count(),
        conditions: in_words(&request.conditions),
        footprint: site.footprint().clone(),
        ground_area: site.ground_area(),
        near_fields: all,
    })
}

/// Draws all placements into one file, and each into one of its own, where the request names places.
fn draw(
    request: &NearFieldRequest,
    footprint: &Footprint,
    drawn: &[(&Placement, &NearField)],
) -> Result<(), RunError> {
    // First, since the file may lie in their folder.
    let figure = |one: &(&Placement, &NearField)| {
        (format!("near-field-{}", one.0.name), near_field_svg(footprint, &[*one]))
    };
    figures::write(request.figures.as_deref(), drawn.iter().map(figure).collect())?;
    if let Some(file) = &request.out {
        let svg = near_field_svg(footprint, drawn);
        write_whole(file, |out| out.write_all(svg.as_bytes()).map_err(RunError::io(file)))?;
    }
    Ok(())
}
