//! Launch files of static transform publishers in XML, of ROS 1 and ROS 2.

use std::collections::{BTreeSet, HashMap};
use std::fmt::Write;

use roxmltree::Node;
use sightline_files::Note;
use sightline_files::json::{Location, quoted, written};
use sightline_scene::vehicle::SensorPose;

use super::frames::{FrameContent, FrameTree, RigFrame, of_quaternion};
use super::yaml::{missing, number, wrong};
use super::{BASE_LINK, Checked, Mounting, Rig, RigSource, yaml};

/// Program of `tf2_ros` that publishes a transform.
const PUBLISHER: &str = "static_transform_publisher";
/// Known flags, named in the error about an unknown one.
const UNKNOWN_FLAG: &str =
    "--x, --y, --z, --roll, --pitch, --yaw, --qx, --qy, --qz, --qw, --frame-id or --child-frame-id";
/// Flags that take a value. The publisher refuses others.
const FLAGS: [&str; 12] = [
    "--x", "--y", "--z", "--roll", "--pitch", "--yaw", "--qx", "--qy", "--qz", "--qw",
    "--frame-id", "--child-frame-id",
];
/// First of the arguments that a node passes to ROS itself.
const ROS_ARGS: &str = "--ros-args";

/// Longest value of an argument once others are put into it.
const MOST_VALUE: usize = 4096;

/// Reads every publisher of a launch file that its `if` and `unless` leave on.
pub(super) fn read(source: &RigSource, frames: &mut FrameTree) -> Checked<()> {
    let document = yaml::parse(&source.text, &source.file)?;
    let mut launch = Launch {
        file: &source.file,
        values: HashMap::new(),
        before: Vec::new(),
        passed: BTreeSet::new(),
        included: BTreeSet::new(),
        nodes: 0,
    };
    let mut open = vec![LaunchStep::Read(document.root_element())];
    while let Some(step) = open.pop() {
        let node = match step {
            LaunchStep::Read(node) => node,
            LaunchStep::Restore(kept) => {
                launch.restore(kept);
                continue;
            }
        };
        if !launch.is_on(node)? {
            continue;
        }
        match node.tag_name().name() {
            name @ ("launch" | "group") => {
                // Values that a group sets end with it, unless it says otherwise.
                if name == "group" && launch.truth(node, "scoped")?.unwrap_or(true) {
                    open.push(LaunchStep::Restore(launch.before.len()));
                }
                let children: Vec<Node> = node.children().filter(Node::is_element).collect();
                open.extend(children.into_iter().rev().map(LaunchStep::Read));
            }
            "arg" | "let" => launch.argument(node)?,
            "node" | "executable" => {
                if let Some(frame) = launch.node(node)? {
                    frames.add(frame)?;
                }
            }
            // Neither moves a frame.
            "param" | "rosparam" | "remap" | "env" | "set_env" | "unset_env" | "machine"
            | "master" | "test" | "arg_group" => {}
            "include" => launch.include(node)?,
            other => {
                launch.passed.insert(format!("<{other}>"));
            }
        }
    }
    frames.notes.extend(launch.notes());
    Ok(())
}

/// Work that is left of a launch file.
enum LaunchStep<'a, 'i> {
    Read(Node<'a, 'i>),
    /// The end of a group: values that it set end with it. So many were replaced before it.
    Restore(usize),
}

/// A launch file as far as it is read.
struct Launch<'a> {
    file: &'a str,
    /// Values of arguments and variables by name.
    values: HashMap<String, String>,
    /// Names that were set, with the value before, in their order.
    before: Vec<(String, Option<String>)>,
    /// Elements that are not understood.
    passed: BTreeSet<String>,
    included: BTreeSet<String>,
    nodes: usize,
}

