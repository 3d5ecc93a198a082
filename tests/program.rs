//! The program as tests run it, and the files that they write for it and read.

use std::fmt::Display;
pub(crate) use std::fs;
use std::io::{Read, Seek, Write};
pub(crate) use std::path::{Path, PathBuf};
pub(crate) use std::process::{Child, Command, ExitStatus, Output, Stdio};
pub(crate) use std::time::{Duration, Instant};

use serde::Serialize;
pub(crate) use serde_json::{Value, json};
pub(crate) use tempfile::TempDir;

/// Words of a command: a list, or a line of words without blanks in them.
pub(crate) trait Words {
    fn words(&self) -> Vec<&str>;
}

impl Words for str {
    fn words(&self) -> Vec<&str> {
        self.split_whitespace().collect()
    }
}

impl Words for String {
    fn words(&self) -> Vec<&str> {
        self.as_str().words()
    }
}

impl Words for [&str] {
    fn words(&self) -> Vec<&str> {
        self.to_vec()
    }
}

impl<const N: usize> Words for [&str; N] {
    fn words(&self) -> Vec<&str> {
        self.to_vec()
    }
}

impl Words for Vec<&str> {
    fn words(&self) -> Vec<&str> {
        self.clone()
    }
}

impl<T: Words + ?Sized> Words for &T {
    fn words(&self) -> Vec<&str> {
        (**self).words()
    }
}

/// Two lists of words, one behind the other.
impl<A: Words, B: Words> Words for (A, B) {
    fn words(&self) -> Vec<&str> {
        [self.0.words(), self.1.words()].concat()
    }
}

impl<A: Words, B: Words, C: Words> Words for (A, B, C) {
    fn words(&self) -> Vec<&str> {
        [self.0.words(), self.1.words(), self.2.words()].concat()
    }
}

/// The program in a folder, with nothing on its standard input.
pub(crate) fn program(dir: impl AsRef<Path>, args: &(impl Words + ?Sized)) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sightline"));
    command.args(args.words()).current_dir(dir).stdin(Stdio::null());
    command
}

pub(crate) fn sightline(dir: impl AsRef<Path>, args: &(impl Words + ?Sized)) -> Output {
    let output = program(dir, args).output().unwrap();
    assert!(!String::from_utf8_lossy(&output.stderr).contains("panicked"), "{output:?}");
    output
}

/// Runs the program with an input that comes through a pipe.
pub(crate) fn piped(dir: impl AsRef<Path>, args: &(impl Words + ?Sized), input: &[u8]) -> Output {
    let mut command = program(dir, args);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    // A program that ends early does not read all of it.
    let _ = child.stdin.take().unwrap().write_all(input);
    child.wait_with_output().unwrap()
}

/// Runs the program in a shell, behind limits or with redirections.
pub(crate) fn shell(dir: impl AsRef<Path>, before: &str, args: &str) -> Output {
    let line = format!("{before} exec '{}' {args}", env!("CARGO_BIN_EXE_sightline"));
    Command::new("sh").args(["-c", &line]).current_dir(dir).output().unwrap()
}

/// An array of an archive that NumPy would read.
pub(crate) fn array<T: npyz::Deserialize>(
    npz: &mut zip::ZipArchive<impl Read + Seek>,
    name: &str,
) -> Vec<T> {
    let member = npz.by_name(&format!("{name}.npy")).unwrap();
    npyz::NpyFile::new(member).unwrap().into_vec().unwrap()
}

/// Exit code, standard output and standard error of a command.
pub(crate) fn ran(
    dir: impl AsRef<Path>,
    args: &(impl Words + ?Sized),
) -> (Option<i32>, [String; 2]) {
    let output = sightline(dir, args);
    let texts = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    (output.status.code(), texts)
}

/// Exit code of a command, its answer as JSON, and its standard error.
pub(crate) fn answer(
    dir: impl AsRef<Path>,
    args: &(impl Words + ?Sized),
) -> (Option<i32>, Value, String) {
    let args = [&args.words()[..], &["--format", "json"]].concat();
    let (code, [stdout, stderr]) = ran(dir, &args);
    let answer = serde_json::from_str(&stdout);
    (code, answer.unwrap_or_else(|e| panic!("{args:?}: {e}: {stdout}{stderr}")), stderr)
}

/// Whether a command succeeded. `score` does, too, where no placement meets the requirements.
fn is_success(words: &[&str], code: Option<i32>, stderr: &str) -> bool {
    let is_unmet = words[0] == "score" && stderr.contains("NOT MET: no placement of ");
    code == Some(i32::from(is_unmet))
}

/// Standard output and standard error of a command that must succeed.
pub(crate) fn printed(dir: impl AsRef<Path>, args: &(impl Words + ?Sized)) -> [String; 2] {
    let (code, [stdout, stderr]) = ran(dir, args);
    let words = args.words();
    assert!(is_success(&words, code, &stderr), "{words:?}: {code:?}: {stderr}");
    [stdout, stderr]
}

/// Standard output of a command that must succeed.
pub(crate) fn stdout(dir: impl AsRef<Path>, args: &(impl Words + ?Sized)) -> String {
    let [stdout, _] = printed(dir, args);
    stdout
}

