//! Rules of a vehicle on the view of a placement: ground, targets, overlap of LiDARs.

use std::path::Path;
use std::sync::Arc;

use sightline_files::json::check::bad;
use sightline_files::json::{Checked, Location, check};

use super::description::{GroundDescription, RequirementDescription};
use crate::scene::Target;

/// Farthest ground of a rule, metres from the outline of the own body.
pub const FARTHEST_GROUND: f64 = 10.0;

/// Nearest ground that a rule usually asks for, metres: smaller ones are no hint at millimetres.
const NEAREST_GROUND: f64 = 0.25;

/// End of the name of a rule that must hold whichever one LiDAR is lost.
pub const ANY_LOST: &str = ", any one LiDAR lost";
/// Words on a target that stands on the ground of scenes.
pub const ON_SCENE: &str = ", on the ground of the scene";

/// Name of a rule that gives itself none.
fn default_name(rule: String, without_any_one: bool) -> String {
    rule + if without_any_one { ANY_LOST } else { "" }
}

/// A side of the vehicle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Before the front edge.
    Ahead,
    /// Behind the rear edge.
    Behind,
    /// Beside the left edge.
    Left,
    /// Beside the right edge.
    Right,
}

impl Side {
    /// Every side.
    pub const ALL: [Self; 4] = [Self::Ahead, Self::Behind, Self::Left, Self::Right];

    /// Its name in files and results.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ahead => "ahead",
            Self::Behind => "behind",
            Self::Left => "left",
            Self::Right => "right",
        }
    }

    /// The side as a mirror at the plane y = 0 shows it.
    #[must_use]
    pub fn mirrored(self) -> Self {
        match self {
            Self::Left => Self::Right,
            Self::Right => Self::Left,
            other => other,
        }
    }
}

/// Ground that a rule asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum GroundAsked {
    /// All ground up to a distance from the outline of the own body, metres. The share counts cells.
    Within(f64),
    /// The blind zone on one side ends within a distance from the edge, metres. The share counts lanes.
    BlindZone(Side, f64),
}

/// Ground near the vehicle that must be seen, as the near field measures it in a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct GroundRule {
    /// Name in reports.
    pub name: String,
    /// Ground that it asks for.
    pub asked: GroundAsked,
    /// Least share of it, from 0 to 1.
    pub share: f64,
    /// The share must hold without any one LiDAR, whichever is lost.
    pub without_any_one: bool,
}

impl GroundRule {
    /// Reads the rule at `at`; `None` where it is of another kind.
    pub(super) fn read(at: &Location, required: &RequirementDescription) -> Checked<Option<Self>> {
        let within = match &required.ground {
            // A target that stands on the surface of a scene.
            Some(GroundDescription::Word(_)) if required.target.is_some() => return Ok(None),
            Some(GroundDescription::Word(word)) => {
                let wanted = "a number of metres from the own body; `scene` is of a `target`";
                return Err(bad(&at.key("ground"), format!("`{word}`"), wanted));
            }
            Some(GroundDescription::Within(metres)) => Some(*metres),
            None => None,
        };
        let asked = match (within, &required.blind_zone) {
            (None, None) => return Ok(None),
            (Some(_), Some(_)) => {
                let mend = "`ground` is another rule; write two";
                return Err(check::misplaced(at, "blind_zone", mend));
            }
            (Some(within), None) => GroundAsked::Within(distance(at, "ground", within)?),
            (None, Some(side)) => {
                let known = Side::ALL.into_iter().find(|known| known.name() == side);
                let wanted = "a side: ahead, behind, left or right";
                let wrong = || bad(&at.key("blind_zone"), format!("`{side}`"), wanted);
                let side = known.ok_or_else(wrong)?;
                let mend = "say within how many metres the blind zone must end, `\"depth\": 2` for example";
                let depth = required.depth.ok_or_else(|| check::missing(at, "depth", mend))?;
                GroundAsked::BlindZone(side, distance(at, "depth", depth)?)
            }
        };
        let (default, share, own) = match asked {
            GroundAsked::Within(metres) => {
                (format!("ground to {metres} m"), required.share(at)?, &["ground"][..])
            }
            GroundAsked::BlindZone(side, metres) => {
                let name = format!("blind zone {} to {metres} m", side.name());
                (name, required.share.unwrap_or(1.0), &["blind_zone", "depth"][..])
            }
        };
        let own = [own, &["share", "without_any_one"]].concat();
        let mend = "a rule on the ground has `ground` and `share`, or `blind_zone` and `depth`";
        required.has_only(at, &own, |_| mend)?;
        let without_any_one = required.without_any_one;
        let name = required.named(at, default_name(default, without_any_one))?;
        Ok(Some(Self { name, asked, share, without_any_one }))
    }
}