impl Launch<'_> {
    /// True if `if` and `unless` leave an element on.
    fn is_on(&self, node: Node) -> Checked<bool> {
        Ok(self.truth(node, "if")?.unwrap_or(true) && !self.truth(node, "unless")?.unwrap_or(false))
    }

    /// Truth of an attribute, if it is there.
    fn truth(&self, node: Node, key: &str) -> Checked<Option<bool>> {
        let at = yaml::place(node, self.file).key(key);
        let odd = |name: &&str| *name != key && name.eq_ignore_ascii_case(key);
        if let Some(odd) = node.attributes().map(|attribute| attribute.name()).find(odd) {
            return Err(wrong(&at, odd, "an attribute in small letters"));
        }
        let Some(text) = node.attribute(key) else { return Ok(None) };
        match self.resolved(text, &at)?.trim().to_lowercase().as_str() {
            "true" | "1" => Ok(Some(true)),
            "false" | "0" => Ok(Some(false)),
            _ => Err(wrong(&at, text, "true, false, or an argument with such a default")),
        }
    }

    /// Keeps the value of an argument: `value`, or the `default`, which counts where nothing has set one before.
    fn argument(&mut self, node: Node) -> Checked<()> {
        let at = yaml::place(node, self.file);
        let is_set = node.attribute("name").is_some_and(|name| self.values.contains_key(name));
        let default = node.attribute("default").filter(|_| !is_set);
        let Some(text) = node.attribute("value").or(default) else {
            return Ok(());
        };
        // One that cannot be told is an error where it is used.
        if let (Some(name), Ok(value)) = (node.attribute("name"), self.resolved(text, &at)) {
            let before = self.values.insert(name.to_owned(), value);
            self.before.push((name.to_owned(), before));
        }
        Ok(())
    }

    /// Takes back all values that were set after the first `kept`.
    fn restore(&mut self, kept: usize) {
        for (name, before) in self.before.drain(kept..).rev() {
            match before {
                Some(value) => self.values.insert(name, value),
                None => self.values.remove(&name),
            };
        }
    }

    /// A text with the values of `$(arg NAME)` and `$(var NAME)` in their places.
    fn resolved(&self, text: &str, at: &Location) -> Checked<String> {
        let (mut done, mut rest) = (String::new(), text);
        while let Some((before, behind)) = rest.split_once("$(") {
            let unknown = || wrong(at, text, "a text whose arguments have a default in this file");
            let (inside, after) = behind.split_once(')').ok_or_else(unknown)?;
            let name = match inside.split_whitespace().collect::<Vec<_>>()[..] {
                ["arg" | "var", name] => name.trim_matches(['\'', '"']),
                _ => return Err(unknown()),
            };
            done += before;
            done += self.values.get(name).ok_or_else(unknown)?;
            rest = after;
            if done.len() > MOST_VALUE {
                return Err(wrong(at, text, "a shorter text"));
            }
        }
        Ok(done + rest)
    }

    /// Keeps the name of an included file, as far as it can be told.
    fn include(&mut self, node: Node) -> Checked<()> {
        let at = yaml::place(node, self.file);
        let name = yaml::attribute(node, "file", &at)?;
        // A package has another path on each machine, so its part stays as written.
        let resolved = self.resolved(name, &at);
        self.included.insert(resolved.unwrap_or_else(|_| name.to_owned()));
        Ok(())
    }

    /// Sentences on skipped parts of the file.
    fn notes(self) -> impl Iterator<Item = Note> {
        let (file, passed) = (self.file, Vec::from_iter(self.passed).join(", "));
        let included = (!self.included.is_empty()).then(|| {
            let names = quoted(self.included);
            format!(
                "{file}: includes {names}, not read; if it places LiDARs, read it beside this one"
            )
        });
        let passed =
            (!passed.is_empty()).then(|| format!("{file}: {passed}: not known here, and not read"));
        included.into_iter().chain(passed).map(Note::fact)
    }

    /// The frame of a node or of an executable that publishes one.
    fn node(&mut self, node: Node) -> Checked<Option<RigFrame>> {
        let tag = node.tag_name().name();
        let at = Location::top(self.file).key(&format!("<{tag}>")).item(self.nodes);
        self.nodes += 1;
        let is_publisher = |word: &str| word.rsplit('/').next() == Some(PUBLISHER);
        let args = if node.has_tag_name("node") {
            if node.attribute("exec").or(node.attribute("type")) != Some(PUBLISHER) {
                return Ok(None);
            }
            yaml::attribute(node, "args", &at)?.to_owned()
        } else {
            // `ros2 run tf2_ros static_transform_publisher`, or its path, and then the arguments.
            let mut words = node.attribute("cmd").unwrap_or_default().split_whitespace();
            if !words.any(is_publisher) {
                return Ok(None);
            }
            words.collect::<Vec<_>>().join(" ")
        };
        let args = self.resolved(&args, &at)?;
        let mut words = shell_words(&args)
            .ok_or_else(|| wrong(&at, &args, "a text whose quotes are closed"))?;
        // `tf` of ROS 1 wants a period in milliseconds behind the two frames.
        let has_period = matches!(words.len(), 9 | 10)
            && words.last().is_some_and(|word| word.parse::<f64>().is_ok())
            && words[words.len() - 3].parse::<f64>().is_err();
        if has_period {
            words.pop();
        }
        publisher(words, at).map(Some)
    }
}

/// Words of arguments as ROS splits them, like a shell: quotes and backslashes are taken off. `None` where a quote is open.
fn shell_words(text: &str) -> Option<Vec<String>> {
    let (mut words, mut word, mut quote) = (Vec::new(), None::<String>, None);
    let mut signs = text.chars();
    while let Some(sign) = signs.next() {
        match (quote, sign) {
            (None, '"' | '\'') => {
                quote = Some(sign);
                word.get_or_insert_default();
            }
            (None, _) if sign.is_whitespace() => words.extend(word.take()),
            (Some(open), _) if sign == open => quote = None,
            (None | Some('"'), '\\') => word.get_or_insert_default().push(signs.next()?),
            _ => word.get_or_insert_default().push(sign),
        }
    }
    words.extend(word);
    quote.is_none().then_some(words)
}

