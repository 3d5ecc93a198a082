//! Other ray casters as child processes on the same rays, or why they are missing.

use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use bytemuck::{bytes_of, cast_slice};
use lidar_cast::task::DevicePose;
use sightline::geom::TriangleSoup;
use sightline::vehicle::BeamTable;

/// A scene and its rays in a file, as `benches/embree.c` describes it.
pub(crate) struct Rays {
    folder: tempfile::TempDir,
    path: PathBuf,
}

impl Rays {
    /// Writes the file, which goes when the value does.
    ///
    /// # Errors
    /// The disk is full.
    pub(crate) fn write(
        soup: &TriangleSoup,
        poses: &[DevicePose],
        table: &BeamTable,
    ) -> std::io::Result<Self> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("scene");
        let mut file = BufWriter::new(File::create(&path)?);
        let counts = [soup.vertices.len(), soup.faces.len(), poses.len(), table.directions().len()];
        file.write_all(cast_slice(&counts.map(|n| n as u32)))?;
        file.write_all(bytes_of(&table.range()))?;
        file.write_all(cast_slice(&soup.vertices))?;
        file.write_all(cast_slice(&soup.faces))?;
        for pose in poses {
            file.write_all(bytes_of(&pose.rows))?;
        }
        file.write_all(cast_slice(table.directions()))?;
        file.flush()?;
        Ok(Self { folder, path })
    }
}

/// A running ray caster that holds a scene and its rays.
pub(crate) struct Peer {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

impl Peer {
    /// Compiles `benches/embree.c`, starts it and waits until its tree is built.
    ///
    /// # Errors
    /// In words, why there is no such row.
    pub(crate) fn embree(
        library: Option<&Path>,
        rays: &Rays,
        threads: usize,
    ) -> Result<Self, String> {
        let library = library.ok_or(
            "no --embree LIBRARY given: `pip download embreex --no-deps` and unzip it; the library is \
             embreex.libs/libembree4-*.so.4",
        )?;
        let program = rays.folder.path().join("embree");
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/embree.c");
        let built = Command::new("cc")
            .args(["-O2", "-o"])
            .args([&program, &source])
            .args(["-ldl", "-lpthread"])
            .status()
            .map_err(|e| format!("no C compiler: {e}"))?;
        if !built.success() {
            return Err("cc failed on benches/embree.c".into());
        }
        Self::start(Command::new(&program).arg(library).arg(&rays.path).arg(threads.to_string()))
    }

    /// Starts `benches/peer.py` with one of its packages.
    ///
    /// # Errors
    /// In words, why there is no such row.
    pub(crate) fn python(
        interpreter: Option<&Path>,
        package: &str,
        rays: &Rays,
        threads: usize,
    ) -> Result<Self, String> {
        let interpreter = interpreter.ok_or(
            "no --python INTERPRETER given: `python -m venv peers`, \
             `peers/bin/pip install open3d trimesh embreex`; the interpreter is peers/bin/python",
        )?;
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peer.py");
        Self::start(
            Command::new(interpreter)
                .arg(script)
                .arg(package)
                .arg(&rays.path)
                .arg(threads.to_string()),
        )
    }

    fn start(command: &mut Command) -> Result<Self, String> {
        let child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
        let program = command.get_program().to_string_lossy().into_owned();
        let mut child = child.map_err(|e| format!("{program}: {e}"))?;
        let input = child.stdin.take().ok_or("no pipe")?;
        let output = BufReader::new(child.stdout.take().ok_or("no pipe")?);
        let mut peer = Self { child, input, output };
        // The first pass touches all memory once.
        peer.pass()?;
        Ok(peer)
    }

    /// Seconds for all rays, and how many hit.
    ///
    /// # Errors
    /// The peer's words, where it says something else.
    pub(crate) fn pass(&mut self) -> Result<(f64, u64), String> {
        // A peer that has ended may have said why.
        let _ = writeln!(self.input, "go");
        let mut line = String::new();
        self.output.read_line(&mut line).map_err(|e| e.to_string())?;
        let numbers = line.trim().split_once(' ');
        let numbers = numbers.and_then(|(s, hits)| Some((s.parse().ok()?, hits.parse().ok()?)));
        numbers.ok_or_else(|| match line.trim() {
            "" => "it ended without a word: see the message above".into(),
            said => said.into(),
        })
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
