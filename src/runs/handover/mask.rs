//! Beams that end at the own body: masks as PNG and lists, and crop boxes around the body.

use std::fmt::Write;
use std::io::Write as _;

use flate2::write::ZlibEncoder;
use flate2::{Compression, Crc};

use super::body_parts::{BoxCorners, around, boxes_of};
use super::rig::HandoverRig;
use crate::csv::{csv, rounded};
use crate::maths;
use crate::vehicle::BeamTable;

/// Decimals of degrees.
const DECIMALS: i32 = 6;
/// Values of a picture: a beam that ends at the own body, any other beam, and no beam.
pub(super) const OWN: u8 = 255;
pub(super) const FREE: u8 = 0;
pub(super) const NONE: u8 = 128;
/// Picture of listed directions: columns and rows of half a degree.
const ACROSS: usize = 720;
const UP: usize = 360;

/// Beams of a LiDAR by whether they end at the own body.
pub(super) struct SelfHitMask<'a> {
    table: &'a BeamTable,
    /// Radians that the sensor is turned about its own axis.
    phase: f64,
    own: &'a [bool],
}

impl<'a> SelfHitMask<'a> {
    pub(crate) fn new(table: &'a BeamTable, phase: f64, own: &'a [bool]) -> Self {
        Self { table, phase, own }
    }

    /// Beams that end at the own body, and all.
    pub(crate) fn counts(&self) -> [usize; 2] {
        [self.own.iter().filter(|own| **own).count(), self.own.len()]
    }

    /// True if the beams are channels and columns.
    pub(crate) fn is_grid(&self) -> bool {
        self.table.grid().is_some()
    }

    /// Azimuth and elevation of each listed beam in degrees, the phase included.
    fn angles(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        self.table.directions().iter().map(|direction| {
            let [x, y, z] = direction.map(f64::from);
            let azimuth = maths::atan2(y, x) + self.phase;
            [azimuth.to_degrees(), maths::atan2(z, maths::hypot(x, y)).to_degrees()]
        })
    }

    /// Channels as rows, columns as columns: 1 where the beam ends at the own body. The first row holds the columns' azimuths;
    /// each row begins with its channel, elevation and azimuth offset. Listed directions are a row each.
    pub(crate) fn csv(&self) -> String {
        let bit = |own: &bool| if *own { "1" } else { "0" }.to_owned();
        let Some(grid) = self.table.grid() else {
            let titles = ["beam", "azimuth_deg", "elevation_deg", "own_body"].map(str::to_owned);
            let rows = self.angles().zip(self.own).enumerate().map(|(k, (angles, own))| {
                let [azimuth, elevation] = angles.map(|angle| rounded(angle, DECIMALS));
                [k.to_string(), azimuth, elevation, bit(own)]
            });
            return csv(std::iter::once(titles).chain(rows));
        };
        let column = |j: usize| {
            let azimuth = grid.start + grid.step * j as f64 + self.phase;
            rounded(azimuth.to_degrees(), DECIMALS)
        };
        let mut titles =
            ["channel", "elevation_deg", "azimuth_offset_deg"].map(str::to_owned).to_vec();
        titles.extend((0..grid.steps).map(column));
        let channels = self.own.chunks(grid.steps).zip(&grid.channels).enumerate();
        let rows = channels.map(|(channel, (own, (elevation, offset)))| {
            let [elevation, offset] =
                [elevation, offset].map(|angle| rounded(angle.to_degrees(), DECIMALS));
            let mut row = vec![channel.to_string(), elevation, offset];
            row.extend(own.iter().map(bit));
            row
        });
        csv(std::iter::once(titles).chain(rows))
    }

    /// The mask as a grey picture, a pixel a beam in the order of the table; listed directions over azimuth from 180° at
    /// the left to −180° and elevation from 90° at the top, half a degree a pixel.
    pub(crate) fn png(&self) -> Vec<u8> {
        let value = |own: bool| if own { OWN } else { FREE };
        if let Some(grid) = self.table.grid() {
            let pixels: Vec<u8> = self.own.iter().map(|own| value(*own)).collect();
            return png(grid.steps, grid.channels.len(), &pixels);
        }
        let mut pixels = vec![NONE; ACROSS * UP];
        for ([azimuth, elevation], own) in self.angles().zip(self.own) {
            let column = ((180.0 - azimuth).rem_euclid(360.0) * 2.0) as usize % ACROSS;
            let row = (((90.0 - elevation) * 2.0) as usize).min(UP - 1);
            let pixel = &mut pixels[row * ACROSS + column];
            *pixel = if *pixel == OWN { OWN } else { value(*own) };
        }
        png(ACROSS, UP, &pixels)
    }
}