/// A word as [`shell_words`] reads it.
fn shell_quoted(word: &str) -> String {
    match word.contains(['"', '\'', '\\']) {
        true => format!("\"{}\"", word.replace('\\', "\\\\").replace('"', "\\\"")),
        false => word.to_owned(),
    }
}

/// The frame of a publisher's arguments: flags, or `x y z yaw pitch roll PARENT CHILD` as before ROS 2
/// Humble, or that with a quaternion x y z w.
fn publisher(words: Vec<String>, at: Location) -> Checked<RigFrame> {
    let end = words.iter().position(|word| word == ROS_ARGS).unwrap_or(words.len());
    let words = &words[..end];
    let positional: &[&str] = match words.len() {
        8 => &["--x", "--y", "--z", "--yaw", "--pitch", "--roll", "--frame-id", "--child-frame-id"],
        _ => {
            &["--x", "--y", "--z", "--qx", "--qy", "--qz", "--qw", "--frame-id", "--child-frame-id"]
        }
    };
    let has_flags = words.iter().any(|word| FLAGS.contains(&word.as_str()));
    let given: HashMap<&str, &str> = if has_flags {
        let mut given = HashMap::new();
        let mut words = words.iter();
        while let Some(word) = words.next() {
            if let Some(flag) = FLAGS.iter().find(|flag| *flag == word) {
                let value =
                    words.next().ok_or_else(|| wrong(&at, word, "a flag with its value"))?;
                if given.insert(*flag, value.as_str()).is_some() {
                    return Err(wrong(&at, flag, "each flag once"));
                }
            } else {
                return Err(wrong(&at, word, UNKNOWN_FLAG));
            }
        }
        given
    } else if words.len() == positional.len() {
        positional.iter().copied().zip(words.iter().map(String::as_str)).collect()
    } else {
        return Err(wrong(&at, words.join(" "), "a list of flags as --x 1 --frame-id base_link"));
    };
    let frame = |flag: &str| {
        // `tf` of ROS 1 began names with a slash; they are those without.
        let bare = |name: &&str| name.strip_prefix('/').unwrap_or(name).to_owned();
        given.get(flag).map(bare).ok_or_else(|| missing(&at, flag))
    };
    let (name, parent) = (frame("--child-frame-id")?, frame("--frame-id")?);
    Ok(RigFrame { name, parent, pose: pose(&given, &at)?, holds: FrameContent::Unsaid, at })
}

/// Transform from flags; a missing flag is 0; angles and a quaternion exclude each other.
fn pose(given: &HashMap<&str, &str>, at: &Location) -> Checked<SensorPose> {
    let value = |flag: &str, other: f64| match given.get(flag) {
        Some(text) => number(&at.key(flag), text),
        None => Ok(other),
    };
    let (x, y, z) = (value("--x", 0.0)?, value("--y", 0.0)?, value("--z", 0.0)?);
    if ["--qx", "--qy", "--qz", "--qw"].iter().any(|flag| given.contains_key(flag)) {
        let [qx, qy, qz] = ["--qx", "--qy", "--qz"].map(|flag| value(flag, 0.0));
        if let Some(angle) = ["--roll", "--pitch", "--yaw"].iter().find(|a| given.contains_key(*a))
        {
            return Err(wrong(at, angle, "no angle beside a quaternion"));
        }
        return of_quaternion([x, y, z], [qx?, qy?, qz?, value("--qw", 1.0)?], at);
    }
    let [roll, pitch, yaw] = ["--roll", "--pitch", "--yaw"].map(|flag| value(flag, 0.0));
    Ok(SensorPose::from_values([x, y, z, roll?, pitch?, yaw?]))
}

/// A launch file of ROS 2, one publisher a LiDAR.
pub(super) fn write(rig: &Rig, mounting: &Mounting) -> String {
    let mut text = "<launch>\n".to_owned();
    for lidar in &rig.lidars {
        let (foot, _) = mounting.foot(lidar);
        let number = |(key, value)| format!("--{key} {} ", written(value));
        let numbers: String = foot.fields().into_iter().map(number).collect();
        let _ = writeln!(
            text,
            "  <node pkg=\"tf2_ros\" exec=\"{PUBLISHER}\"\n        \
             args=\"{numbers}--frame-id {BASE_LINK} --child-frame-id {}\"/>",
            yaml::escape(&shell_quoted(&lidar.frame))
        );
    }
    text + "</launch>\n"
}
