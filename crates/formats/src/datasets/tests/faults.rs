//! Faults planted in the files of a good set.

use std::fmt::Display;
use std::path::Path;

/// Plants a fault in the folder of a set.
pub(super) type Spoil = fn(&Path);

pub(super) fn put(folder: &Path, file: &str, bytes: impl AsRef<[u8]>) {
    std::fs::write(folder.join(file), bytes).unwrap();
}

pub(super) fn remove(folder: &Path, file: &str) {
    std::fs::remove_file(folder.join(file)).unwrap();
}

pub(super) fn read_text(folder: &Path, file: &str) -> String {
    std::fs::read_to_string(folder.join(file)).unwrap()
}

/// Checks how the error of reading a spoilt set begins; `DIR` stands for its folder.
pub(super) fn begins<E: Display>(
    folder: &Path,
    spoil: impl Fn(&Path),
    wanted: &str,
    read: impl Fn() -> Result<(), E>,
) {
    spoil(folder);
    let message =
        read().map_or_else(|error| error.to_string(), |()| "nothing is refused".to_owned());
    let message = message.replace(&folder.display().to_string(), "DIR");
    assert!(message.starts_with(wanted), "{message}\n  wanted {wanted}");
}
