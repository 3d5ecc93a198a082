//! Vehicle files: reading and checking them.

use std::collections::HashSet;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use serde::de::{DeserializeOwned, IgnoredAny};

use super::description::{
    KeepOutDescription, ModelDescription, MountingDescription, PhaseDescription,
    RequirementDescription, VehicleDescription,
};
use super::equipment::{Vehicle, VehicleMount, VehicleSensor};
use super::lidar_reading::DescribedLidar;
use super::mesh_mount::mirror_meshes;
use super::mount::{keep_out_boxes, least_distance};
use super::mounting::{check_pairs, face_back, level, mounting};
use super::{
    GroundRule, MAX_LIDARS, OtherSensor, OverlapRule, Requirement, Response, SensorName, SpinPhase,
    TargetRule, Ties, lidar,
};
use crate::scene::RATED_REFLECTANCE;
use lidar_cast::maths;
use sightline_files::Note;
use sightline_files::json::check::{self, bad};
use sightline_files::json::{self, Checked, FileKind, Location};

/// Largest vehicle file, in bytes.
const MAX_FILE: u64 = 64 << 20;
const MOST_PRICE: f64 = 1e12;
/// Most sensor models, mounts and requirements.
const MOST: usize = 64;

/// Reads a vehicle file: its description, and its text's name for errors.
pub(crate) fn read<B: DeserializeOwned, M: DeserializeOwned>(
    path: &Path,
) -> Checked<VehicleDescription<B, M>> {
    let name = path.display().to_string();
    let text = json::read_text(path, MAX_FILE)?;
    json::check_version(&text, &name, FileKind::Vehicle)?;
    json::parse(&text, &name)
}

impl Vehicle {
    /// Reads a vehicle file; its body is left to the scenes that name it.
    pub fn read(path: &Path) -> Checked<Self> {
        let dir = path.parent().unwrap_or(Path::new(""));
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let at = Location::top(&path.display().to_string());
        let mut vehicle = read::<IgnoredAny, IgnoredAny>(path)?;
        vehicle.take_body(&at)?;
        Ok(Self::new(&at, vehicle, &stem, dir)?.0)
    }

    /// Checks a description; `dir` is where its files are. Returns the vehicle and the files it names.
    pub(crate) fn new<B, M>(
        at: &Location,
        vehicle: VehicleDescription<B, M>,
        stem: &str,
        dir: &Path,
    ) -> Checked<(Self, Vec<PathBuf>)> {
        check_count(at, "sensors", vehicle.sensors.len())?;
        check_count(at, "mounts", vehicle.mounts.len())?;
        check_count(at, "require", vehicle.require.len().max(1))?;
        let name = vehicle.name.filter(|name| !name.trim().is_empty());
        let name = name.map(|name| check::name(&at.key("name"), name)).transpose()?;
        let (mut files, mut notes) = (Vec::new(), Vec::new());
        let sensors = models(at, vehicle.sensors, dir, &mut files, &mut notes)?;
        let doubts = vehicle.mounts.iter().enumerate().flat_map(doubts_of_mount);
        notes.extend(doubts.map(|doubt| Note::doubt(format!("{at}: {doubt}"))));
        let (mut mounts, meshes) = mounts(at, vehicle.mounts, &sensors, dir)?;
        files.extend(meshes);
        let min_distance = least_distance(at, vehicle.min_distance)?;
        let keep_out = keep_out_boxes(&at.key("keep_out"), &vehicle.keep_out)?;
        let ties = Ties { equal_height: vehicle.equal_height, symmetric: vehicle.symmetric };
        if ties.equal_height {
            level(at, &mut mounts)?;
        }
        if ties.symmetric {
            mirror_meshes(&mut mounts);
            notes.extend(face_back(at, &mut mounts));
            check_pairs(at, &mounts)?;
        }
        let required = Requirements::new(&at.key("require"), &vehicle.require, dir)?;
        let Requirements { areas, targets, ground, overlap, positions, .. } = required;
        files.extend(required.files);
        notes.extend(required.notes);
        let (rules, positions_of_targets) = (at.key("require"), &positions[1]);
        let reach = out_of_reach(&rules, positions_of_targets, &targets, (&sensors, &mounts))?;
        notes.extend(reach);
        notes.extend(out_of_light(&rules, positions_of_targets, &targets, &sensors));
        let seats = mounts.iter().map(|mount| mount.count[1]).sum();
        notes.extend(needing_more(&rules, &vehicle.require, seats));
        let other_sensors = at.key("other_sensors");
        let other_sensors =
            OtherSensor::read_all(&other_sensors, vehicle.other_sensors, &mut notes)?;
        let name = name.unwrap_or_else(|| stem.to_owned());
        let vehicle = Self {
            name,
            sensors,
            mounts,
            min_distance,
            keep_out,
            ties,
            require: areas,
            targets,
            ground,
            overlap,
            require_order: positions.concat(),
            other_sensors,
            notes,
        };
        vehicle.check_mounts(at)?;
        Ok((vehicle, files))
    }
}

