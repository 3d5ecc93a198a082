//! NumPy arrays of angles, `.npy`: azimuth and elevation of each beam in radians, counter-clockwise.

use npyz::{DType, Deserialize, NpyFile, NpyHeader, Order, TypeChar};

use super::pattern::{Beams, MAX_BEAMS, SensorFormat, SensorPattern, azimuth, direction};
use sightline_files::json::check::{self, bad};
use sightline_files::json::{DescriptionError, Place};
use sightline_files::npy::{read_header, transpose};

/// First bytes of an array.
const MAGIC: &[u8] = b"\x93NUMPY";

/// True if bytes begin with the magic of a NumPy array.
pub(super) fn is_npy(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

pub(super) fn parse(at: &Place, bytes: &[u8]) -> Result<SensorPattern, DescriptionError> {
    let wanted = "an array [N, 2] of float32 or float64, as np.save writes it: azimuth and elevation of each beam \
                  in radians";
    let mut rest = bytes;
    let (header, _) = read_header(&mut rest)
        .map_err(|fault| bad(at, format!("a header where {fault}"), wanted))?;
    let size = match header.dtype() {
        DType::Plain(kind) if kind.type_char() == TypeChar::Float => kind.size_field(),
        _ => 0,
    };
    let &[rows, 2] = header.shape() else {
        return Err(bad(at, format!("an array of shape {:?}", header.shape()), wanted));
    };
    if ![4, 8].contains(&size) {
        return Err(bad(at, format!("an array of {}", header.dtype().descr()), wanted));
    }
    // Cannot overflow: the header's numbers are bounded together.
    if rows == 0 || rows * 2 * size != rest.len() as u64 {
        let found = format!("{} bytes of data", rest.len());
        return Err(bad(at, found, format!("{rows} rows of {} bytes; write it again", 2 * size)));
    }
    if rows > MAX_BEAMS {
        return Err(bad(at, format!("a list of {rows}"), format!("1 to {MAX_BEAMS} beams")));
    }
    let angles = match size {
        4 => angles::<f32>(at, header, rest)?,
        _ => angles::<f64>(at, header, rest)?,
    };
    let directions = angles.chunks_exact(2).enumerate().map(|(i, pair)| {
        let at = at.item(i);
        let across = azimuth(&at, pair[0].to_degrees())?;
        if (2.0..=90.0).contains(&pair[1].abs()) {
            let wanted = "an elevation in radians from -1.5708 to 1.5708: is it in degrees? Write np.radians of it";
            return Err(bad(&at, pair[1], wanted));
        }
        Ok(direction(across, check::elevation(&at, pair[1].to_degrees())?))
    });
    let beams = Beams::Directions(directions.collect::<Result<_, DescriptionError>>()?);
    Ok(SensorPattern::new(SensorFormat::Numpy, beams))
}

/// The numbers row by row, whatever the order of the file.
fn angles<T: Deserialize + Copy + Into<f64>>(
    at: &Place,
    header: NpyHeader,
    data: &[u8],
) -> Result<Vec<f64>, DescriptionError> {
    let order = header.order();
    let numbers = NpyFile::with_header(header, data).into_vec::<T>();
    let numbers = numbers.map_err(|error| bad(at, "the data", format!("readable: {error}")))?;
    let numbers: Vec<f64> = numbers.into_iter().map(Into::into).collect();
    Ok(if order == Order::Fortran { transpose(&numbers, 2) } else { numbers })
}
