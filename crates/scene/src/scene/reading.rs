//! From the text of a scene file to a scene.

use super::*;

/// Scene of [`Scene::level_ground`].
const LEVEL_GROUND: &str = r#"{
    "sightline": 1,
    "roi": { "min": [-50, -50, -5], "max": [50, 50, 15], "voxel": [1, 1, 1] },
    "static": [{ "class": "road", "plane": { "min": [-300, -300], "max": [300, 300], "z": 0 } }]
}"#;

impl Scene {
    /// Reads a scene file and every sensor and mesh file that it names.
    ///
    /// File names in the scene are relative to the folder of the scene. A P-SOG file is not opened.
    ///
    /// # Errors
    ///
    /// Any [`DescriptionError`]; each names the file, the place in it and a remedy.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, DescriptionError> {
        Self::read_with(path, None)
    }

    /// A copy with the vehicle of another file in place of the scene's own, and of the ego body if the file has one.
    ///
    /// # Errors
    /// See [`Self::read`].
    pub fn read_with(
        path: impl AsRef<Path>,
        vehicle: Option<&Path>,
    ) -> Result<Self, DescriptionError> {
        let path = path.as_ref();
        let bytes = json::read_limited(path, MAX_FILE)?;
        let name = path.display().to_string();
        let text = String::from_utf8(bytes).map_err(|_| DescriptionError::Json {
            at: Box::new(Place::top(&name)),
            problem: "is not UTF-8 text; a scene is a JSON file".to_owned(),
            line: 1,
            column: 1,
        })?;
        let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
        let dir = path.parent().unwrap_or(Path::new(""));
        let mut scene = Self::from_text(text, dir, &name, vehicle)?;
        scene.files.insert(0, path.to_owned());
        Ok(scene)
    }

    /// Level ground of 600 by 600 m around a vehicle of a file.
    ///
    /// # Errors
    /// See [`Self::read`].
    pub fn level_ground(vehicle: &Path) -> Result<Self, DescriptionError> {
        Self::from_text(LEVEL_GROUND, Path::new(""), "level ground", Some(vehicle))
    }

    /// Reads a scene from JSON text.
    ///
    /// File names are relative to `dir`; error messages call the text `name_for_errors`.
    ///
    /// A scene without a name, or with a blank one, is called `name_for_errors` without folder and ending.
    ///
    /// # Errors
    ///
    /// See [`Scene::read`].
    pub fn from_json(
        text: &str,
        dir: &Path,
        name_for_errors: &str,
    ) -> Result<Self, DescriptionError> {
        Self::from_text(text, dir, name_for_errors, None)
    }

    /// Reads the text of a scene, on the vehicle of another file if one is given.
    pub(super) fn from_text(
        text: &str,
        dir: &Path,
        name_for_errors: &str,
        vehicle: Option<&Path>,
    ) -> Result<Self, DescriptionError> {
        json::check_version(text, name_for_errors, FileKind::Scene)?;
        let mut scene: SceneDescription = json::parse(text, name_for_errors)?;
        let top = Place::top(name_for_errors);
        let angles = angles::of_angles(&top, &scene);
        let name = name_of(&top, scene.name.take())?;
        let roi = RoiBounds::new(&top.key("roi"), &scene.roi)?;
        let mut carrier = Carrier::new(&top, &mut scene, dir, vehicle)?;
        roi.check_mount(&top.key("mount"), carrier.vehicle.corners())?;
        let classes = std::mem::take(&mut scene.classes);
        let classes = Classes::new(&top, classes, std::mem::take(&mut scene.detection))?;
        let things = things(&top, &scene, &classes, &mut carrier, dir)?;
        carrier.notes.extend(angles);
        let mut scene = Self::of_parts(&top, scene, (name, roi, classes), carrier, things, dir)?;
        let doubts = scene.doubts(name_for_errors);
        scene.notes.extend(doubts);
        Ok(scene)
    }

    /// Assembles the scene: checks motion, coverage, P-SOG source and reflectances.
    fn of_parts(
        top: &Place,
        scene: SceneDescription,
        (name, roi, classes): (String, RoiBounds, Classes),
        carrier: Carrier,
        things: Things,
        dir: &Path,
    ) -> Result<Self, DescriptionError> {
        let Carrier { vehicle, mut files, notes, .. } = carrier;
        let reflectances = Reflectances::new(top, &classes, &scene.reflectance, &scene.actors)?;
        let has_geometry = things.has_geometry();
        let frames = things.frames(top, scene.frames)?;
        let rate = check::rate(&top.key("rate"), scene.rate.unwrap_or(RATE))?;
        let Things { world, actors, body, ego } = things;
        let ego = ego.unwrap_or(Motion::Still);
        let mut origins = vec![origins::middle_of_way(&top.key("ego"), &ego, frames, &world)?];
        origins.extend(actors.iter().map(|actor| origins::middle(&actor.parts)));
        origins.push(DVec3::ZERO);
        let coverage = scene.coverage.as_deref();
        let coverage = Coverage::new(&top.key("coverage"), coverage, has_geometry)?;
        let psog = scene.psog.as_ref();
        let (range, top_of_mounts) = (vehicle.sensors[0].lidar.range(), vehicle.corners()[1][2]);
        let psog = PsogSource::new(top, psog, has_geometry, dir, range, top_of_mounts)?;
        match &psog {
            PsogSource::File(file) => files.push(file.clone()),
            PsogSource::Scan(_) => classes.check_detection(&classes.names)?,
        }
        Ok(Self {
            name,
            classes,
            roi,
            vehicle,
            sensors: OnceLock::new(),
            coverage,
            psog,
            frames,
            rate,
            world,
            actors,
            body,
            ego,
            origins,
            reflectances,
            files,
            notes,
        })
    }
}

/// World, actors and ego body of a scene; their files and notes are added to the carrier.
fn things(
    top: &Place,
    scene: &SceneDescription,
    classes: &Classes,
    carrier: &mut Carrier,
    dir: &Path,
) -> Result<Things, DescriptionError> {
    let mut builder = Builder::new(top, classes, &scene.shapes, dir);
    builder.check_named()?;
    let mut things =
        Things::new(&mut builder, top, &scene.world, &scene.actors, scene.ego.as_ref())?;
    carrier.files.extend(builder.files());
    if let Some(body) = carrier.body.take() {
        let (solid, more, said) = body.build(classes, &scene.shapes)?;
        things.body = solid;
        carrier.files.extend(more);
        carrier.notes.extend(said);
    }
    carrier.notes.extend(builder.notes());
    Ok(things)
}

/// Stated name, or the file name without its ending.
fn name_of(top: &Place, given: Option<String>) -> Result<String, DescriptionError> {
    let given = given.filter(|name| !name.trim().is_empty());
    let given = given.map(|name| check::name(&top.key("name"), name)).transpose()?;
    let stem = || Path::new(&top.file).file_stem().unwrap_or_default().to_string_lossy();
    Ok(given.unwrap_or_else(|| stem().replace(char::is_control, "-")))
}