fn check_count(at: &Location, key: &'static str, count: usize) -> Checked<()> {
    if (1..=MOST).contains(&count) {
        return Ok(());
    }
    let wanted = format!("1 to {MOST} entries: a vehicle needs at least one of `{key}`");
    Err(bad(&at.key(key), format!("a list of {count}"), wanted))
}

/// All sensor models, which differ in their names; `files` and `notes` get the names of sensor files and the notes on them.
fn models(
    at: &Location,
    list: Vec<ModelDescription>,
    dir: &Path,
    files: &mut Vec<PathBuf>,
    notes: &mut Vec<Note>,
) -> Checked<Vec<VehicleSensor>> {
    let mut sensors: Vec<VehicleSensor> = Vec::new();
    for (i, model) in list.into_iter().enumerate() {
        let at = at.key("sensors").item(i);
        files.extend(model.lidar.file.iter().map(|file| dir.join(file)));
        let sensor = sensor(&at, model, dir, notes)?;
        if sensors.iter().any(|known| known.name == sensor.name) {
            let wanted = "a name of its own; it is used twice";
            return Err(bad(&at.key("name"), format!("`{}`", sensor.name), wanted));
        }
        sensors.push(sensor);
    }
    for (i, sensor) in sensors.iter().enumerate() {
        let doubts = super::of_lidar(&format!("sensors[{i}]"), &sensor.lidar);
        notes.extend(doubts.iter().map(|doubt| Note::doubt(format!("{at}: {doubt}"))));
    }
    Ok(sensors)
}

/// Doubts about the angles of a mount and of its mesh, and about a mount below the ground.
fn doubts_of_mount((i, mount): (usize, &MountingDescription)) -> Vec<String> {
    let of = |key: &str, angles: &[f64]| super::of_angles(&format!("mounts[{i}].{key}"), angles);
    let own = [("roll", mount.roll), ("pitch", mount.pitch), ("yaw", mount.yaw)];
    let mut doubts: Vec<String> = own.iter().filter_map(|(key, range)| of(key, range)).collect();
    let low = mount.min.iter().chain(mount.polygon.iter().flatten());
    let low = low.map(|corner| corner[2]).fold(0.0, f64::min);
    if low < 0.0 {
        doubts.push(format!(
            "mounts[{i}] reaches down to z = {low}, below the ground; heights are counted from the ground below the \
             vehicle"
        ));
    }
    if let Some(mesh) = &mount.mesh {
        let facing = mesh.facing.as_ref().and_then(|facing| facing.angle);
        let own = [
            ("mesh.roll", mesh.roll),
            ("mesh.pitch", mesh.pitch),
            ("mesh.yaw", mesh.yaw),
            ("mesh.facing.angle", facing.unwrap_or(0.0)),
        ];
        doubts.extend(own.iter().filter_map(|(key, angle)| of(key, &[*angle])));
    }
    doubts
}

/// All mounts, which differ in their names and hold 1 to 16 sensors together, and the files of their meshes.
fn mounts(
    at: &Location,
    list: Vec<MountingDescription>,
    sensors: &[VehicleSensor],
    dir: &Path,
) -> Checked<(Vec<VehicleMount>, Vec<PathBuf>)> {
    let mut names = HashSet::new();
    let (mut mounts, mut files) = (Vec::new(), Vec::new());
    for (i, mount) in list.into_iter().enumerate() {
        let at = at.key("mounts").item(i);
        if !names.insert(mount.name.clone()) {
            let wanted = "a name of its own; it is used twice";
            return Err(bad(&at.key("name"), format!("`{}`", mount.name), wanted));
        }
        let (mount, read) = mounting(&at, mount, sensors, dir)?;
        mounts.push(mount);
        files.extend(read);
    }
    let most: usize = mounts.iter().map(|mount| mount.count[1]).sum();
    let least: usize = mounts.iter().map(|mount| mount.count[0]).sum();
    if most == 0 || least > MAX_LIDARS {
        let wanted = format!("made for 1 to {MAX_LIDARS} sensors in all; change their `count`");
        let found = format!("a list for {least} to {most} sensors");
        return Err(bad(&at.key("mounts"), found, wanted));
    }
    Ok((mounts, files))
}

