//! Mutations of seeds: blind ones, and ones that know numbers in text and arrays in archives.

use std::io::{Cursor, Read, Write};

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use zip::{CompressionMethod, ZipArchive, ZipWriter, write::FileOptions};

/// Numbers that readers trip over.
const NUMBERS: [&str; 24] = [
    "0", "-0", "-0.0", "1", "-1", "2", "3", "17", "255", "65535", "65536", "100000", "2147483647",
    "2147483648", "4294967295", "4294967296", "18446744073709551615", "18446744073709551616",
    "1e-320", "1e9", "1e38", "1e308", "1e999", "NaN",
];
/// Words that stand in for numbers in binary headers, little and big endian.
const WORDS: [u64; 10] = [
    0,
    1,
    0x7F,
    0xFF,
    0xFFFF,
    0x7FFF_FFFF,
    0xFFFF_FFFF,
    0x7FF0_0000_0000_0000,
    0x7FF8_0000_0000_0001,
    u64::MAX,
];
/// Most bytes of an input.
const LONGEST: usize = 1 << 16;

/// One to four changes of one of the seeds.
pub(crate) fn mutated(seeds: &[Vec<u8>], rng: &mut ChaCha8Rng) -> Vec<u8> {
    let seed = &seeds[rng.random_range(0..seeds.len())];
    let mut bytes = match repacked(seed, rng) {
        Some(bytes) => return bytes,
        None => seed.clone(),
    };
    for _ in 0..rng.random_range(1..=4) {
        change(&mut bytes, seeds, rng);
    }
    bytes.truncate(LONGEST);
    bytes
}

fn change(bytes: &mut Vec<u8>, seeds: &[Vec<u8>], rng: &mut ChaCha8Rng) {
    let place = |rng: &mut ChaCha8Rng, length: usize| rng.random_range(0..=length);
    let at = place(rng, bytes.len());
    let end = (at + rng.random_range(1..=16_usize)).min(bytes.len());
    match rng.random_range(0..9) {
        0 => bytes.truncate(at),
        1 => drop(bytes.drain(at..end)),
        2 => {
            let copy = bytes[at..end].to_vec();
            let to = place(rng, bytes.len());
            bytes.splice(to..to, copy);
        }
        3 => {
            // The head of one seed with the tail of another.
            let other = &seeds[rng.random_range(0..seeds.len())];
            let from = place(rng, other.len());
            bytes.truncate(at);
            bytes.extend_from_slice(&other[from..]);
        }
        4 | 5 => swap_number(bytes, rng),
        6 => {
            let word = WORDS[rng.random_range(0..WORDS.len())];
            let wide = [1, 2, 4, 8][rng.random_range(0..4_usize)];
            let mut word = word.to_le_bytes()[..wide].to_vec();
            if rng.random_bool(0.3) {
                word.reverse();
            }
            let end = (at + wide).min(bytes.len());
            bytes.splice(at..end, word);
        }
        7 => {
            // A line or an element many times over.
            let copy = bytes[at..end].repeat(rng.random_range(1..=200));
            bytes.splice(at..at, copy);
        }
        _ => {
            for _ in 0..rng.random_range(1..=4) {
                if !bytes.is_empty() {
                    let at = rng.random_range(0..bytes.len());
                    bytes[at] ^= 1 << rng.random_range(0..8);
                }
            }
        }
    }
}

/// Puts another number where the text has one.
fn swap_number(bytes: &mut Vec<u8>, rng: &mut ChaCha8Rng) {
    let digit = |b: &u8| b.is_ascii_digit() || b"+-.".contains(b);
    let starts: Vec<usize> = (0..bytes.len())
        .filter(|&i| digit(&bytes[i]) && (i == 0 || !digit(&bytes[i - 1])))
        .collect();
    if starts.is_empty() {
        return;
    }
    let start = starts[rng.random_range(0..starts.len())];
    let length = bytes[start..].iter().take_while(|b| digit(b)).count();
    let number = NUMBERS[rng.random_range(0..NUMBERS.len())].bytes();
    bytes.splice(start..start + length, number);
}

/// The archive with one of its arrays changed and every checksum right; `None` for other files, and
/// now and then for archives, whose own structure is to be changed too.
fn repacked(seed: &[u8], rng: &mut ChaCha8Rng) -> Option<Vec<u8>> {
    if !seed.starts_with(b"PK") || rng.random_bool(0.25) {
        return None;
    }
    let mut archive = ZipArchive::new(Cursor::new(seed)).ok()?;
    let mut members = Vec::new();
    for position in 0..archive.len() {
        let mut member = archive.by_index(position).ok()?;
        let mut bytes = Vec::new();
        member.read_to_end(&mut bytes).ok()?;
        members.push((member.name().to_owned(), bytes));
    }
    let all: Vec<Vec<u8>> = members.iter().map(|(_, bytes)| bytes.clone()).collect();
    for _ in 0..rng.random_range(1..=2) {
        let chosen = rng.random_range(0..members.len());
        change(&mut members[chosen].1, &all, rng);
    }
    let method =
        if rng.random_bool(0.5) { CompressionMethod::Stored } else { CompressionMethod::Deflated };
    let mut out = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in members {
        out.start_file(name, FileOptions::default().compression_method(method)).ok()?;
        out.write_all(&bytes).ok()?;
    }
    Some(out.finish().ok()?.into_inner())
}