fn distance(at: &Location, key: &'static str, metres: f64) -> Checked<f64> {
    if metres > 0.0 && metres <= FARTHEST_GROUND {
        return Ok(metres);
    }
    let is_usual = |metres: f64| (NEAREST_GROUND..=FARTHEST_GROUND).contains(&metres);
    let wanted = format!("metres from the own body, above 0 and at most {FARTHEST_GROUND}");
    Err(bad(&at.key(key), metres, check::or_millimetres(wanted, metres, is_usual)))
}

/// Distance from which on a rule counts where it does not say, metres.
const FROM: f64 = 5.0;
/// Beams from which on a target is met where a rule does not say.
const BEAMS: u64 = 5;
const MOST_BEAMS: u64 = 100;
/// Keys of a rule, besides `name`.
const KEYS: [&str; 9] = [
    "target", "from", "within", "bearing", "ground", "beams", "response", "share",
    "without_any_one",
];
/// Part of the name of a rule that counts only beams that return.
const RETURNING: &str = ", beams that return";
/// Farthest distance of a rule, metres.
const FARTHEST: f64 = 1000.0;

/// A target that must be met at a share of places around the vehicle: on level ground, the own body in the way, or on the
/// surface of each scene.
#[derive(Debug, Clone, PartialEq)]
pub struct TargetRule {
    /// Name in reports.
    pub name: String,
    /// The target.
    pub target: Arc<Target>,
    /// Nearest distance from the ego origin to the middle of the target, metres.
    pub from: f64,
    /// Farthest distance, metres.
    pub within: f64,
    /// First and last bearing, degrees counter-clockwise from straight ahead; 360 apart for all round.
    pub bearings: [f64; 2],
    /// True: it stands on the surface of each scene in its first frame, all that is there in the way, and the share is a
    /// mean over scenes. False: on level ground.
    pub on_scene: bool,
    /// Beams of all LiDARs together from which on the target is met.
    pub beams: u32,
    /// Least share of the places at which it must be met, from 0 to 1.
    pub share: f64,
    /// The share must hold without any one LiDAR, whichever is lost.
    pub without_any_one: bool,
}

/// True if a target stands on the surface of each scene.
fn stands_on_scene(at: &Location, required: &RequirementDescription) -> Checked<bool> {
    match &required.ground {
        Some(GroundDescription::Word(word)) if word != "scene" => {
            let wanted = "`scene`; leave it out for level ground";
            Err(bad(&at.key("ground"), format!("`{word}`"), wanted))
        }
        ground => Ok(ground.is_some()),
    }
}

/// Distances of a requirement in words, metres.
fn distances(from: f64, within: f64) -> String {
    if from == within { format!("at {within}") } else { format!("from {from} to {within}") }
}

/// Bearings of a requirement in words, behind a comma; empty all round.
fn around(bearing: Option<[f64; 2]>) -> String {
    match bearing {
        Some([low, high]) if low == high => format!(", at {low}°"),
        Some([low, high]) if high - low < 360.0 => format!(", {low}° to {high}°"),
        _ => String::new(),
    }
}

/// First distance of a requirement whose last one is `within`; both are checked.
fn from_of(at: &Location, given: Option<f64>, within: f64) -> Checked<f64> {
    let from = given.unwrap_or(FROM.min(within.max(0.0)));
    let fits = |metres: f64| metres > 0.0 && metres <= FARTHEST;
    if from != 0.0 && !fits(from) {
        let wanted = format!("metres from 0 to {FARTHEST}");
        return Err(bad(&at.key("from"), from, check::or_millimetres(wanted, from, fits)));
    }
    if (from..=FARTHEST).contains(&within) && within != 0.0 {
        return Ok(from);
    }
    let at = at.key("within");
    if within > FARTHEST {
        let wanted = check::or_millimetres(format!("at most {FARTHEST} m"), within, fits);
        return Err(bad(&at, within, wanted));
    }
    if within <= 0.0 {
        return Err(bad(&at, within, format!("above 0 m and at most {FARTHEST} m")));
    }
    let told = format!(
        "{within} m must be at least `from` ({from} m); if they are swapped, write \"from\": {within}, \"within\": {from}"
    );
    Err(check::refused(&at, told))
}

