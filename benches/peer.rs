//! Embree as a child process on the same rays, or why it is missing.

use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use bytemuck::{bytes_of, cast_slice};
use sightline::backend::DevicePose;
use sightline::geom::TriangleSoup;
use sightline::placement::BeamTable;

/// A running `benches/embree.c` that holds a scene and its rays.
pub struct Embree {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    _folder: tempfile::TempDir,
}

impl Embree {
    /// Compiles the peer, starts it and waits until its tree is built.
    ///
    /// # Errors
    /// In words, why there is no such row.
    pub fn start(
        library: Option<&Path>,
        soup: &TriangleSoup,
        poses: &[DevicePose],
        table: &BeamTable,
        threads: usize,
    ) -> Result<Self, String> {
        let library = library.ok_or(
            "no --embree LIBRARY given: `pip download embreex --no-deps` and unzip it; the library is \
             embreex.libs/libembree4-*.so.4",
        )?;
        let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
        let (program, data) = (folder.path().join("embree"), folder.path().join("scene"));
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
        write_scene(&data, soup, poses, table).map_err(|e| e.to_string())?;
        let mut child = Command::new(&program)
            .arg(library)
            .arg(&data)
            .arg(threads.to_string())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|e| e.to_string())?;
        let input = child.stdin.take().ok_or("no pipe")?;
        let output = BufReader::new(child.stdout.take().ok_or("no pipe")?);
        let mut embree = Self { child, input, output, _folder: folder };
        // The first pass touches all memory once.
        embree.pass().ok_or("Embree did not start: see the message above")?;
        Ok(embree)
    }

    /// Seconds for all rays, and how many hit.
    pub fn pass(&mut self) -> Option<(f64, u64)> {
        writeln!(self.input, "go").ok()?;
        let mut line = String::new();
        self.output.read_line(&mut line).ok()?;
        let (seconds, hits) = line.trim().split_once(' ')?;
        Some((seconds.parse().ok()?, hits.parse().ok()?))
    }
}

impl Drop for Embree {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn write_scene(
    path: &Path,
    soup: &TriangleSoup,
    poses: &[DevicePose],
    table: &BeamTable,
) -> std::io::Result<()> {
    let mut file = BufWriter::new(File::create(path)?);
    let counts = [soup.vertices.len(), soup.faces.len(), poses.len(), table.directions().len()];
    file.write_all(cast_slice(&counts.map(|n| n as u32)))?;
    file.write_all(bytes_of(&table.range()))?;
    file.write_all(cast_slice(&soup.vertices))?;
    file.write_all(cast_slice(&soup.faces))?;
    for pose in poses {
        file.write_all(bytes_of(&pose.rows))?;
    }
    file.write_all(cast_slice(table.directions()))?;
    file.flush()
}