/// Standard error of a command that must succeed.
pub(crate) fn stderr(dir: impl AsRef<Path>, args: &(impl Words + ?Sized)) -> String {
    let [_, stderr] = printed(dir, args);
    stderr
}

/// The answer of a command that must succeed, asked for as JSON.
pub(crate) fn ok(dir: impl AsRef<Path>, args: &(impl Words + ?Sized)) -> Value {
    let (code, answer, stderr) = answer(dir, args);
    let words = args.words();
    assert!(is_success(&words, code, &stderr), "{words:?}: {code:?}: {stderr}");
    answer
}

/// stderr of a command that must end with exit code 2.
pub(crate) fn fails(dir: impl AsRef<Path>, args: &(impl Words + ?Sized)) -> String {
    let (code, [stdout, stderr]) = ran(dir, args);
    let words = args.words();
    assert!(code == Some(2) && stdout.is_empty(), "{words:?}: {code:?}: {stderr}\n{stdout}");
    stderr
}

/// Values that must be of a type.
pub(crate) trait Typed {
    fn list(&self) -> &Vec<Value>;
    fn number(&self) -> f64;
    fn text(&self) -> &str;
}

impl Typed for Value {
    #[track_caller]
    fn list(&self) -> &Vec<Value> {
        self.as_array().unwrap()
    }

    #[track_caller]
    fn number(&self) -> f64 {
        self.as_f64().unwrap()
    }

    #[track_caller]
    fn text(&self) -> &str {
        self.as_str().unwrap()
    }
}

/// Text that must hold some words and must not hold others; checks can be chained.
pub(crate) trait Says {
    fn says(&self, words: &str) -> &Self;
    fn lacks(&self, words: &str) -> &Self;
}

impl Says for str {
    #[track_caller]
    fn says(&self, words: &str) -> &Self {
        assert!(self.contains(words), "`{self}` lacks `{words}`");
        self
    }

    #[track_caller]
    fn lacks(&self, words: &str) -> &Self {
        assert!(!self.contains(words), "`{self}` has `{words}`");
        self
    }
}

/// The program, running, with nobody who reads what it prints.
pub(crate) fn begun(dir: impl AsRef<Path>, args: &(impl Words + ?Sized)) -> Child {
    let mut command = program(dir, args);
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// Waits for something, a minute at most.
pub(crate) fn wait_for(what: impl Fn() -> bool) {
    let until = Instant::now() + Duration::from_secs(60);
    while !what() {
        assert!(Instant::now() < until, "waited for a minute");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// How a program ends by itself; one that is still there after `most` is killed, and the test fails.
pub(crate) fn end_within(most: Duration, mut child: Child, line: &str) -> ExitStatus {
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        if start.elapsed() > most {
            child.kill().unwrap();
            child.wait().unwrap();
            panic!("{line}: still there after {most:?}");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[cfg(unix)]
pub(crate) fn interrupt(child: &Child, signal: &str) {
    let kill = Command::new("kill").args([signal, &child.id().to_string()]).status();
    assert!(kill.unwrap().success(), "ended before {signal}");
}

/// Writes a document or a text into a file of a folder.
pub(crate) fn write(dir: impl AsRef<Path>, name: &str, text: &(impl Display + ?Sized)) {
    fs::write(dir.as_ref().join(name), text.to_string()).unwrap();
}

/// Writes a file of one placement.
pub(crate) fn write_rig(dir: impl AsRef<Path>, file: &str, name: &str, lidars: impl Serialize) {
    write(dir, file, &json!({ "placements": [{ "name": name, "lidars": lidars }] }));
}

pub(crate) fn read_text(dir: impl AsRef<Path>, name: impl AsRef<Path>) -> String {
    fs::read_to_string(dir.as_ref().join(name)).unwrap()
}

pub(crate) fn read_json(path: impl AsRef<Path>) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

/// Writes a file after a change as another one.
pub(crate) fn change_as(
    dir: impl AsRef<Path>,
    [from, to]: [&str; 2],
    change: impl FnOnce(&mut Value),
) {
    let mut value = read_json(dir.as_ref().join(from));
    change(&mut value);
    write(dir, to, &value);
}

/// Rewrites a file after a change.
pub(crate) fn change(dir: impl AsRef<Path>, name: &str, change: impl FnOnce(&mut Value)) {
    change_as(dir, [name; 2], change);
}

/// Degrees around the vehicle in which the range card of some scores is blind.
pub(crate) fn blind_degrees(scores: &Value) -> f64 {
    let width = |sector: &Value| {
        let [from, to] = [0, 1].map(|k| sector["bearings"][k].as_f64().unwrap());
        if from < to { to - from } else { to - from + 360.0 }
    };
    scores["range_card"]["blind"].as_array().unwrap().iter().map(width).sum()
}

/// Replaces the requirements of the cart in `cart.json`.
pub(crate) fn set_rules(dir: impl AsRef<Path>, rules: Value) {
    change(dir, "cart.json", |cart| cart["require"] = rules);
}