/// Bearings of a requirement, all round where none are given; both are checked.
fn sector(at: &Location, given: Option<[f64; 2]>) -> Checked<[f64; 2]> {
    let [low, high] = given.unwrap_or([-180.0, 180.0]);
    if (-360.0..=360.0).contains(&low) && low <= high && high - low <= 360.0 {
        return Ok([low, high]);
    }
    let meant = check::rising_sector([low, high]);
    let meant = meant.map_or("behind is [170, 190]".to_owned(), |[first, last]| {
        format!("counter-clockwise from {low}° to {high}° is [{first}, {last}]")
    });
    let wanted =
        format!("[first, last] in degrees, the smaller first, at most a turn apart; {meant}");
    Err(bad(&at.key("bearing"), format!("{:?}", [low, high]), wanted))
}

impl TargetRule {
    /// Reads the rule at `at`; target files are in `dir`.
    pub(super) fn new(
        at: &Location,
        required: &RequirementDescription,
        target: &str,
        dir: &Path,
    ) -> Checked<Self> {
        required.has_only(at, &KEYS, |key| match key {
            "depth" => "it is of a `blind_zone`; a `target` has `within`",
            _ => "a `target` stands on the ground around the vehicle; leave the box out",
        })?;
        let on_scene = stands_on_scene(at, required)?;
        let mut target = Target::named_at(&at.key("target"), dir, target)?;
        target.returning_only = required.response;
        let mend = "say up to which distance, `\"within\": 40` for example";
        let within = required.within.ok_or_else(|| check::missing(at, "within", mend))?;
        let from = from_of(at, required.from, within)?;
        let bearings = sector(at, required.bearing)?;
        let beams = required.beams.unwrap_or(BEAMS);
        let beams = check::count(&at.key("beams"), beams, 1, MOST_BEAMS)?;
        let range = distances(from, within);
        let needed = match u64::from(beams) {
            BEAMS => String::new(),
            1 => ", 1 beam".to_owned(),
            beams => format!(", {beams} beams"),
        };
        let around = around(required.bearing);
        let ground = if on_scene { ON_SCENE } else { "" };
        let returning = if required.response { RETURNING } else { "" };
        let default = format!("{} {range} m{around}{needed}{returning}{ground}", target.name);
        let name = required.named(at, default_name(default, required.without_any_one))?;
        Ok(Self {
            name,
            target: Arc::new(target),
            from,
            within,
            bearings,
            on_scene,
            beams,
            share: required.share(at)?,
            without_any_one: required.without_any_one,
        })
    }
}

/// Name of a rule on overlap that gives itself none.
const NAME: &str = "overlap of LiDARs";

/// Overlap by which pairs must connect every LiDAR to every other one, in each scene.
#[derive(Debug, Clone, PartialEq)]
pub struct OverlapRule {
    /// Name in reports.
    pub name: String,
    /// Least overlap of a pair that counts, from 0 to 1: surface voxels that both have hits in, as a share of the voxels of
    /// the LiDAR that has fewer.
    pub share: f64,
    /// The others must stay connected without any one LiDAR, whichever is lost.
    pub without_any_one: bool,
}

