//! Pages of atlases in a folder, kept between runs.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, SystemTime};

use sha2::{Digest, Sha256};

use crate::problem::Problem;
use crate::vehicle::SensorPose;

/// First bytes of a page's file; the digit counts the formats.
const MAGIC: &[u8; 16] = b"sightline page 1";
/// What decides about the bits a pose covers: other kernels, other pages.
const KERNELS: [&str; 5] = [
    env!("CARGO_PKG_VERSION"),
    include_str!("../../../shaders/common/beam.wgsl"),
    include_str!("../../../shaders/cast_closest.wgsl"),
    include_str!("../../../shaders/cover_voxels.wgsl"),
    include_str!("../../../shaders/cover_voxels.wgsl"),
];
/// Length of a SHA-256.
const HASH: usize = 32;
/// Of zstd: pages are mostly zeros, and the quickest level is near the others.
const COMPRESSION: i32 = 1;
/// How the names of pages end.
const ENDING: &str = "page";
/// How the names of pages that are being written begin.
const UNFINISHED: &str = ".page-";
/// Age from which on a page that is being written was left by a run that died.
const LEFT_BEHIND: Duration = Duration::from_secs(3600);

/// A folder of pages: one file for each sensor pose of each problem, named by a hash of all that the
/// page depends on.
///
/// A file holds the magic, that hash, the words of the page compressed, and a SHA-256 of the lot. What
/// is damaged or foreign is never used. Several runs may share a folder.
#[derive(Debug)]
pub struct PageStore {
    folder: PathBuf,
    limit: u64,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    /// Bytes of pages in the folder, as far as is known.
    bytes: u64,
    report: StoreReport,
}

/// What a store was used for.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct StoreReport {
    /// Pages read.
    pub read: u64,
    /// Pages written.
    pub written: u64,
    /// Pages found damaged or foreign; they are cast again.
    pub spoilt: u64,
    /// Why no more pages are written.
    pub trouble: Option<String>,
}

/// Names a page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PageKey([u8; HASH]);

impl PageStore {
    /// A store in a folder, which is made if need be, of at most about `limit` bytes: the pages used
    /// longest ago go where room is needed.
    ///
    /// # Errors
    /// The folder cannot be made or listed.
    pub fn open(folder: &Path, limit: u64) -> io::Result<Self> {
        fs::create_dir_all(folder)?;
        let store = Self { folder: folder.to_owned(), limit, state: Mutex::new(State::default()) };
        let pages = store.pages()?;
        store.lock().bytes = pages.iter().map(|page| page.1).sum();
        Ok(store)
    }

    /// What it was used for so far.
    pub fn report(&self) -> StoreReport {
        self.lock().report.clone()
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, State> {
        self.state.lock().expect("no thread panics while it holds the lock")
    }

    /// Last use, bytes and path of each page.
    fn pages(&self) -> io::Result<Vec<(SystemTime, u64, PathBuf)>> {
        let mut pages = Vec::new();
        for entry in fs::read_dir(&self.folder)? {
            let path = entry?.path();
            // Another run may have dropped it since.
            let Ok(metadata) = fs::metadata(&path) else { continue };
            let Some(name) = path.file_name().and_then(|name| name.to_str()) else { continue };
            let used = metadata.modified()?;
            if name.starts_with(UNFINISHED) {
                if used.elapsed().is_ok_and(|age| age > LEFT_BEHIND) {
                    let _ = fs::remove_file(&path);
                }
            } else if PageKey::is_name(name) {
                pages.push((used, metadata.len(), path));
            }
        }
        Ok(pages)
    }

    fn path(&self, key: &PageKey) -> PathBuf {
        self.folder.join(key.name())
    }

    /// The `words` words of a page; `None` where there is none that can be trusted.
    pub(super) fn read(&self, key: &PageKey, words: usize) -> Option<Vec<u64>> {
        let path = self.path(key);
        let bytes = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) => {
                self.lock().report.spoilt += u64::from(error.kind() != io::ErrorKind::NotFound);
                return None;
            }
        };
        let page = decode(&bytes, key, words);
        let mut state = self.lock();
        if page.is_some() {
            state.report.read += 1;
            // The time of change tells when a page was used last.
            let now = SystemTime::now();
            let _ = File::options().append(true).open(&path).and_then(|f| f.set_modified(now));
        } else {
            state.report.spoilt += 1;
        }
        page
    }

    /// Notes that a page that was read is not what its pose covers.
    pub(super) fn is_wrong(&self) {
        self.lock().report.spoilt += 1;
    }

    /// Keeps a page. After the first one that cannot be written no more are.
    pub(super) fn write(&self, key: &PageKey, page: &[u64]) {
        if self.lock().report.trouble.is_some() {
            return;
        }
        let written = encode(page, key).and_then(|bytes| {
            let mut file = tempfile::Builder::new().prefix(UNFINISHED).tempfile_in(&self.folder)?;
            file.write_all(&bytes)?;
            file.persist(self.path(key)).map_err(|error| error.error)?;
            Ok(bytes.len() as u64)
        });
        let mut state = self.lock();
        let trimmed = written.and_then(|bytes| {
            state.report.written += 1;
            state.bytes += bytes;
            if state.bytes > self.limit {
                state.bytes = self.trim()?;
            }
            Ok(())
        });
        self.note_trouble(&mut state, trimmed);
    }

    /// Brings a folder that holds more than the limit below it, be there anything new to keep or not.
    pub fn shrink(&self) {
        let mut state = self.lock();
        if state.bytes > self.limit {
            let trimmed = self.trim().map(|bytes| state.bytes = bytes);
            self.note_trouble(&mut state, trimmed);
        }
    }

    fn note_trouble(&self, state: &mut State, done: io::Result<()>) {
        if let Err(error) = done {
            state.report.trouble.get_or_insert(format!("{}: {error}", self.folder.display()));
        }
    }

    /// Drops the pages used longest ago until the rest takes nine tenths of the limit; its bytes.
    fn trim(&self) -> io::Result<u64> {
        let mut pages = self.pages()?;
        pages.sort();
        let mut left: u64 = pages.iter().map(|page| page.1).sum();
        for (_, bytes, path) in pages {
            if left <= self.limit / 10 * 9 {
                break;
            }
            match fs::remove_file(&path) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                _ => left -= bytes,
            }
        }
        Ok(left)
    }
}

