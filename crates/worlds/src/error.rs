//! Why a world could not be made.

/// Why a world could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WorldError {
    /// The file cannot be read as OpenDRIVE.
    #[error("{file}: {source}; give an OpenDRIVE document with at least one road")]
    OpenDrive {
        /// Name of the file.
        file: String,
        /// Error of the OpenDRIVE reader.
        source: Box<xodr::ImportError>,
    },
    /// The XML is too deep or too wide to be read.
    #[error("{file}: {what}")]
    Xml {
        /// Name of the file.
        file: String,
        /// The line, the limit, and a remedy.
        what: String,
    },
    /// An element of the document that cannot be read.
    #[error("{file}: {place} {what}")]
    Element {
        /// Name of the file.
        file: String,
        /// Line, road or junction, and element.
        place: String,
        /// The fault, and a remedy.
        what: String,
    },
    /// A part of the map that would be missing.
    #[error("{file}: {what}; correct it, or take it out of the map")]
    Part {
        /// Name of the file.
        file: String,
        /// Fault of the part, from the reader.
        what: String,
    },
    /// The file cannot be read at all.
    #[error("{file}: {source}; give an OpenDRIVE file (.xodr)")]
    File {
        /// Name of the file.
        file: String,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A compressed file.
    #[error("{file}: is compressed; unpack it first: gunzip --keep {file}")]
    Compressed {
        /// Name of the file.
        file: String,
    },
    /// No lane in which a vehicle may drive.
    #[error("{file}: has no lane of the type `driving`; the ego vehicle needs one to drive on")]
    NoLane {
        /// Name of the file.
        file: String,
    },
    /// No way long enough for the ego.
    #[error(
        "{file}: no sequence of driving lanes is {wanted:.0} m long, the longest tried has \
         {longest:.0} m; ask for fewer frames or give a larger network"
    )]
    NoWay {
        /// Name of the file.
        file: String,
        /// Metres that the ego drives.
        wanted: f64,
        /// Metres of the longest way tried.
        longest: f64,
    },
    /// More than a world can hold.
    #[error(
        "{file}: the {what} are {value}, a world holds at most {most}; cut a region out of the map, \
         and move it to the origin"
    )]
    TooLarge {
        /// Name of the file.
        file: String,
        /// Quantity that exceeds the limit, in words.
        what: &'static str,
        /// How much there is.
        value: f64,
        /// The limit.
        most: f64,
    },
    /// A file larger than any map.
    #[error("{file}: is larger than {most} MiB; cut a region out of the map")]
    FileTooLarge {
        /// Name of the file.
        file: String,
        /// The limit in MiB.
        most: u64,
    },
}
