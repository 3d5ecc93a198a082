//! Wavefront OBJ, without its material library: classes hang on the names in `usemtl`.

use std::cell::Cell;
use std::collections::HashSet;
use std::io::{BufRead, BufReader, Read};

use glam::DVec3;

use super::raw::{Fault, RawMesh};

/// Reads an OBJ; polygons become fans, points and lines are left out.
pub(super) fn read(bytes: &[u8]) -> Result<RawMesh, Fault> {
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let line = 1 + bytes[..e.valid_up_to()].iter().filter(|&&b| b == b'\n').count();
        Fault::new(format!("line {line}"), "is not text; is this an OBJ file?")
    })?;
    // tobj knows materials of a library alone: it gets one made of the names in `usemtl`, and .mtl files
    // may be missing.
    let (text, names) = strip(text)?;
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..Default::default()
    };
    let library = "mtllib names-in-use\n".as_bytes();
    let lines = Cell::new(0);
    let mut reader =
        CountLines { inner: BufReader::new(library.chain(text.as_bytes())), lines: &lines };
    let given = Cell::new(false);
    let (models, materials) = tobj::load_obj_buf(&mut reader, &options, |_| {
        let list = if given.replace(true) { &[][..] } else { &names[..] };
        let material = |name: &String| tobj::Material { name: name.clone(), ..Default::default() };
        let index = list.iter().enumerate().map(|(i, n)| (n.clone(), i)).collect();
        Ok((list.iter().map(material).collect(), index))
    })
    // Without the `mtllib` line in front.
    .map_err(|e| Fault::new(format!("line {}", lines.get().max(2) - 1), e.to_string()))?;
    let materials = materials.unwrap_or_default();
    let mut mesh = RawMesh::default();
    for model in &models {
        let base = mesh.vertices.len() as u32;
        let name = model.mesh.material_id.and_then(|id| materials.get(id)).map(|m| m.name.as_str());
        let faces = model.mesh.indices.chunks_exact(3);
        if faces.len() == 0 {
            continue;
        }
        let material = mesh.material(name);
        mesh.face_material.extend(std::iter::repeat_n(material, faces.len()));
        mesh.faces.extend(faces.map(|f| [f[0] + base, f[1] + base, f[2] + base]));
        let points = model.mesh.positions.chunks_exact(3);
        mesh.vertices.extend(points.map(|p| DVec3::new(p[0], p[1], p[2])));
    }
    Ok(mesh)
}

/// Reduces the text to positions, faces and materials, each on its line, and lists the materials.
///
/// Refuses positions that are not finite and faces out of range. Faces keep their position indices
/// alone: tobj relies on small indices of texture coordinates, which are not used here.
fn strip(text: &str) -> Result<(String, Vec<String>), Fault> {
    let is_vertex = |l: &&str| l.split_whitespace().next() == Some("v");
    let total = text.lines().filter(is_vertex).count() as i64;
    let mut so_far = 0;
    let (mut names, mut seen) = (Vec::new(), HashSet::new());
    let mut kept = String::with_capacity(text.len());
    for (i, line) in text.lines().enumerate() {
        let fault = |problem| Fault::new(format!("line {}", i + 1), problem);
        let mut words = line.split_whitespace();
        match words.next() {
            Some("usemtl") => {
                let name = line.trim_start()["usemtl".len()..].trim();
                if seen.insert(name) {
                    names.push(name.to_owned());
                }
                kept.push_str(line);
            }
            Some("v") => {
                so_far += 1;
                let finite = |w: &str| w.parse::<f64>().map_or(true, f64::is_finite);
                if let Some(word) = words.find(|w| !finite(w)) {
                    return Err(fault(format!("{word} is not a finite coordinate")));
                }
                kept.push_str(line);
            }
            Some("f") => {
                kept.push('f');
                for word in words {
                    let first = word.split('/').next().unwrap_or_default();
                    let Ok(index) = first.parse::<i64>() else {
                        return Err(fault(format!("{word} is not a vertex of a face")));
                    };
                    let place = if index < 0 { index.saturating_add(so_far + 1) } else { index };
                    if place < 1 || place > total {
                        let problem = format!("refers to vertex {index}, there are {total}");
                        return Err(fault(problem));
                    }
                    kept.push(' ');
                    kept.push_str(&place.to_string());
                }
            }
            _ => {}
        }
        kept.push('\n');
    }
    Ok((kept, names))
}

/// Reader that counts its lines, for the place of an error.
struct CountLines<'a, R> {
    inner: R,
    lines: &'a Cell<usize>,
}

impl<R: BufRead> Read for CountLines<'_, R> {
    fn read(&mut self, buf: &mut [u8]) -> std::io::Result<usize> {
        self.inner.read(buf)
    }
}

impl<R: BufRead> BufRead for CountLines<'_, R> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        self.inner.fill_buf()
    }

    fn consume(&mut self, n: usize) {
        self.inner.consume(n);
    }

    fn read_line(&mut self, line: &mut String) -> std::io::Result<usize> {
        self.lines.set(self.lines.get() + 1);
        self.inner.read_line(line)
    }
}