fn sensor(
    at: &Location,
    model: ModelDescription,
    dir: &Path,
    notes: &mut Vec<Note>,
) -> Checked<VehicleSensor> {
    let refused = |wanted: String| bad(&at.key("name"), format!("{:?}", model.name), wanted);
    if !SensorName::is_name(&model.name) {
        let wanted = format!(
            "the name of a sensor: give 1 to {} printable characters",
            SensorName::MOST_BYTES
        );
        return Err(refused(wanted));
    }
    let name = SensorName::new(&model.name).map_err(|why| refused(format!("usable: {why}")))?;
    let described = DescribedLidar::new(&at.key("lidar"), model.lidar, dir)?;
    let DescribedLidar { lidar, measures, notes: said } = described;
    notes.extend(said);
    let phase = match model.phase {
        None if lidar.turns() => SpinPhase::Free,
        None => SpinPhase::Locked(0.0),
        Some(PhaseDescription::Angle(angle)) => {
            SpinPhase::Locked(check::radians(&at.key("phase"), angle)?)
        }
        Some(PhaseDescription::Range(range)) => phase_between(&at.key("phase"), range)?,
        Some(PhaseDescription::Word(word)) if word == "free" => SpinPhase::Free,
        Some(PhaseDescription::Word(word)) => {
            let wanted = "\"free\", an angle in radians at which the sensor is locked, or a range of such \
                          angles";
            return Err(bad(&at.key("phase"), format!("{word:?}"), wanted));
        }
    };
    let price = model.price.unwrap_or_default();
    if !(0.0..=MOST_PRICE).contains(&price) {
        let wanted = format!("a price from 0 to {MOST_PRICE:e}");
        return Err(bad(&at.key("price"), price, wanted));
    }
    let written = model.response.as_ref();
    let response = lidar::read(&at.key("response"), written, lidar.range(), &measures, notes)?;
    let has_rate = written.and_then(|written| written.rate).or(measures.rate).is_some();
    let has_price = model.price.is_some();
    Ok(VehicleSensor { name, lidar, phase, price, has_price, response, has_rate })
}

/// Angles to choose from, at most a whole turn of them.
fn phase_between(at: &Location, [from, to]: [f64; 2]) -> Checked<SpinPhase> {
    let [from, to] = [check::radians(&at.item(0), from)?, check::radians(&at.item(1), to)?];
    if from == to {
        return Ok(SpinPhase::Locked(from));
    }
    if !(0.0..=TAU + check::ROUNDED).contains(&(to - from)) {
        let meant = if from - to <= TAU { check::swapped([from, to]) } else { String::new() };
        let wanted = format!(
            "a range of angles in radians, the smaller first, at most a turn; one azimuth step is enough{meant}"
        );
        return Err(bad(at, format!("{:?}", [from, to]), wanted));
    }
    Ok(SpinPhase::Between(from, to.min(from + TAU)))
}

/// An area of the vehicle's surroundings that beams must pass.
fn area(at: &Location, required: &RequirementDescription) -> Checked<Requirement> {
    let missing = |key, mend: &str| check::missing(at, key, mend);
    let corner = "give the corners of a box, a `target`, `ground`, a `blind_zone` or `overlap`";
    let min = required.min.ok_or_else(|| missing("min", corner))?;
    let max = required.max.ok_or_else(|| missing("max", corner))?;
    let name = required.name.clone().ok_or_else(|| missing("name", "name the area"))?;
    let name = check::name(&at.key("name"), name)?;
    required.has_only(at, &["min", "max", "without", "share"], |key| match key {
        "depth" => "it is of a `blind_zone`; a box has none",
        "without_any_one" => {
            "it is of a `target`, `ground`, a `blind_zone` or `overlap`; a box has none"
        }
        _ => "it is of a `target`; a box has none",
    })?;
    let inside = check::corners(at, min, max, ": the area would hold nothing")?;
    let without =
        required.without.iter().enumerate().map(|(i, KeepOutDescription { min, max })| {
            let at = at.key("without").item(i);
            check::corners(&at, *min, *max, ": the box would take nothing away")
        });
    let without = without.collect::<Result<Vec<_>, _>>()?;
    Ok(Requirement { name, inside, without, share: required.share(at)? })
}

