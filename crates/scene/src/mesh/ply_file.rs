//! The grammar of PLY: a header of elements with properties, and a body of text or of bytes.

use super::{MeshFault, Parsed};

/// Scalar types, under both of their names.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum PlyScalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

/// Both names of each type, and the bytes of a number.
const SCALARS: [(PlyScalar, [&str; 2], usize); 8] = [
    (PlyScalar::I8, ["char", "int8"], 1),
    (PlyScalar::U8, ["uchar", "uint8"], 1),
    (PlyScalar::I16, ["short", "int16"], 2),
    (PlyScalar::U16, ["ushort", "uint16"], 2),
    (PlyScalar::I32, ["int", "int32"], 4),
    (PlyScalar::U32, ["uint", "uint32"], 4),
    (PlyScalar::F32, ["float", "float32"], 4),
    (PlyScalar::F64, ["double", "float64"], 8),
];

impl PlyScalar {
    fn of(word: &str) -> Option<Self> {
        SCALARS.iter().find(|(_, names, _)| names.contains(&word)).map(|(kind, ..)| *kind)
    }

    fn size(self) -> usize {
        SCALARS[self as usize].2
    }

    /// Smallest and largest integer of the type; `None` for floating-point numbers.
    fn limits(self) -> Option<[f64; 2]> {
        let bits = 8 * self.size() as i32;
        match self {
            Self::I8 | Self::I16 | Self::I32 => {
                let half = 2_f64.powi(bits - 1);
                Some([-half, half - 1.0])
            }
            Self::U8 | Self::U16 | Self::U32 => Some([0.0, 2_f64.powi(bits) - 1.0]),
            Self::F32 | Self::F64 => None,
        }
    }

    /// Refuses a number of a text that the declared type cannot hold: a label of 300 would be 44 in a binary file.
    fn check(self, value: f64, word: &str) -> Result<(), String> {
        match self.limits() {
            Some([low, high]) if value.fract() != 0.0 || !(low..=high).contains(&value) => {
                let kind = SCALARS[self as usize].1[0];
                Err(format!(
                    "{word:?} is no {kind}, a whole number from {low} to {high}; declare another type in the header"
                ))
            }
            _ => Ok(()),
        }
    }
}

/// A property: a number, or a list of numbers behind their count.
#[derive(Debug)]
pub(super) struct Property {
    pub name: String,
    pub kind: PlyScalar,
    /// Type of the count of a list.
    pub list: Option<PlyScalar>,
}

impl Property {
    /// The property of a header's words behind `property`; `line` is the whole line.
    fn of(words: &[&str], line: &str) -> Result<Self, String> {
        let kind = |word: &str| {
            PlyScalar::of(word).ok_or_else(|| {
                format!("has the unknown type {word:?}; PLY has integers of 8 to 32 bits, float and double, export it so")
            })
        };
        let (name, kind, list) = match *words {
            ["list", count, item, name] => (name, kind(item)?, Some(kind(count)?)),
            [item, name] => (name, kind(item)?, None),
            _ => return Err(format!("{:?} is not a property", line.trim())),
        };
        Ok(Self { name: name.to_owned(), kind, list })
    }
}

/// An element: `count` rows of its properties.
#[derive(Debug)]
pub(super) struct PlyElement {
    pub name: String,
    pub count: u64,
    pub properties: Vec<Property>,
}