impl PageKey {
    /// Of a pose, where `problem` is of [`hash_of`].
    pub fn new(problem: &[u8; HASH], pose: &SensorPose) -> Self {
        let mut hash = Sha256::new_with_prefix(problem);
        for (_, value) in pose.fields() {
            hash.update(value.to_le_bytes());
        }
        Self(hash.finalize().into())
    }

    fn name(&self) -> String {
        let hex: String = self.0.iter().map(|byte| format!("{byte:02x}")).collect();
        format!("{hex}.{ENDING}")
    }

    fn is_name(name: &str) -> bool {
        let Some((stem, ENDING)) = name.split_once('.') else { return false };
        stem.len() == 2 * HASH && stem.bytes().all(|b| b.is_ascii_hexdigit())
    }
}

/// A hash of everything but the pose that pages of a problem depend on; `all_words` is the size of a
/// bitmap of all voxels in them.
pub(super) fn hash_of(problem: &Problem, all_words: usize) -> [u8; HASH] {
    let mut hash = Sha256::new_with_prefix(MAGIC);
    for text in KERNELS {
        hash.update((text.len() as u64).to_le_bytes());
        hash.update(text);
    }
    let roi = problem.roi();
    for value in [roi.min(), roi.voxel()].as_flattened() {
        hash.update(value.to_le_bytes());
    }
    for count in roi.shape() {
        hash.update(count.to_le_bytes());
    }
    let occupied = problem.content().occupied();
    hash.update((occupied.len() as u64).to_le_bytes());
    for voxel in occupied {
        hash.update(bytemuck::bytes_of(&[
            voxel.index,
            voxel.entropy[0],
            voxel.entropy[1],
            voxel.entropy[2],
        ]));
    }
    let directions = problem.table().directions();
    hash.update((directions.len() as u64).to_le_bytes());
    hash.update(bytemuck::cast_slice::<[f32; 3], u8>(directions));
    hash.update(problem.table().range().to_le_bytes());
    hash.update((all_words as u64).to_le_bytes());
    if problem.ends_at_hits() {
        for tree in (0..problem.frame_count()).filter_map(|frame| problem.geometry(frame)) {
            hash.update((tree.triangles.len() as u64).to_le_bytes());
            hash.update(bytemuck::cast_slice::<_, u8>(&tree.triangles));
            hash.update(tree.pad.to_le_bytes());
        }
    }
    hash.finalize().into()
}

fn encode(page: &[u64], key: &PageKey) -> io::Result<Vec<u8>> {
    let words: Vec<u8> = page.iter().flat_map(|word| word.to_le_bytes()).collect();
    let mut bytes = [&MAGIC[..], &key.0].concat();
    bytes.extend(zstd::bulk::compress(&words, COMPRESSION)?);
    let hash = Sha256::digest(&bytes);
    bytes.extend(hash);
    Ok(bytes)
}

/// The words of a page's file, unless anything about it is not as [`encode`] wrote it.
fn decode(bytes: &[u8], key: &PageKey, words: usize) -> Option<Vec<u64>> {
    let (content, hash) = bytes.split_at_checked(bytes.len().checked_sub(HASH)?)?;
    if Sha256::digest(content)[..] != *hash {
        return None;
    }
    let compressed = content.strip_prefix(MAGIC)?.strip_prefix(&key.0)?;
    let bytes = zstd::bulk::decompress(compressed, 8 * words).ok()?;
    let page: Vec<u64> = bytes
        .chunks_exact(8)
        .map(|w| u64::from_le_bytes([0, 1, 2, 3, 4, 5, 6, 7].map(|i| w[i])))
        .collect();
    (page.len() == words && bytes.len() == 8 * words).then_some(page)
}