/// Doubts about targets at distances that no beam of any model reaches; `positions` are theirs in the file.
///
/// # Errors
/// A target of which no place is within reach, from any mount.
fn out_of_reach(
    at: &Location,
    positions: &[usize],
    rules: &[TargetRule],
    (sensors, mounts): (&[VehicleSensor], &[VehicleMount]),
) -> Checked<Vec<Note>> {
    let farthest = sensors.iter().map(|model| model.lidar.range()).fold(0.0, f64::max);
    let corners = mounts.iter().flat_map(|mount| mount.region.corners());
    let from_origin = corners.map(|[x, y, _]| maths::hypot(x, y)).fold(0.0, f64::max);
    // A mount that rides on a body may be anywhere.
    let is_fixed = mounts.iter().all(|mount| mount.region.rides_on.is_none());
    for (position, rule) in positions.iter().zip(rules).filter(|_| is_fixed) {
        let [low, high] = rule.target.corners;
        let half = 0.5 * maths::hypot(high[0] - low[0], high[1] - low[1]);
        // Corners of a box are the smallest and the largest coordinates, which may lie √2 as far out.
        if rule.from - half > farthest + std::f64::consts::SQRT_2 * from_origin {
            let told = format!(
                "{} m is farther than any sensor of the vehicle reaches, {farthest} m, and so is every place of the target; \
                 lower `from` and `within`, or give a sensor of longer range",
                rule.from
            );
            return Err(check::refused(&at.item(*position).key("from"), told));
        }
    }
    let beyond = positions.iter().zip(rules).filter(|(_, rule)| rule.within > farthest);
    let doubt = |(position, rule): (&usize, &TargetRule)| {
        Note::doubt(format!(
            "{}: {} m is farther than any sensor of the vehicle reaches, {farthest} m; lower it, or give a sensor of \
             longer range",
            at.item(*position).key("within"),
            rule.within
        ))
    };
    Ok(beyond.map(doubt).collect())
}

/// Notes on rules that count beams farther out than enough light comes back to a model whose rated range is stated;
/// `positions` are the places of the rules in the file.
fn out_of_light(
    at: &Location,
    positions: &[usize],
    rules: &[TargetRule],
    sensors: &[VehicleSensor],
) -> Vec<Note> {
    let is_stated = |model: &&VehicleSensor| {
        model.response.rated_range != Response::usual(model.lidar.range()).rated_range
    };
    let note = |(position, rule): (&usize, &TargetRule)| {
        let of_rated = (rule.target.reflectance / RATED_REFLECTANCE).sqrt();
        let reach = |model: &VehicleSensor| model.response.rated_range * of_rated;
        let short = sensors.iter().filter(is_stated).filter(|model| reach(model) < rule.within);
        let short = short.map(|model| format!("{} to {:.0} m", model.name, reach(model)));
        let short = short.collect::<Vec<_>>().join(", ");
        (!rule.target.returning_only && !short.is_empty()).then(|| {
            Note::fact(format!(
                "{}: beams on {} count to {} m whether enough light comes back or not; it reflects {} %, which is \
                 seen half of the time by {short} (`rated_range`); `\"response\": true` counts the beams that return",
                at.item(*position),
                rule.target.name,
                rule.within,
                1e2 * rule.target.reflectance
            ))
        })
    };
    positions.iter().zip(rules).filter_map(note).collect()
}

/// Doubts about requirements that take two or three LiDARs, where the mounts hold fewer.
fn needing_more(at: &Location, require: &[RequirementDescription], seats: usize) -> Vec<Note> {
    let doubt = |(position, required): (usize, &RequirementDescription)| {
        let (key, fewest, takes) = match (required.without_any_one, required.overlap) {
            (true, Some(_)) => ("without_any_one", 3, "three"),
            (true, None) => ("without_any_one", 2, "two"),
            (false, Some(_)) => ("overlap", 2, "two"),
            (false, None) => return None,
        };
        let hold = if seats < 2 { "one" } else { "two" };
        let note = format!(
            "{}: takes {takes} LiDARs, and the mounts hold {hold}; raise `count` of a mount, add a mount, or leave it out",
            at.item(position).key(key)
        );
        (seats < fewest).then(|| Note::doubt(note))
    };
    require.iter().enumerate().filter_map(doubt).collect()
}