impl OverlapRule {
    /// Reads the rule at `at`; `None` where it is of another kind.
    pub(super) fn read(at: &Location, required: &RequirementDescription) -> Checked<Option<Self>> {
        let Some(share) = required.overlap else { return Ok(None) };
        required.has_only(at, &["overlap", "without_any_one"], |key| match key {
            "share" => "`overlap` itself is the share; leave `share` out",
            _ => "a rule on overlap has `overlap` alone; write two rules",
        })?;
        if !(share > 0.0 && share <= 1.0) {
            let wanted = "a share of the surface voxels of two LiDARs, above 0 and at most 1, 0.05 for example";
            return Err(bad(&at.key("overlap"), share, wanted));
        }
        let name = required.named(at, default_name(NAME.to_owned(), required.without_any_one))?;
        Ok(Some(Self { name, share, without_any_one: required.without_any_one }))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::scene::Scene;

    /// Error of a vehicle with one requirement.
    fn refused(required: &str) -> String {
        scene_of(required).unwrap_err().to_string()
    }

    /// Notes on one, a line each.
    fn notes(required: &str) -> String {
        let scene = scene_of(required).unwrap();
        scene.notes().iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
    }

    fn scene_of(required: &str) -> sightline_files::json::Checked<Scene> {
        let text = format!(
            r#"{{"sightline": 1, "roi": {{"min": [-20, -20, -0.5], "max": [20, 20, 5.5], "voxel": [0.4, 0.4, 0.4]}},
            "vehicle": {{"sightline": 1,
              "body": [{{"class": "vehicle", "box": {{"min": [-2, -1, 0.2], "max": [2, 1, 1.8]}}}}],
              "sensors": [{{"name": "a", "lidar": {{"channels": 4, "fov": [-25, 5], "azimuth_steps": 8, "range": 50}}}}],
              "mounts": [{{"name": "roof", "min": [0, 0, 2], "max": [0, 0, 2.2], "count": 1}}],
              "require": [{{{required}}}]}},
            "static": [{{"class": "road", "plane": {{"min": [-50, -50], "max": [50, 50], "z": 0}}}}]}}"#
        );
        Scene::from_json(&text, Path::new(""), "s.json")
    }

    #[test]
    fn distances_in_millimetres_are_asked_about() {
        let ground = |metres: u32| format!(r#""ground": {metres}, "share": 1"#);
        let car = |more: &str| format!(r#""target": "car", "share": 1, {more}"#);
        let millimetres = "is it in millimetres? lengths are in metres,";
        let near =
            format!("is not metres from the own body, above 0 and at most 10; {millimetres}");
        let far = format!("is not metres from 0 to 1000; {millimetres}");
        let behind = r#""blind_zone": "behind", "depth": 2500"#.to_owned();
        let deep = r#""blind_zone": "behind", "depth": 30"#.to_owned();
        for (required, told) in [
            (ground(2000), format!("2000 {near} 2000 mm are 2")),
            (behind, format!("{millimetres} 2500 mm are 2.5")),
            (car(r#""from": 30000, "within": 30000"#), format!("30000 {far} 30000 mm are 30")),
            (car(r#""within": 40000"#), format!("{millimetres} 40000 mm are 40")),
            // A thousandth that fits no better is no hint.
            (ground(20_000), "above 0 and at most 10".to_owned()),
            (ground(30), "above 0 and at most 10".to_owned()),
            (ground(249), "above 0 and at most 10".to_owned()),
            (ground(250), format!("{millimetres} 250 mm are 0.25")),
            (deep, "30 is not metres from the own body, above 0 and at most 10".to_owned()),
            (car(r#""from": -1, "within": 30"#), "metres from 0 to 1000".to_owned()),
            (car(r#""within": 2000000"#), "2000000 is not at most 1000 m".to_owned()),
            (car(r#""within": 0"#), "within: 0 is not above 0 m and at most 1000 m".to_owned()),
            (
                car(r#""from": 30, "within": 20"#),
                "within: 20 m must be at least `from` (30 m); if they are swapped, write \"from\": 20, \"within\": 30".to_owned(),
            ),
        ] {
            assert_ends!(refused(&required), &told);
        }
    }

    #[test]
    fn targets_beyond_every_sensor_are_refused_and_narrow_sectors_told() {
        let far = |from: u32| {
            format!(r#""target": "child", "from": {from}, "within": 250, "share": 0.9"#)
        };
        assert_ends!(
            refused(&far(200)),
            "require[0].from: 200 m is farther than any sensor of the vehicle reaches, 50 m, and so is every place of the \
             target; lower `from` and `within`, or give a sensor of longer range"
        );
        // The nearest places are within reach of the sensor above the origin: a doubt, as before.
        assert_holds!(notes(&far(50)), "require[0].within: 250 m is farther than any sensor");
        let sector = |bearing: &str| {
            notes(&format!(
                r#""target": "child", "within": 20, "share": 0.9, "bearing": {bearing}"#
            ))
        };
        assert_holds!(
            sector("[-1.0, 1.0]"),
            "require[0].bearing: [-1, 1] is a sector of 2°; bearings are degrees"
        );
        for fine in ["[0, 0]", "[-2, 2]", "[89, 91]"] {
            assert_eq!(sector(fine), "", "{fine}");
        }
    }

    #[test]
    fn a_bearing_that_falls_is_told_with_the_sector_that_it_means() {
        let told = |bearing: &str| {
            refused(&format!(r#""target": "car", "within": 40, "share": 1, "bearing": {bearing}"#))
        };
        let first = "the smaller first, at most a turn apart; ";
        for (bearing, meant) in [
            ("[350, 10]", "counter-clockwise from 350° to 10° is [-10, 10]"),
            ("[-10, -350]", "counter-clockwise from -10° to -350° is [-10, 10]"),
            ("[170, -170]", "counter-clockwise from 170° to -170° is [170, 190]"),
            ("[700, 710]", "behind is [170, 190]"),
            ("[0, 370]", "behind is [170, 190]"),
        ] {
            assert_ends!(told(bearing), &format!("{first}{meant}"));
        }
    }
}
