//! A grey picture of eight bits a pixel as PNG.

use std::io::Write;

use flate2::write::ZlibEncoder;
use flate2::{Compression, Crc};

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
