//! Every reader of outside bytes over its committed seeds and over mutations of them.
//!
//! A fuzzer that needs no fuzzer: seeded, bounded, and on the stable toolchain. `fuzz/` holds the same
//! readers as targets of cargo-fuzz. `SIGHTLINE_FUZZ_MUTATIONS=100000` asks for a longer run,
//! `SIGHTLINE_FUZZ_SEED=2` for another one, and `SIGHTLINE_FUZZ_READER=mesh` for those readers alone.
#![allow(clippy::disallowed_methods)]
#![allow(clippy::unwrap_used)]

#[path = "corpus/mutate.rs"]
mod mutate;
#[path = "../fuzz/readers.rs"]
mod readers;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{LazyLock, Mutex};
use std::time::{Duration, Instant};

use peak_alloc::PeakAlloc;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use mutate::mutated;
use readers::{READERS, Reader};

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Mutations of each reader's seeds in an ordinary run.
const MUTATIONS: u64 = 5000;
/// Mutations after which a long run says how far it is.
const PROGRESS: u64 = 50_000;
/// Memory that a reader may take whatever it reads, in bytes.
const BASE: usize = 1 << 20;
/// Memory that it may take for each byte it is given: an element of two bytes becomes a struct of
/// hundreds, and deflate shrinks a thousandfold.
const PER_BYTE: usize = 2000;
/// Memory for each thing that a count in a scene asks for, in bytes: a box and where it stands.
const PER_COUNT: usize = 4096;
/// Memory that a world may take, however small its map: see the limits in `crates/worlds/src/opendrive.rs`.
const WORLD: usize = 1 << 30;
/// Memory of all commands and options beyond [`BASE`]: the parser of arguments builds them for whatever is typed.
const COMMANDS: usize = 1 << 18;
/// Largest count in a scene that is taken as one.
const LARGEST_COUNT: f64 = 100_000.0;
/// An input that takes longer hangs.
const HANG: Duration = Duration::from_secs(60);

fn setting(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |text| text.parse().unwrap())
}

fn corpus(reader: &Reader) -> Vec<(PathBuf, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(reader.name);
    let mut files: Vec<_> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files.into_iter().map(|path| (path.clone(), std::fs::read(path).unwrap())).collect()
}

/// Bytes that reading may take: what the input holds, and what the counts in a scene ask for.
fn allowed(reader: &Reader, bytes: &[u8]) -> usize {
    let counts: f64 = if ["scene_json", "target_json"].contains(&reader.name) {
        let text = String::from_utf8_lossy(bytes);
        let words = text.split(|c: char| !c.is_ascii_alphanumeric() && !"+-.".contains(c));
        let numbers = words.filter_map(|word| word.parse::<f64>().ok());
        numbers.filter(|n| (1.0..=LARGEST_COUNT).contains(n)).sum()
    } else {
        0.0
    };
    let fixed = match reader.name {
        // Terrain, trees and houses stand along whatever roads a map has.
        "map_xodr" => WORLD,
        "options" => COMMANDS,
        _ => 0,
    };
    BASE + PER_BYTE * bytes.len() + PER_COUNT * counts as usize + fixed
}

/// Ends the process when one input takes too long: a test that hangs tells nothing.
struct Watch {
    /// Milliseconds since the start at which the present input began; 0 when none is read.
    since: AtomicU64,
    start: Instant,
    input: Mutex<Vec<u8>>,
}

static WATCH: LazyLock<Watch> = LazyLock::new(|| {
    std::thread::spawn(|| {
        loop {
            std::thread::sleep(Duration::from_secs(1));
            let since = WATCH.since.load(Ordering::SeqCst);
            let now = WATCH.start.elapsed().as_millis() as u64;
            if since > 0 && now.saturating_sub(since) > HANG.as_millis() as u64 {
                let kept = keep(&WATCH.input.lock().unwrap());
                eprintln!("a reader hangs; its input is {}", kept.display());
                std::process::exit(1);
            }
        }
    });
    Watch { since: AtomicU64::new(0), start: Instant::now(), input: Mutex::default() }
});

