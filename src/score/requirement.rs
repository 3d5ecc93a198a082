//! Requirements: the share of each that is found, and words on it.

use serde::ser::SerializeMap as _;
use serde::{Deserialize, Serialize, Serializer};

use super::WorstFrame;
use crate::vehicle::{ANY_LOST, ON_SCENE};

/// Share of the copies that meet a requirement, in words.
fn held_in_words(share: f64) -> String {
    let paper = if share < HOLDS { "ON PAPER ONLY, " } else { "" };
    format!("{paper}met by {} % of copies mounted within the tolerance", percent_down(share))
}

/// Share of the copies that meet all requirements, in words.
pub(crate) fn all_held_in_words(share: f64) -> String {
    format!("all requirements: {}", held_in_words(share))
}

/// Least share of copies within the mounting tolerance that must meet a requirement; below, it is met on paper only.
pub(crate) const HOLDS: f64 = 0.95;

/// The word for a share of voxels, places or ground.
pub(crate) const SEEN: &str = "seen";
/// The word for a share of overlap.
pub(crate) const SHARED: &str = "shared";

/// A requirement: a share of something that must be seen, or be shared by LiDARs.
///
/// Written to JSON as `name`, `required`, `found`, `met`; also `missing`, `holds_in`, `intact`, `worst_without`,
/// `worst_frame`, `places` and `between` where they are known.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Seen {
    /// Name on the vehicle.
    pub name: String,
    /// Share that is found, by the kind of requirement:
    /// - area: share of its voxels that beams pass, a mean over frames
    /// - target: share of its places at which enough beams meet it
    /// - ground: share that is seen
    /// - overlap: the largest at which pairs connect all LiDARs
    pub share: f64,
    /// The word for the share: `SEEN`, or `SHARED` of overlap.
    pub done: &'static str,
    /// Share that is required.
    pub least: f64,
    /// Words on the places, ground or LiDARs that an unmet requirement lacks. For a met one on targets: the places
    /// still missed, where a placement is looked at closely.
    pub missing: Option<String>,
    /// Share of copies within the mounting tolerance that still meet it; `None` where not looked at.
    pub holds_in: Option<f64>,
    /// The intact rig, of a requirement that must hold whichever one LiDAR is lost: `share` is then the least one.
    pub lost: Option<Lost>,
    /// Frame in which bodies that move leave least of the ground or of a target; `None` where it is the same in all.
    pub worst_frame: Option<WorstFrame>,
    /// Places of a target; `None` of other requirements.
    pub places: Option<RulePlaces>,
    /// A target at places closer together; `None` where nobody looked.
    pub between: Option<Between>,
}

/// Places of a requirement on a target, summed over poses of the own bodies or over scenes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct RulePlaces {
    /// Places that count.
    pub judged: usize,
    /// Places without room for the target: in the own body or in a thing, or, on the ground of a scene, without ground.
    pub left_out: usize,
    /// True if the target stands on the ground of scenes, false on level ground.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub on_scene: bool,
}

/// A requirement on a target at places closer together than its own, all of which lie among them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Between {
    /// Places that count.
    pub places: usize,
    /// Share of them at which the target is met, whichever LiDAR is lost where the requirement says so.
    pub found: f64,
}

impl RulePlaces {
    /// Words on the places left out, behind a semicolon; empty where there are none.
    fn words(&self) -> String {
        let Self { judged, left_out, .. } = self;
        if *left_out == 0 {
            return String::new();
        }
        format!("; {left_out} of {} places left out: no room there", judged + left_out)
    }
}

/// A requirement that must hold whichever one LiDAR is lost: the share of the intact rig, and the worst loss.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Lost {
    /// Share with every LiDAR.
    pub intact: f64,
    /// LiDAR whose loss leaves least; `None` where every loss leaves as much, or of a rig without LiDARs.
    pub worst: Option<usize>,
    /// Mount of that LiDAR, where it has a name.
    pub mount: Option<String>,
    /// Frame in which bodies that move leave least to the intact rig; `None` where it is the same in all.
    pub intact_frame: Option<WorstFrame>,
}

/// A LiDAR of a placement by its number, and by its mount where that has a name: `LiDAR 8 (bumper)`.
pub(crate) fn lidar_name(lidar: usize, mount: Option<&str>) -> String {
    match mount {
        Some(mount) => format!("LiDAR {lidar} ({mount})"),
        None => format!("LiDAR {lidar}"),
    }
}

impl Seen {
    /// True if enough is seen.
    pub(crate) fn is_met(&self) -> bool {
        self.share >= self.least
    }

    /// True if it is met, and too little is seen at places closer together.
    pub(crate) fn is_missed_between(&self) -> bool {
        self.is_met() && self.between.is_some_and(|of| of.found < self.least)
    }

    /// The share at places closer together, where it does not read as the share does.
    pub(crate) fn told_between(&self) -> Option<Between> {
        self.between.filter(|of| percent_down(of.found) != percent_down(self.share))
    }

    /// [`Self::told_between`] in words that follow a semicolon.
    fn between_in_words(&self) -> String {
        let Some(Between { places, found }) = self.told_between() else { return String::new() };
        let missed = if self.is_missed_between() { "ONLY " } else { "" };
        format!("; {missed}{:.1} % at {places} places closer together", percent_down(found))
    }

