//! Most by which a LiDAR's mounting is off.

use std::fmt;
use std::str::FromStr;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// Most by which a LiDAR's mounting is off: each coordinate and each angle, to either side.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Tolerance {
    /// Along x, y and z, metres.
    pub metres: f64,
    /// In roll, pitch and yaw, radians.
    pub radians: f64,
}

/// Most metres, and most radians.
const MOST: f64 = 1.0;
/// Metres and radians above which a tolerance is most likely a slip: 0.2 m and 5°.
const LIKELY: [f64; 2] = [0.2, 0.0873];

impl Default for Tolerance {
    /// 5 mm and 0.5°: a bracket that is bolted on and not measured afterwards.
    fn default() -> Self {
        Self { metres: 0.005, radians: 0.5_f64.to_radians() }
    }
}

impl FromStr for Tolerance {
    type Err = String;

    /// A length in m, cm or mm and an angle in deg or rad, as `5mm,0.5deg`.
    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = |why: &str| {
            format!(
                "`{text}` is no tolerance; {why}write a length and an angle, as 5mm,0.5deg, or 0"
            )
        };
        let with_unit = |text: &str, units: [(&str, f64); 3]| {
            let (number, scale) =
                units.iter().find_map(|(unit, scale)| Some((text.strip_suffix(unit)?, scale)))?;
            let value = number.trim().parse::<f64>().ok()? * scale;
            (value >= 0.0).then_some(value)
        };
        if text.trim() == "0" {
            return Ok(Self { metres: 0.0, radians: 0.0 });
        }
        let is_below = text.contains('-') && !text.contains("e-");
        let below = if is_below { "a tolerance is not below 0: " } else { "" };
        let (length, angle) = text.trim().split_once(',').ok_or_else(|| wrong(below))?;
        let length = with_unit(length.trim(), [("mm", 1e-3), ("cm", 1e-2), ("m", 1.0)]);
        let degree = 1.0_f64.to_radians();
        let angle = with_unit(angle.trim(), [("deg", degree), ("°", degree), ("rad", 1.0)]);
        let (metres, radians) = length.zip(angle).ok_or_else(|| wrong(below))?;
        if metres > MOST || radians > MOST {
            return Err(wrong("at most 1 m and 57.3°: "));
        }
        Ok(Self { metres, radians })
    }
}

impl TryFrom<String> for Tolerance {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<Tolerance> for String {
    fn from(tolerance: Tolerance) -> Self {
        tolerance.to_string()
    }
}

impl fmt::Display for Tolerance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [length, angle] = self.small();
        write!(f, "{length}mm,{angle}deg")
    }
}

impl Tolerance {
    /// A doubt about a tolerance that no mounting has, in words.
    pub(crate) fn doubt(&self) -> Option<String> {
        (self.metres > LIKELY[0] || self.radians > LIKELY[1]).then(|| {
            format!(
                "--tolerance {self} is more than mountings are off, 0.2 m and 5°; a bracket holds within {}",
                Self::default()
            )
        })
    }

    /// Millimetres and degrees.
    pub(crate) fn small(&self) -> [f64; 2] {
        // A rounding of the ninth digit comes from the change of units.
        [1e3 * self.metres, self.radians.to_degrees()].map(|value| (value * 1e9).round() / 1e9)
    }

    /// In words: `5 mm and 0.5°`.
    pub(crate) fn in_words(&self) -> String {
        let [length, angle] = self.small();
        format!("{length} mm and {angle}°")
    }

    /// True if LiDARs may be off at all.
    pub(crate) fn is_some(&self) -> bool {
        self.metres > 0.0 || self.radians > 0.0
    }

    /// Offsets of the pose fields of each LiDAR in each of so many poses, `[lidars][poses]`: none in the first.
    pub(super) fn offsets(&self, [lidars, poses]: [usize; 2], seed: u64) -> Vec<Vec<[f64; 6]>> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let most =
            [self.metres, self.metres, self.metres, self.radians, self.radians, self.radians];
        let mut off = |_| most.map(|most| most * rng.random_range(-1.0..=1.0));
        let mut of_lidar = |_| {
            let moved = (1..poses).map(&mut off);
            std::iter::once([0.0; 6]).chain(moved).collect()
        };
        (0..lidars).map(&mut of_lidar).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::copies::{SEED_OF_RESULT, SEED_OF_SEARCH};

    const POSES: usize = 16;

    #[test]
    fn a_tolerance_is_read_and_written() {
        let read = |text: &str| text.parse::<Tolerance>();
        assert_eq!(read("5mm,0.5deg"), Ok(Tolerance::default()));
        assert_eq!(read(" 0.5 cm , 0.5° "), Ok(Tolerance::default()));
        let rad = read("0.002m,0.01rad").unwrap();
        assert_eq!((rad.metres, rad.radians), (0.002, 0.01));
        assert_eq!(Tolerance::default().to_string(), "5mm,0.5deg");
        assert_eq!(Tolerance::default().in_words(), "5 mm and 0.5°");
        let large = read("5m,90deg").unwrap_err();
        assert!(large.contains("is no tolerance; at most 1 m and 57.3°: write"), "{large}");
        let doubted = |text: &str| read(text).unwrap().doubt().is_some();
        assert_eq!(
            ["200mm,5deg", "0", "0.21m,1deg", "1mm,6deg"].map(doubted),
            [false, false, true, true]
        );
        let none = read("0").unwrap();
        assert_eq!((none.metres, read(&none.to_string())), (0.0, Ok(none)));
        for wrong in
            ["", "5", "5mm", "5mm,", "5km,1deg", "-1mm,0deg", "nanmm,0deg", "2m,0deg", "1mm,2rad"]
        {
            assert!(read(wrong).unwrap_err().contains("5mm,0.5deg"), "{wrong}");
        }
    }

    #[test]
    fn offsets_stay_within_the_tolerance_and_fill_it() {
        let tolerance = Tolerance::default();
        let poses: Vec<_> = tolerance.offsets([40, POSES], SEED_OF_RESULT).concat();
        assert!(poses.iter().step_by(POSES).all(|off| *off == [0.0; 6]));
        let of_search = tolerance.offsets([40, POSES], SEED_OF_SEARCH).concat();
        let same = poses.iter().zip(&of_search).filter(|(a, b)| a == b).count();
        assert_eq!(same, 40, "a search chooses by other moves than its result is judged by");
        for k in 0..6 {
            let most = if k < 3 { tolerance.metres } else { tolerance.radians };
            let off = |moved: &[f64; 6]| moved[k] / most;
            let [low, high] =
                [f64::min, f64::max].map(|f| poses.iter().map(off).reduce(f).unwrap());
            assert!(
                low >= -1.0 - 1e-9 && high <= 1.0 + 1e-9 && low < -0.95 && high > 0.95,
                "field {k}"
            );
        }
    }
}
