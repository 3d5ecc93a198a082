//! Models given by `--sensor` to LiDARs of placements that name none.

use std::str::FromStr;

use super::{ForeignLidar, Placement, SensorName};

/// Word for every LiDAR.
const ALL: &str = "all";

/// A model for one LiDAR of every placement, or for all: `0=spin-32`, `all=spin-32`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SensorChoice {
    /// Index of the LiDAR, from 0; `None` for all.
    pub lidar: Option<usize>,
    /// Its model.
    pub sensor: SensorName,
}

impl FromStr for SensorChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text.split_once('=').and_then(|(lidar, sensor)| {
            let lidar = (lidar != ALL).then(|| lidar.parse().ok());
            Some((lidar.map_or(Some(None), |index| index.map(Some))?, sensor))
        });
        let Some((lidar, sensor)) = parsed else {
            return Err("give N=MODEL with the index of a LiDAR from 0, or all=MODEL".to_owned());
        };
        Ok(Self { lidar, sensor: SensorName::new(sensor)? })
    }
}

impl std::fmt::Display for SensorChoice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.lidar {
            Some(lidar) => write!(f, "{lidar}={}", self.sensor),
            None => write!(f, "{ALL}={}", self.sensor),
        }
    }
}

/// Gives LiDARs without a name the models of choices; one of a LiDAR goes before one of all.
///
/// # Errors
/// A LiDAR that names another model than the choice for it.
pub fn name_lidars(
    choices: &[SensorChoice],
    placement: &mut Placement,
) -> Result<(), ForeignLidar> {
    let of = |wanted: Option<usize>| choices.iter().rev().find(|choice| choice.lidar == wanted);
    for (lidar, pose) in placement.lidars.iter_mut().enumerate() {
        let own = of(Some(lidar)).map(|choice| choice.sensor);
        if let (false, Some(asked)) = (pose.sensor.is_none(), own.filter(|own| *own != pose.sensor))
        {
            let (placement, named) = (placement.name.clone(), pose.sensor);
            return Err(ForeignLidar::Renamed { placement, lidar, named, asked });
        }
        if pose.sensor.is_none() {
            pose.sensor = own.or(of(None).map(|all| all.sensor)).unwrap_or_default();
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::SensorPose;

    #[test]
    fn choices_name_what_has_no_name_and_replace_nothing() {
        let choice = |text: &str| text.parse::<SensorChoice>().unwrap();
        let name = |name: &str| SensorName::new(name).unwrap();
        let at = |sensor| SensorPose { sensor, ..SensorPose::at(0.0, 0.0, 2.0) };
        let lidars = vec![at(SensorName::NONE), at(name("corner-8")), at(SensorName::NONE)];
        let mut placement = Placement { name: "a".into(), lidars };
        let choices = [choice("all=spin-32"), choice("2=corner=8")];
        name_lidars(&choices, &mut placement).unwrap();
        let named: Vec<_> = placement.lidars.iter().map(|pose| pose.sensor.as_str()).collect();
        assert_eq!(named, ["spin-32", "corner-8", "corner=8"]);
        let words = name_lidars(&[choice("1=spin-32")], &mut placement).unwrap_err().to_string();
        assert!(words.starts_with("placement `a`, LiDAR 1 is a `corner-8`, and"), "{words}");
        assert_eq!(choices.map(|choice| choice.to_string()), ["all=spin-32", "2=corner=8"]);
        for wrong in ["spin-32", "-1=spin-32", "roof=spin-32", "0=", "=spin-32"] {
            assert!(wrong.parse::<SensorChoice>().is_err(), "{wrong}");
        }
    }
}
