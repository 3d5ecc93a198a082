//! Colours of classes.

use lidar_cast::maths;

/// Colour of a frustum's lines.
pub(super) const FRUSTUM: [f64; 4] = [0.9, 0.35, 0.02, 0.7];

/// Names and colours (sRGB) of classes that scenes usually have, near those that Cityscapes and CARLA show.
const KNOWN: [(&str, [u8; 3]); 21] = [
    ("building", [112, 112, 118]),
    ("fence", [190, 153, 153]),
    ("other", [85, 90, 100]),
    ("pedestrian", [220, 20, 60]),
    ("pole", [153, 153, 153]),
    ("road_line", [222, 214, 170]),
    ("road", [128, 100, 128]),
    ("sidewalk", [216, 120, 200]),
    ("vegetation", [90, 140, 45]),
    ("vehicle", [35, 80, 190]),
    ("wall", [150, 140, 120]),
    ("traffic_sign", [220, 200, 20]),
    ("ground", [120, 90, 70]),
    ("bridge", [150, 100, 100]),
    ("rail_track", [200, 150, 140]),
    ("guard_rail", [180, 165, 180]),
    ("traffic_light", [250, 170, 30]),
    ("static", [110, 190, 160]),
    ("dynamic", [170, 120, 50]),
    ("water", [45, 60, 150]),
    ("terrain", [145, 190, 120]),
];

/// Colour of a class in linear light, with alpha 1; one of other name has a hue that follows from its letters.
pub(super) fn of_class(name: &str) -> [f64; 4] {
    let known = KNOWN.iter().find(|(known, _)| *known == name);
    let [r, g, b] = known.map_or_else(|| of_letters(name), |&(_, colour)| colour.map(linear));
    [r, g, b, 1.0]
}

/// Light of an sRGB value.
fn linear(value: u8) -> f64 {
    let value = f64::from(value) / 255.0;
    let light =
        if value <= 0.040_45 { value / 12.92 } else { maths::pow((value + 0.055) / 1.055, 2.4) };
    (light * 1e4).round() / 1e4
}

fn of_letters(name: &str) -> [f64; 3] {
    let hue =
        name.bytes().fold(7_u32, |hash, byte| hash.wrapping_mul(31).wrapping_add(byte.into()));
    let hue = f64::from(hue % 360) / 60.0;
    [5.0, 3.0, 1.0].map(|n| {
        let k: f64 = (n + hue) % 6.0;
        let value = 0.8 - 0.55 * k.min(4.0 - k).clamp(0.0, 1.0);
        linear((value * 255.0) as u8)
    })
}