/// A node for the box around the whole body, and where the body has several parts one for each: a ROS 2 parameter file.
/// Boxes reach `margin` metres beyond the body and count from `base_link`, whose position in the ego frame is given.
/// `None` without a body.
pub(super) fn boxes(rig: &HandoverRig, margin: f64, base_link: [f64; 3]) -> Option<String> {
    let body = grown(around(rig.body.iter().flatten())?, margin, base_link);
    let mut text = format!(
        "# Crop boxes of the own body of {}, placement {}, for Autoware's crop_box_filter: one node a box.\n\
         # Metres in base_link, which stands at {base_link:?} in the frame of poses.csv; margin {margin} m.\n\
         # negative: true removes the points inside of the box.\n\
         # A cloud that is not in base_link yet: name its frame in input_pointcloud_frame.\n",
        word(rig.vehicle_name()),
        word(&rig.placement.name)
    );
    if let Some(words) = rig.frame_in_words() {
        let _ = writeln!(text, "# {words}");
    }
    node(&mut text, "crop_box_filter_self", &body);
    let parts = boxes_of(&rig.body, rig.scene().body_shapes());
    if parts.len() > 1 {
        text += "\n# The same body part by part: these nodes one after the other, in place of the one above, leave more\n\
                 # of what is near.\n";
        for (k, part) in parts.into_iter().enumerate() {
            let corners = grown(part, margin, base_link);
            node(&mut text, &format!("crop_box_filter_self_{k}"), &corners);
        }
    }
    Some(text)
}

/// A name that cannot end its line.
fn word(name: &str) -> String {
    name.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// Metres that a corner of a body may be off by the rounding of its coordinates to `f32`.
const OF_F32: f64 = 1e-5;

/// A box with a margin around it, counted from elsewhere; corners are rounded outwards to centimetres, so that it holds the
/// body. A centimetre that the body's own `f32` makes is none.
fn grown([low, high]: BoxCorners, margin: f64, base_link: [f64; 3]) -> BoxCorners {
    let out = |value: f64| (100.0 * (value - OF_F32)).ceil() / 100.0;
    [
        [0, 1, 2].map(|k| -out(-(low[k] - margin - base_link[k]))),
        [0, 1, 2].map(|k| out(high[k] + margin - base_link[k])),
    ]
}

fn node(text: &mut String, name: &str, [low, high]: &BoxCorners) {
    let _ = write!(
        text,
        "/**/{name}:\n  ros__parameters:\n    input_pointcloud_frame: base_link\n    input_frame: base_link\n    \
         output_frame: base_link\n"
    );
    for (side, corner) in [("min", low), ("max", high)] {
        for (axis, value) in ["x", "y", "z"].into_iter().zip(corner) {
            // ROS tells a number with a point from a whole one, and wants the former.
            let _ = writeln!(text, "    {side}_{axis}: {:.2}", value + 0.0);
        }
    }
    text.push_str("    negative: true\n");
}

/// A picture of rows from the top, pixels from the left: 0 black, 255 white.
///
/// # Panics
/// If there are not as many pixels as `width` times `height`, or there is none.
pub(super) fn png(width: usize, height: usize, pixels: &[u8]) -> Vec<u8> {
    assert!(width > 0 && pixels.len() == width * height, "{} pixels", pixels.len());
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    let mut packed = Ok(());
    for row in pixels.chunks(width) {
        // Each row begins with its filter: none.
        packed =
            packed.and_then(|()| encoder.write_all(&[0])).and_then(|()| encoder.write_all(row));
    }
    let packed = packed.and_then(|()| encoder.finish()).expect("memory takes any bytes");
    let [wide, high] = [width, height].map(|side| (side as u32).to_be_bytes());
    // Eight bits, grey, and the only methods of packing, filtering and sending that there are.
    let header = [&wide[..], &high, &[8, 0, 0, 0, 0]].concat();
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    chunk(&mut bytes, *b"IHDR", &header);
    chunk(&mut bytes, *b"IDAT", &packed);
    chunk(&mut bytes, *b"IEND", &[]);
    bytes
}

fn chunk(bytes: &mut Vec<u8>, kind: [u8; 4], content: &[u8]) {
    let mut sum = Crc::new();
    sum.update(&kind);
    sum.update(content);
    bytes.extend((content.len() as u32).to_be_bytes());
    bytes.extend(kind);
    bytes.extend(content);
    bytes.extend(sum.sum().to_be_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crop_box_ends_at_the_centimetre_where_the_body_ends_and_holds_every_other_body() {
        let body = |from: f32, to: f32| [[f64::from(from); 3], [f64::from(to); 3]];
        // -9.35 as `f32` lies 0.4 µm below.
        assert_eq!(grown(body(-9.35, 2.7), 0.0, [0.0; 3]), [[-9.35; 3], [2.7; 3]]);
        assert_eq!(grown(body(-9.35, 2.7), 0.05, [1.0; 3]), [[-10.4; 3], [1.75; 3]]);
        for k in 0..200_u8 {
            let end = 0.1 + 0.0637 * f32::from(k);
            let [low, high] = grown(body(-end, end), 0.0, [0.0; 3]);
            let out = high[0] - f64::from(end);
            assert!((-1.1 * OF_F32..0.01).contains(&out) && low[0] == -high[0], "{end}: {high:?}");
        }
    }
}