impl PlyElement {
    /// Place of a single number among the properties.
    pub(crate) fn scalar(&self, name: &str) -> Option<usize> {
        self.properties.iter().position(|p| p.name == name && p.list.is_none())
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Form {
    Ascii,
    Little,
    Big,
}

impl Form {
    fn of(name: &str) -> Result<Self, String> {
        match name {
            "ascii" => Ok(Self::Ascii),
            "binary_little_endian" => Ok(Self::Little),
            "binary_big_endian" => Ok(Self::Big),
            _ => Err(format!(
                "has the unknown format {name:?}; write ascii, binary_little_endian or binary_big_endian"
            )),
        }
    }
}

#[derive(Debug)]
pub(super) struct PlyHeader {
    pub elements: Vec<PlyElement>,
}

impl PlyHeader {
    /// Reads the header; the body begins behind it. Lines end with LF, CR LF or CR.
    pub(super) fn read(bytes: &[u8]) -> Parsed<(Self, PlyBody<'_>)> {
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        let (mut at, mut line) = (0, 0);
        let (mut form, mut elements) = (None, Vec::<PlyElement>::new());
        let is_end = |b: &u8| matches!(b, b'\n' | b'\r');
        // Where the first line ends with CR alone, a byte 10 behind the last one is data.
        let first = bytes.iter().position(is_end).map_or(&bytes[..0], |end| &bytes[end..]);
        let lone = first.starts_with(b"\r") && !first.starts_with(b"\r\n");
        loop {
            line += 1;
            let fault = |problem: String| MeshFault::new(format!("header line {line}"), problem);
            let rest = &bytes[at..];
            let Some(end) = rest.iter().position(is_end) else {
                return Err(MeshFault::new(
                    "header",
                    "does not end with `end_header`; is this a PLY file?",
                ));
            };
            let text = String::from_utf8_lossy(&rest[..end]).into_owned();
            let wide = if !lone && rest[end..].starts_with(b"\r\n") { 2 } else { 1 };
            at = (at + end + wide).min(bytes.len());
            let words: Vec<&str> = text.split_ascii_whitespace().collect();
            match words[..] {
                ["ply"] if line == 1 => {}
                _ if line == 1 => {
                    return Err(fault("is not `ply`; is this a PLY file?".to_owned()));
                }
                [] | ["comment" | "obj_info", ..] => {}
                ["format", _, version] if version != "1.0" => {
                    return Err(fault(format!("is of version {version:?}; export PLY 1.0")));
                }
                ["format", name, _] => form = Some(Form::of(name).map_err(fault)?),
                ["element", name, count] => {
                    let count = count.parse().map_err(|_| {
                        fault(format!("has the count {count:?}, which is no whole number"))
                    })?;
                    elements.push(PlyElement {
                        name: name.to_owned(),
                        count,
                        properties: Vec::new(),
                    });
                }
                ["property", ref words @ ..] => {
                    let element = elements
                        .last_mut()
                        .ok_or_else(|| fault("has a property before any element".to_owned()))?;
                    element.properties.push(Property::of(words, &text).map_err(fault)?);
                }
                ["end_header"] => break,
                _ => {
                    let start: String = text.trim().chars().take(60).collect();
                    return Err(fault(format!("{start:?} is not known in a header")));
                }
            }
        }
        let form = form.ok_or_else(|| MeshFault::new("header", "names no format"))?;
        let body = PlyBody { form, rest: &bytes[at..], words: b"", line };
        Self { elements }.checked(body)
    }

    /// Refuses names that come twice, and counts that the rest of the file cannot hold.
    fn checked<'a>(self, body: PlyBody<'a>) -> Parsed<(Self, PlyBody<'a>)> {
        let left = body.rest.len() as u64;
        for element in &self.elements {
            let fault = |problem| MeshFault::new(format!("element {}", element.name), problem);
            let mut names: Vec<&str> = element.properties.iter().map(|p| p.name.as_str()).collect();
            names.sort_unstable();
            if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
                return Err(fault(format!("has two properties {:?}", pair[0])));
            }
            if element.properties.is_empty() && element.count > 0 {
                return Err(fault("has rows without properties; leave it out".to_owned()));
            }
            let smallest = |p: &Property| match body.form {
                // One digit and one blank.
                Form::Ascii => 2,
                _ => p.list.unwrap_or(p.kind).size() as u64,
            };
            let need = element.count.saturating_mul(element.properties.iter().map(smallest).sum());
            // + 1: the last line may lack its line feed.
            if need > left + 1 {
                return Err(fault(format!(
                    "{} announced, which take {need} bytes or more, and {left} follow; is the file cut off?",
                    element.count
                )));
            }
        }
        Ok((self, body))
    }
}

/// The rows behind the header, read from front to back.
#[derive(Debug, Clone)]
pub(super) struct PlyBody<'a> {
    form: Form,
    rest: &'a [u8],
    /// Rest of the present line of text.
    words: &'a [u8],
    /// Number of the present line of text, from 1 at the start of the file.
    line: usize,
}

impl<'a> PlyBody<'a> {
    /// Reads a row: `read` takes each property by its index, and reads or passes it.
    pub(super) fn row(
        &mut self,
        element: &PlyElement,
        mut read: impl FnMut(&mut Self, usize, &Property) -> Result<(), String>,
    ) -> Result<(), String> {
        if self.form == Form::Ascii {
            self.words = b"";
            while self.words.is_empty() {
                if self.rest.is_empty() {
                    return Err("is missing: unexpected end of the file".to_owned());
                }
                let end = self
                    .rest
                    .iter()
                    .position(|b| matches!(b, b'\n' | b'\r'))
                    .unwrap_or(self.rest.len());
                let wide = if self.rest[end..].starts_with(b"\r\n") { 2 } else { 1 };
                self.words = self.rest[..end].trim_ascii();
                self.rest = &self.rest[(end + wide).min(self.rest.len())..];
                self.line += 1;
            }
        }
        for (i, property) in element.properties.iter().enumerate() {
            read(self, i, property).map_err(|problem| {
                let line = self.place();
                format!("{problem} (property {}{line})", property.name)
            })?;
        }
        match self.word() {
            Ok(word) if self.form == Form::Ascii => Err(format!(
                "has more values than its element has properties, {word:?} first{}",
                self.place()
            )),
            _ => Ok(()),
        }
    }

