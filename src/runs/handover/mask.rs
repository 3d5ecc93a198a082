//! The mask of a LiDAR: its beams that end at the own body, ring by column.

use super::png::png;
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
    pub fn new(table: &'a BeamTable, phase: f64, own: &'a [bool]) -> Self {
        Self { table, phase, own }
    }

    /// Beams that end at the own body, and all.
    pub fn counts(&self) -> [usize; 2] {
        [self.own.iter().filter(|own| **own).count(), self.own.len()]
    }

    /// True if the beams are rings and columns.
    pub fn is_grid(&self) -> bool {
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

    /// Rings as rows, columns as columns: 1 where the beam ends at the own body. The first row holds the columns' azimuths;
    /// each row begins with its ring, elevation and azimuth offset. Listed directions are a row each.
    pub fn csv(&self) -> String {
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
            ["ring", "elevation_deg", "azimuth_offset_deg"].map(str::to_owned).to_vec();
        titles.extend((0..grid.steps).map(column));
        let rings = self.own.chunks(grid.steps).zip(&grid.channels).enumerate();
        let rows = rings.map(|(ring, (own, (elevation, offset)))| {
            let [elevation, offset] =
                [elevation, offset].map(|angle| rounded(angle.to_degrees(), DECIMALS));
            let mut row = vec![ring.to_string(), elevation, offset];
            row.extend(own.iter().map(bit));
            row
        });
        csv(std::iter::once(titles).chain(rows))
    }

    /// The mask as a grey picture, a pixel a beam in the order of the table; listed directions over azimuth from 180° at
    /// the left to −180° and elevation from 90° at the top, half a degree a pixel.
    pub fn png(&self) -> Vec<u8> {
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
