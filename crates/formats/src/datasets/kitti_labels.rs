//! Label ids of SemanticKITTI and their classes.

use super::PointLabel;

/// The classes of a P-SOG from SemanticKITTI labels: the 19 that its benchmark scores, in its order.
pub const KITTI_CLASSES: [&str; 19] = [
    "car",
    "bicycle",
    "motorcycle",
    "truck",
    "other-vehicle",
    "person",
    "bicyclist",
    "motorcyclist",
    "road",
    "parking",
    "sidewalk",
    "other-ground",
    "building",
    "fence",
    "vegetation",
    "trunk",
    "terrain",
    "pole",
    "traffic-sign",
];

/// The meaning of a label id (the lower 16 bits of a label); `None` for an id that the data set
/// does not define.
///
/// Follows the benchmark's own folding of its 34 ids: buses, trains and trams are other vehicles,
/// lane markings are road, moving things belong to the class of the thing. Unlabelled points, outliers,
/// other structures and other objects do not vote.
pub fn kitti_label(id: u16) -> Option<PointLabel> {
    let class = match id {
        0 | 1 | 52 | 99 => None, // unlabelled, outlier, other structure, other object
        10 | 252 => Some(0),
        11 => Some(1),
        15 => Some(2),
        18 | 258 => Some(3),
        13 | 16 | 20 | 256 | 257 | 259 => Some(4), // bus, on rails, other
        30 | 254 => Some(5),
        31 | 253 => Some(6),
        32 | 255 => Some(7),
        40 | 60 => Some(8), // road, lane marking
        44 => Some(9),
        48 => Some(10),
        49 => Some(11),
        50 => Some(12),
        51 => Some(13),
        70 => Some(14),
        71 => Some(15),
        72 => Some(16),
        80 => Some(17),
        81 => Some(18),
        _ => return None,
    };
    Some(PointLabel { class, moving: id >= 252, on_track: false })
}
