//! Triangle soups.

/// Triangles with one semantic class each, in the ego frame or a part's own frame, in metres.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TriangleSoup {
    /// Corner positions `[V]`.
    pub vertices: Vec<[f32; 3]>,
    /// Vertex indices `[F]`; a face's index is its triangle id (`prim`) in a frame, or in a tree.
    pub faces: Vec<[u32; 3]>,
    /// Index into the scene's class names `[F]`.
    pub face_class: Vec<u16>,
}

impl TriangleSoup {
    /// The three corners of face `prim`.
    pub fn corners(&self, prim: u32) -> [[f32; 3]; 3] {
        self.faces[prim as usize].map(|v| self.vertices[v as usize])
    }

    /// Appends every triangle of `other`; its face ids move up by the faces already here.
    pub fn append(&mut self, other: &Self) {
        let base = self.vertices.len() as u32;
        self.vertices.extend_from_slice(&other.vertices);
        self.faces.extend(other.faces.iter().map(|f| f.map(|v| v + base)));
        self.face_class.extend_from_slice(&other.face_class);
    }
}
