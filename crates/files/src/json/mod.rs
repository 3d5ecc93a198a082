//! Reading of JSON and YAML descriptions: parsing with places, checks of values, errors as sentences.

pub mod check;
mod error;
mod numbers;
mod parse;
mod scalar;
mod xml;
mod yaml;

pub use error::{DescriptionError, Location, did_you_mean};
pub use lidar_cast::sensor::nearest;
pub use numbers::{fixed, shortened, spoken, written};
pub use parse::{FileKind, check_version, parse, plain_words, read_limited, unknown_key};
pub use scalar::Quantity;
pub use xml::check_xml;
pub use yaml::{YamlDocument, parse_documents, parse_yaml};