/// Doubts about a requirement that asks for nothing, or whose bearings are most likely radians.
fn doubts_of_rule(at: &Location, required: &RequirementDescription) -> Vec<Note> {
    let mut doubts = Vec::new();
    if required.share == Some(0.0) {
        doubts.push(format!("{}: 0 asks for nothing; 0.9 asks for 90 %", at.key("share")));
    }
    let [low, high] = required.bearing.unwrap_or_default();
    // Behind is [2.57, 3.71] in radians, which would be a sector of one degree.
    let is_within_a_turn = low.abs().max(high.abs()) <= TAU + check::ROUNDED;
    if is_within_a_turn && [low, high].iter().any(|bearing| bearing.fract() != 0.0) {
        doubts.push(format!(
            "{}: {low} to {high} are degrees; radians? {high} rad are {:.1}°",
            at.key("bearing"),
            high.to_degrees()
        ));
    }
    let mut notes: Vec<Note> = doubts.into_iter().map(Note::doubt).collect();
    // A sector of a few whole degrees may be meant.
    let is_narrow = 0.0 < high - low && high - low < NARROW_SECTOR;
    if is_within_a_turn && is_narrow && [low, high].iter().all(|bearing| bearing.fract() == 0.0) {
        notes.push(Note::fact(format!(
            "{}: [{low}, {high}] is a sector of {}°; bearings are degrees, and 1 rad is 57.3°",
            at.key("bearing"),
            high - low
        )));
    }
    notes
}

/// Width of a sector in degrees below which its bearings may be radians: half a turn is 3.14 rad.
const NARROW_SECTOR: f64 = 3.2;

/// Content of a vehicle's `require`.
#[derive(Default)]
struct Requirements {
    areas: Vec<Requirement>,
    targets: Vec<TargetRule>,
    ground: Vec<GroundRule>,
    overlap: Vec<OverlapRule>,
    /// Positions in the file of areas, targets, ground and overlap.
    positions: [Vec<usize>; 4],
    /// Target files and their meshes.
    files: Vec<PathBuf>,
    notes: Vec<Note>,
}

impl Requirements {
    fn new(at: &Location, list: &[RequirementDescription], dir: &Path) -> Checked<Self> {
        let mut all = Self::default();
        let mut names: Vec<String> = Vec::new();
        for (i, required) in list.iter().enumerate() {
            let at = at.item(i);
            if let Some(share) = required.share.filter(|share| !(0.0..=1.0).contains(share)) {
                let percent = (1.0..=100.0).contains(&share);
                let hint = percent.then(|| format!(": {share} % is {}", share / 100.0));
                let wanted = format!("a share from 0 to 1{}", hint.unwrap_or_default());
                return Err(bad(&at.key("share"), share, wanted));
            }
            all.notes.extend(doubts_of_rule(&at, required));
            let (kind, name) = all.read(&at, required, dir)?;
            all.positions[kind].push(i);
            names.push(name);
        }
        // Results tell the entries apart by their names, the default ones too.
        for (i, name) in names.iter().enumerate() {
            if let Some(first) = names[..i].iter().position(|other| other == name) {
                let wanted = format!(
                    "a name of its own, since require[{first}] has this one; give one of them another `name`"
                );
                return Err(bad(&at.item(i).key("name"), format!("`{name}`"), wanted));
            }
        }
        Ok(all)
    }

    /// Reads an entry; returns the number of its kind and its name.
    fn read(
        &mut self,
        at: &Location,
        required: &RequirementDescription,
        dir: &Path,
    ) -> Checked<(usize, String)> {
        if let Some(rule) = OverlapRule::read(at, required)? {
            let name = rule.name.clone();
            self.overlap.push(rule);
            return Ok((3, name));
        }
        if let Some(rule) = GroundRule::read(at, required)? {
            let name = rule.name.clone();
            self.ground.push(rule);
            return Ok((2, name));
        }
        let Some(target) = &required.target else {
            let area = area(at, required)?;
            let name = area.name.clone();
            self.areas.push(area);
            return Ok((0, name));
        };
        let rule = TargetRule::new(at, required, target, dir)?;
        let name = rule.name.clone();
        self.notes.extend(rule.target.notes.iter().cloned());
        self.files.extend(rule.target.files.iter().cloned());
        self.targets.push(rule);
        Ok((1, name))
    }
}
