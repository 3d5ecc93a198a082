//! The little of Python's pickle (protocol 2) that lists of files need: texts, numbers, lists, dictionaries.

use std::io::{Result, Write};

/// A pickle that is being written.
pub(super) struct Pickle<W: Write>(W);

impl<W: Write> Pickle<W> {
    /// Begins with the version.
    pub fn new(mut out: W) -> Result<Self> {
        out.write_all(b"\x80\x02")?;
        Ok(Self(out))
    }

    pub fn text(&mut self, text: &str) -> Result<()> {
        self.0.write_all(b"X")?;
        self.0.write_all(&(text.len() as u32).to_le_bytes())?;
        self.0.write_all(text.as_bytes())
    }

    pub fn number(&mut self, number: i32) -> Result<()> {
        self.0.write_all(b"J")?;
        self.0.write_all(&number.to_le_bytes())
    }

    /// Writes a list with the items of `items`.
    pub fn list(&mut self, items: impl FnOnce(&mut Self) -> Result<()>) -> Result<()> {
        self.0.write_all(b"](")?;
        items(self)?;
        self.0.write_all(b"e")
    }

    /// Writes a dictionary with the pairs of `pairs`: key, value, key, value.
    pub fn dict(&mut self, pairs: impl FnOnce(&mut Self) -> Result<()>) -> Result<()> {
        self.0.write_all(b"}(")?;
        pairs(self)?;
        self.0.write_all(b"u")
    }

    pub fn end(mut self) -> Result<()> {
        self.0.write_all(b".")?;
        self.0.flush()
    }
}
