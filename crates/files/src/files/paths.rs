//! Paths: where they lead, names that become files and folders, and references of one file to another.
//!
//! References stay inside the folder of their file unless the user trusts them.

use std::collections::{HashMap, HashSet};
use std::path::{Component, Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use super::FileError;

/// Links that are followed before a path is taken for a loop.
const MOST_LINKS: usize = 40;

/// Where a path leads when links are followed. The links to open files in `/proc` name no place.
pub fn target(path: &Path) -> Result<PathBuf, FileError> {
    let mut at = path.to_owned();
    for _ in 0..MOST_LINKS {
        match std::fs::read_link(&at) {
            Ok(link) if !is_open_file(&at) => at = folder_of(&at).join(link),
            _ => return Ok(at),
        }
    }
    let message = "a loop of symbolic links; name a file";
    Err(FileError::io(path)(std::io::Error::other(message)))
}

/// True if a path is the link to an open pipe or device, or to this program's stdout or stderr, whatever they are. An
/// open plain file is a file like any other: it may be an input.
fn is_open_file(path: &Path) -> bool {
    let Some(owner) = descriptor_of(path) else { return false };
    let is_plain = std::fs::metadata(path).is_ok_and(|meta| meta.is_file());
    !is_plain || (owner == Owner::This && named(path, &["1", "2"]))
}

pub(super) fn is_stdout(path: &Path) -> bool {
    descriptor_of(path) == Some(Owner::This) && named(path, &["1"])
}

fn named(path: &Path, names: &[&str]) -> bool {
    path.file_name().is_some_and(|name| names.iter().any(|known| name == *known))
}

/// Process that has a file open.
#[derive(Debug, PartialEq, Eq)]
enum Owner {
    This,
    Other,
}

/// Process whose open file a path is: `N` in `/dev/fd`, `/proc/PID/fd` or `/proc/PID/task/TID/fd`, however that folder is
/// spelled. Everything else in `/proc` leads to a file or folder, as `/proc/self/cwd/scene.json` does.
fn descriptor_of(path: &Path) -> Option<Owner> {
    let folder = folder_of(path).canonicalize().ok()?;
    if folder == Path::new("/dev/fd") {
        return Some(Owner::This);
    }
    let parts: Vec<&str> = folder.to_str()?.split('/').collect();
    match parts[..] {
        ["", "proc", process, "fd"] | ["", "proc", process, "task", _, "fd"] => {
            let is_own = process.parse() == Ok(std::process::id());
            Some(if is_own { Owner::This } else { Owner::Other })
        }
        _ => None,
    }
}

pub(super) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// True if a path names a pipe or a device, which must not be replaced by a file.
pub fn is_sink(path: &Path) -> bool {
    is_open_file(path)
        || std::fs::metadata(path).is_ok_and(|meta| !meta.is_file() && !meta.is_dir())
}

/// Tells whether references may leave their folder.
static TRUSTED: AtomicBool = AtomicBool::new(false);

/// Lets the files of this process refer to files outside their folders (`--trust-paths`), or forbids it.
pub fn trust_paths(trusted: bool) {
    TRUSTED.store(trusted, Ordering::Relaxed);
}

/// Path of the file that a file in `folder` refers to, `../../secret.bin` for example.
///
/// # Errors
/// The path leaves the folder, by its words or through links, and [`trust_paths`] does not allow it.
pub fn stays_inside(folder: &Path, reference: &str) -> Result<PathBuf, FileError> {
    let path = folder.join(reference);
    if TRUSTED.load(Ordering::Relaxed) || is_inside(folder, reference, &path) {
        return Ok(path);
    }
    Err(FileError::Refused(format!(
        "{reference:?} leaves the folder {}; copy the file into it, or give --trust-paths if you trust the file that \
         refers to it",
        if folder.as_os_str().is_empty() { Path::new(".") } else { folder }.display()
    )))
}

/// Follows links as far as the path exists; a path that does not exist is judged by its words.
fn is_inside(folder: &Path, reference: &str, path: &Path) -> bool {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    match (folder.canonicalize(), path.canonicalize()) {
        (Ok(folder), Ok(path)) => path.starts_with(folder),
        _ => goes_down(Path::new(reference)),
    }
}

/// True if no part of a path is above its start.
fn goes_down(reference: &Path) -> bool {
    let mut depth = 0_i64;
    reference.components().all(|part| {
        depth += match part {
            Component::Normal(_) => 1,
            Component::CurDir => 0,
            Component::ParentDir => -1,
            Component::RootDir | Component::Prefix(_) => return false,
        };
        depth >= 0
    })
}

/// Most bytes of a name, so that endings fit into the 255 of file systems.
const LONGEST: usize = 200;
/// Names that Windows keeps for devices, with any ending.
const DEVICES: [&str; 4] = ["con", "prn", "aux", "nul"];

/// Names of files or folders, each the name of its thing letter for letter, and each once.
#[derive(Debug)]
pub struct FileNames {
    /// Name of each thing, by the name of its file as the file system compares it.
    taken: HashMap<String, String>,
    ignores_case: bool,
    /// Devices have names, with any ending, that no file can have.
    has_devices: bool,
}

impl FileNames {
    /// Takes the name of a thing followed by `ending`, `.npy` for example; without an ending it is the name of a folder.
    ///
    /// # Errors
    /// No file of the system can have the name, or another thing's file has it.
    pub fn take(&mut self, name: &str, ending: &str) -> Result<String, FileError> {
        let file = format!("{name}{ending}");
        let of = if ending.is_empty() { "folder" } else { "file" };
        let is_path = matches!(&*file, "" | "." | "..") || file.contains(['/', '\\', '\0']);
        if is_path || (self.has_devices && (is_device(&file) || file.ends_with('.'))) {
            return Err(FileError::Refused(format!(
                "`{name}`: no {of} can be called `{file}`; rename it"
            )));
        }
        let key = if self.ignores_case { file.to_lowercase() } else { file.clone() };
        match self.taken.insert(key, name.to_owned()) {
            Some(other) => Err(FileError::Refused(format!(
                "`{other}` and `{name}` would share the {of} `{file}`; rename one"
            ))),
            None => Ok(file),
        }
    }
}

impl Default for FileNames {
    /// No name yet, under the rules of this system.
    fn default() -> Self {
        Self {
            taken: HashMap::new(),
            ignores_case: cfg!(any(windows, target_os = "macos")),
            has_devices: cfg!(windows),
        }
    }
}

fn is_device(name: &str) -> bool {
    let stem = name.split('.').next().unwrap_or_default().to_lowercase();
    let is_port = |port: &str| stem.strip_prefix(port).is_some_and(|n| n.len() == 1);
    DEVICES.contains(&&*stem) || is_port("com") || is_port("lpt")
}

/// A name that no file system takes for a path: letters, digits, `-`, `_` and, inside, `.`.
pub fn safe_name(name: &str) -> String {
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    let name: String = name.chars().map(plain).collect();
    let mut name = name.trim_matches('.').to_owned();
    while name.len() > LONGEST {
        name.pop();
    }
    if name.is_empty() || is_device(&name) {
        name.insert(0, '_');
    }
    name
}

/// A safe name for each name. Later ones get a number where they are equal, also but for their case.
pub fn safe_names<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<String> {
    let mut taken = HashSet::new();
    let free = |name: &str| {
        let name = safe_name(name);
        let numbered = (2..).map(|number| format!("{name}-{number}"));
        let mut all = std::iter::once(name.clone()).chain(numbered);
        all.find(|name| taken.insert(name.to_lowercase())).unwrap_or(name)
    };
    names.into_iter().map(free).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn references_stay_inside_by_their_words_and_through_links() {
        let outer = tempfile::tempdir().unwrap();
        let folder = outer.path().join("mesh");
        std::fs::create_dir_all(folder.join("sub")).unwrap();
        for file in ["out.bin", "mesh/in.bin", "mesh/sub/in.bin"] {
            std::fs::write(outer.path().join(file), b"x").unwrap();
        }
        let within = folder.join("in.bin");
        let within = within.to_str().unwrap();
        for right in [
            "in.bin", "./in.bin", "sub/in.bin", "sub/../in.bin", "../mesh/in.bin", "no.bin", within,
        ] {
            assert_eq!(stays_inside(&folder, right).unwrap(), folder.join(right));
        }
        let without = outer.path().join("out.bin");
        let without = without.to_str().unwrap();
        for wrong in ["../out.bin", "sub/../../out.bin", "../no.bin", "/etc/no.bin", without] {
            assert_holds!(stays_inside(&folder, wrong).unwrap_err(), wrong, "--trust-paths");
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(outer.path(), folder.join("link")).unwrap();
            std::os::unix::fs::symlink("../out.bin", folder.join("linked.bin")).unwrap();
            std::os::unix::fs::symlink("sub", folder.join("down")).unwrap();
            assert!(stays_inside(&folder, "down/in.bin").is_ok());
            assert!(stays_inside(&folder, "link/out.bin").is_err());
            assert!(stays_inside(&folder, "linked.bin").is_err());
        }
    }

    #[test]
    fn names_never_leave_their_folder() {
        for (name, safe) in [
            ("highway", "highway"),
            ("a-b_c.d", "a-b_c.d"),
            ("Straße", "Straße"),
            ("../../x", "_.._x"),
            ("/any/where", "_any_where"),
            ("..", "_"),
            (".", "_"),
            ("", "_"),
            (".hidden", "hidden"),
            ("x.", "x"),
            ("nul", "_nul"),
            ("Com1.txt", "_Com1.txt"),
            ("com10", "com10"),
            ("C:\\x\n\0", "C__x__"),
        ] {
            assert_eq!(safe_name(name), safe, "{name:?}");
        }
        let mut names = FileNames::default();
        for name in ["a", ".a", "..", ".", "a.npy"] {
            assert_eq!(names.take(name, ".npy").unwrap(), format!("{name}.npy"));
        }
        let again = names.take("a", ".npy").unwrap_err().to_string();
        assert!(again.contains("`a` and `a` would share the file `a.npy`; rename one"), "{again}");
        for name in ["", ".", "..", "a/b", "a\\b"] {
            let told = names.take(name, "").unwrap_err().to_string();
            assert!(told.contains(&format!("no folder can be called `{name}`")), "{told}");
        }
        // The rules of Windows, and of a system without them.
        for (windows, others) in [(true, 2), (false, 5)] {
            let mut names =
                FileNames { ignores_case: windows, has_devices: windows, ..FileNames::default() };
            let taken = ["CON", "a", "A", "com1", "b"].map(|name| names.take(name, ".npy").is_ok());
            assert_eq!(taken.iter().filter(|taken| **taken).count(), others, "{taken:?}");
        }
        assert!(safe_name(&"é".repeat(500)).len() <= LONGEST);
        assert_eq!(safe_names(["a", "A", "a-2", "..", "."]), ["a", "A-2", "a-2-2", "_", "_-2"]);
    }
}

#[cfg(all(test, target_os = "linux"))]
mod proc_tests {
    use std::os::fd::AsRawFd;

    use super::*;

    #[test]
    fn of_what_proc_holds_only_open_pipes_and_the_own_output_are_no_files() {
        let folder = tempfile::tempdir().expect("a folder");
        let plain = folder.path().join("plain");
        std::fs::write(&plain, "x").expect("a file");
        let open = std::fs::File::open(&plain).expect("the file");
        let null = std::fs::File::open("/dev/null").expect("a device");
        let at = |folder: &str, file: &std::fs::File| format!("{folder}/{}", file.as_raw_fd());
        for fd in [
            "/proc/self/fd",
            "/dev/fd",
            "/proc/thread-self/fd",
            "/proc/self/cwd/../../../../../proc/self/fd",
        ] {
            let (file, device) = (at(fd, &open), at(fd, &null));
            assert_eq!(target(Path::new(&file)).expect("a place"), plain, "{file}");
            assert!(!is_sink(Path::new(&file)) && is_sink(Path::new(&device)), "{fd}");
            assert!(is_stdout(Path::new(&format!("{fd}/1"))), "{fd}");
        }
        let file = format!("/proc/self/root{}", plain.display());
        assert!(!is_sink(Path::new(&file)) && !is_stdout(Path::new("/proc/1/fd/1")));
        assert!(!is_sink(Path::new("/proc/self/cwd/new.json")));
    }
}