    /// The present line of a text, as a message ends with it.
    fn place(&self) -> String {
        match self.form {
            Form::Ascii => format!(", line {}", self.line),
            _ => String::new(),
        }
    }

    /// Passes over all rows of an element.
    pub(super) fn skip(&mut self, element: &PlyElement) -> Parsed<()> {
        let fixed = element.properties.iter().all(|p| p.list.is_none());
        if self.form != Form::Ascii && fixed {
            let row: usize = element.properties.iter().map(|p| p.kind.size()).sum();
            let need = (element.count as usize).saturating_mul(row);
            return match self.take(need) {
                Ok(_) => Ok(()),
                Err(problem) => Err(MeshFault::new(format!("element {}", element.name), problem)),
            };
        }
        for row in 0..element.count {
            self.row(element, |body, _, property| body.pass(property))
                .map_err(|problem| MeshFault::new(format!("{} {row}", element.name), problem))?;
        }
        Ok(())
    }

    /// Refuses data behind the last row: a count in the header is too small then.
    pub(super) fn end(&self) -> Parsed<()> {
        let padding = |b: &u8| *b == 0 || b.is_ascii_whitespace();
        if self.rest.iter().all(padding) {
            return Ok(());
        }
        let problem = format!(
            "has {} bytes behind its last element; are the counts in the header right?",
            self.rest.len()
        );
        Err(MeshFault::new("file", problem))
    }

    fn take(&mut self, size: usize) -> Result<&'a [u8], String> {
        let (taken, rest) =
            self.rest.split_at_checked(size).ok_or("is missing: unexpected end of the file")?;
        self.rest = rest;
        Ok(taken)
    }

    fn word(&mut self) -> Result<&'a str, String> {
        let words = self.words.trim_ascii_start();
        let end = words.iter().position(u8::is_ascii_whitespace).unwrap_or(words.len());
        let word;
        (word, self.words) = words.split_at(end);
        if word.is_empty() {
            return Err("has fewer values than its element has properties".to_owned());
        }
        std::str::from_utf8(word).map_err(|_| "is not text".to_owned())
    }

    pub(super) fn number(&mut self, kind: PlyScalar) -> Result<f64, String> {
        if self.form == Form::Ascii {
            let word = self.word()?;
            let value = word
                .parse()
                .map_err(|_| format!("{word:?} is not a number such as 1.5 or -2e3"))?;
            return kind.check(value, word).map(|()| value);
        }
        let mut bytes = [0; 8];
        let size = kind.size();
        let bytes = &mut bytes[..size];
        bytes.copy_from_slice(self.take(size)?);
        if self.form == Form::Big {
            bytes.reverse();
        }
        let bits = bytes.iter().rev().fold(0_u64, |bits, byte| bits << 8 | u64::from(*byte));
        Ok(match kind {
            PlyScalar::I8 => f64::from(bits as u8 as i8),
            PlyScalar::U8 | PlyScalar::U16 | PlyScalar::U32 => bits as f64,
            PlyScalar::I16 => f64::from(bits as u16 as i16),
            PlyScalar::I32 => f64::from(bits as u32 as i32),
            PlyScalar::F32 => f64::from(f32::from_bits(bits as u32)),
            PlyScalar::F64 => f64::from_bits(bits),
        })
    }

    /// The count of a list, for which there are bytes enough.
    pub(super) fn count(&mut self, kind: PlyScalar) -> Result<usize, String> {
        let count = self.number(kind)?;
        if count.fract() != 0.0 || count < 0.0 {
            return Err(format!(
                "has a list of {count} numbers; write a whole number of 0 or more"
            ));
        }
        let (left, mend) = match self.form {
            Form::Ascii => (self.words.len(), "; write each row on a line of its own"),
            _ => (self.rest.len(), ""),
        };
        if count <= left as f64 {
            return Ok(count as usize);
        }
        Err(format!("has a list of {count} numbers, and {left} bytes follow{mend}"))
    }

    /// Passes over a property, whatever its words are.
    pub(super) fn pass(&mut self, property: &Property) -> Result<(), String> {
        let count = match property.list {
            Some(kind) => self.count(kind)?,
            None => 1,
        };
        if self.form == Form::Ascii {
            return (0..count).try_for_each(|_| self.word().map(drop));
        }
        self.take(count.saturating_mul(property.kind.size())).map(drop)
    }
}