/// Writes an input down for whoever looks into it, and says where.
fn keep(bytes: &[u8]) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("corpus-input");
    std::fs::write(&path, bytes).unwrap();
    path
}

/// Reads one input; what went wrong, if anything.
fn attempt(reader: &Reader, folder: &Path, bytes: &[u8]) -> Option<String> {
    bytes.clone_into(&mut WATCH.input.lock().unwrap());
    let now = WATCH.start.elapsed().as_millis() as u64;
    WATCH.since.store(now.max(1), Ordering::SeqCst);
    MEMORY.reset_peak_usage();
    let before = MEMORY.current_usage();
    let outcome = catch_unwind(AssertUnwindSafe(|| (reader.read)(folder, bytes)));
    let took = MEMORY.peak_usage().saturating_sub(before);
    WATCH.since.store(0, Ordering::SeqCst);
    let most = allowed(reader, bytes);
    if outcome.is_err() {
        Some("panics".into())
    } else if took > most {
        Some(format!("takes {took} bytes of memory, {most} are justified"))
    } else {
        None
    }
}

fn planted_faults_are_seen(folder: &Path) {
    let panics = Reader { name: "panics", read: |_, _| panic!("as planned") };
    assert!(attempt(&panics, folder, b"x").unwrap().contains("panics"));
    let read = |_: &Path, bytes: &[u8]| drop(std::hint::black_box(vec![bytes[0]; 8 * BASE]));
    let greedy = Reader { name: "greedy", read };
    assert!(attempt(&greedy, folder, b"x").unwrap().contains("memory"));
}

/// The fuzz targets are not built here; that each reader has one, and nothing else does, is seen anyway.
fn targets_match_the_readers() {
    let fuzz = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz");
    let manifest = std::fs::read_to_string(fuzz.join("Cargo.toml")).unwrap();
    assert_eq!(manifest.matches("[[bin]]").count(), READERS.len());
    assert_eq!(std::fs::read_dir(fuzz.join("fuzz_targets")).unwrap().count(), READERS.len());
    assert_eq!(std::fs::read_dir(fuzz.join("corpus")).unwrap().count(), READERS.len());
    for Reader { name, .. } in READERS {
        assert!(manifest.contains(&format!("path = \"fuzz_targets/{name}.rs\"")), "{name}");
        let target = std::fs::read_to_string(fuzz.join(format!("fuzz_targets/{name}.rs"))).unwrap();
        assert!(target.contains(&format!("readers::{name}(")), "{name}");
    }
}

/// One test, not one for each reader: the memory is that of the process.
#[test]
fn readers_survive_their_corpus_and_its_mutations() {
    let (mutations, seed) =
        (setting("SIGHTLINE_FUZZ_MUTATIONS", MUTATIONS), setting("SIGHTLINE_FUZZ_SEED", 1));
    let folder = readers::folder();
    planted_faults_are_seen(folder.path());
    targets_match_the_readers();
    let wanted = std::env::var("SIGHTLINE_FUZZ_READER").unwrap_or_default();
    let readers = READERS.iter().enumerate().filter(|(_, reader)| reader.name.contains(&wanted));
    assert!(readers.clone().count() > 0, "no reader is called {wanted}");
    for (index, reader) in readers {
        let seeds = corpus(reader);
        assert!(!seeds.is_empty(), "{} has no seeds", reader.name);
        for (path, bytes) in &seeds {
            let fault = attempt(reader, folder.path(), bytes);
            assert_eq!(fault, None, "{} on {}", reader.name, path.display());
        }
        let seeds: Vec<Vec<u8>> = seeds.into_iter().map(|(_, bytes)| bytes).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(index as u64);
        let began = Instant::now();
        for number in 0..mutations {
            if number > 0 && number.is_multiple_of(PROGRESS) {
                eprintln!("{}: {number} mutations in {:.0?}", reader.name, began.elapsed());
            }
            let bytes = mutated(&seeds, &mut rng);
            if let Some(fault) = attempt(reader, folder.path(), &bytes) {
                let kept = keep(&bytes);
                panic!("{}, mutation {number}, {}: {fault}", reader.name, kept.display());
            }
        }
    }
}
