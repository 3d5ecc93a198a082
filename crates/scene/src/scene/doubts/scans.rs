//! Doubts about the virtual scans of a P-SOG: heights in millimetres, angles in radians.

use std::f64::consts::FRAC_PI_2;

use super::Scene;
use crate::scene::PsogSource;

/// Highest scanner and longest range, in metres.
const HIGHEST: f64 = 100.0;
const FARTHEST: f64 = 1000.0;

/// Doubts about `psog.scan`.
pub(super) fn of_psog(scene: &Scene) -> Vec<String> {
    let PsogSource::Scan(scan) = &scene.psog else { return Vec::new() };
    let mut doubts = Vec::new();
    let metres = [("height", scan.height, HIGHEST), ("range", scan.range, FARTHEST)];
    for (key, value, _) in metres.into_iter().filter(|(_, value, most)| value.abs() > *most) {
        doubts.push(format!(
            "psog.scan.{key} is {value} m; lengths are in metres, {value} mm are {} m",
            value / 1000.0
        ));
    }
    let [low, high] = scan.fov;
    if low.abs().max(high.abs()) <= FRAC_PI_2 && low < high {
        doubts.push(format!(
            "psog.scan.fov is {low}° to {high}°; radians? {low} to {high} rad are {:.1}° to {:.1}°",
            low.to_degrees(),
            high.to_degrees()
        ));
    }
    doubts
}

#[cfg(test)]
mod tests {
    use super::super::Scene;
    use sightline_files::Note;

    fn told(scan: &str) -> String {
        let text = format!(
            r#"{{"sightline": 1, "roi": {{"min": [-20, -20, -0.5], "max": [20, 20, 5.5], "voxel": [0.4, 0.4, 0.4]}},
            "lidar": {{"channels": 4, "fov": [-25, 5], "azimuth_steps": 8, "range": 100}}, "frames": 3,
            "mount": {{"min": [-1, -0.6, 2], "max": [1, 0.6, 2.2], "lidars": 1}}, "psog": {{"scan": {{{scan}}}}},
            "static": [{{"class": "road", "plane": {{"min": [-50, -50], "max": [50, 50], "z": 0}}}}]}}"#
        );
        let scene = Scene::from_json(&text, std::path::Path::new(""), "s.json").unwrap();
        scene.notes().iter().map(Note::text).collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn heights_in_millimetres_and_views_in_radians_are_doubted() {
        assert_eq!(told(r#""height": 2.8, "fov": [-50, 20], "range": 60"#), "");
        let high = told(r#""height": 2000"#);
        assert!(
            high.contains("psog.scan.height is 2000 m; lengths are in metres, 2000 mm are 2 m")
        );
        let narrow = told(r#""fov": [-0.9, 0.35]"#);
        assert!(narrow.contains("psog.scan.fov is -0.9° to 0.35°; radians?"), "{narrow}");
    }
}