    /// Its name, followed by [`ON_SCENE`] and [`ANY_LOST`] where these hold of it and its name does not say so.
    pub(crate) fn title(&self) -> String {
        let on_scene = self.places.is_some_and(|places| places.on_scene);
        let tells = |words: &[&str]| words.iter().any(|words| self.name.contains(words));
        let scene = if on_scene && !tells(&["the scene"]) { ON_SCENE } else { "" };
        let is_told = self.lost.is_none() || tells(&["LiDAR lost", "one lost"]);
        let lost = if is_told { "" } else { ANY_LOST };
        format!("{}{scene}{lost}", self.name)
    }

    /// A requirement of 90 %, for tests.
    #[cfg(test)]
    pub(crate) fn of(name: &str, share: f64) -> Self {
        Self { name: name.to_owned(), share, done: SEEN, least: 0.9, ..Self::default() }
    }
}

impl Serialize for Seen {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self { name, share, least, missing, holds_in, lost, .. } = self;
        let mut object = serializer.serialize_map(None)?;
        object.serialize_entry("name", name)?;
        object.serialize_entry("required", least)?;
        object.serialize_entry("found", share)?;
        object.serialize_entry("met", &self.is_met())?;
        missing.iter().try_for_each(|of| object.serialize_entry("missing", of))?;
        holds_in.iter().try_for_each(|of| object.serialize_entry("holds_in", of))?;
        if let Some(Lost { intact, worst, .. }) = lost {
            object.serialize_entry("intact", intact)?;
            object.serialize_entry("worst_without", worst)?;
        }
        self.worst_frame.iter().try_for_each(|of| object.serialize_entry("worst_frame", of))?;
        self.places.iter().try_for_each(|of| object.serialize_entry("places", of))?;
        self.between.iter().try_for_each(|of| object.serialize_entry("between", of))?;
        object.end()
    }
}

/// A share in per cent, rounded down to tenths: one that is less than a requirement never reads as met.
pub(crate) fn percent_down(share: f64) -> f64 {
    (1e3 * share + 1e-9).floor() / 10.0
}

/// A share in per cent, rounded up to tenths: a requirement that a share misses never reads as that share.
pub(crate) fn percent_up(share: f64) -> f64 {
    // A plus 0 is no minus 0.
    (1e3 * share - 1e-9).ceil() / 10.0 + 0.0
}

/// A depth in metres, rounded up to tenths: a blind zone never reads as shorter than it is.
pub(crate) fn metres_up(depth: f64) -> f64 {
    (10.0 * depth - 1e-9).ceil() / 10.0 + 0.0
}

impl Lost {
    /// In words behind a share, with those on its worst frame: ` with the worst LiDAR lost (72.5 % with all)`.
    fn beside(&self, frame: &str) -> String {
        let intact = percent_down(self.intact);
        match frame.strip_prefix(" (") {
            Some(frame) => format!(" with the worst LiDAR lost ({intact:.1} % with all; {frame}"),
            None => format!(" with the worst LiDAR lost{frame} ({intact:.1} % with all)"),
        }
    }
}

impl std::fmt::Display for Seen {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { share, done, least, missing, holds_in, lost, worst_frame, .. } = self;
        let not = if self.is_met() { "" } else { "NOT MET: " };
        write!(f, "{not}{}: {:.1} % {done}", self.title(), percent_down(*share))?;
        let frame = worst_frame.iter().map(|worst| worst.beside(*share)).collect::<String>();
        match lost {
            Some(lost) => f.write_str(&lost.beside(&frame))?,
            None => f.write_str(&frame)?,
        }
        write!(f, ", {:.1} % required", percent_up(*least))?;
        let mut lacks = missing.iter().filter(|_| !self.is_met());
        lacks.try_for_each(|missing| write!(f, ", {missing}"))?;
        if let Some(Lost { worst: Some(lidar), mount, .. }) = lost {
            write!(f, "; worst without {}", lidar_name(*lidar, mount.as_deref()))?;
        }
        if self.is_met() {
            holds_in.iter().try_for_each(|holds| write!(f, ", {}", held_in_words(*holds)))?;
            missing.iter().try_for_each(|missing| write!(f, "; {missing}"))?;
        }
        f.write_str(&self.between_in_words())?;
        self.places.iter().try_for_each(|places| f.write_str(&places.words()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_at_places_closer_together_is_told_where_it_differs() {
        let told = |found: f64| {
            let between = Some(Between { places: 310, found });
            let seen = Seen { between, ..Seen::of("tyre", 0.95) };
            (seen.to_string(), seen.is_missed_between())
        };
        let met = "tyre: 95.0 % seen, 90.0 % required";
        assert_eq!(told(0.9501), (met.to_owned(), false));
        assert_eq!(told(0.97), (format!("{met}; 97.0 % at 310 places closer together"), false));
        assert_eq!(
            told(0.899),
            (format!("{met}; ONLY 89.9 % at 310 places closer together"), true)
        );
        let seen =
            Seen { between: Some(Between { places: 310, found: 0.9 }), ..Seen::of("tyre", 0.8) };
        assert!(!seen.is_missed_between());
        assert!(seen.to_string().ends_with("; 90.0 % at 310 places closer together"), "{seen}");
        let json = serde_json::to_value(&seen).unwrap();
        assert_eq!(json["between"], serde_json::json!({ "places": 310, "found": 0.9 }));
    }
}
