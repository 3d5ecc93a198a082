//! Reading of JSON and YAML descriptions: parsing with places, checks of values, errors as sentences.

pub mod check;
mod foreign;
mod numbers;
mod objects;
mod parse;
mod xml;
mod yaml;

pub use check::{Checked, DescriptionError, Location, did_you_mean};
pub use foreign::{is_utf_16, kind_of_bytes, leading_comment, not_json};
pub use lidar_cast::sensor::nearest;
pub use numbers::{
    Quantity, counted, distinct, fixed, quoted, shortened, spoken, trimmed, written,
};
pub use objects::{Objects, from_text};
pub use parse::{
    FileKind, ForeignJson, UniqueKeys, check_version, comma_too_many, parse, plain_words,
    read_limited, read_text, refuse_comment, refuse_foreign, refuse_own_kinds, stream_text,
    unknown_key, version_1,
};
pub use xml::{check_xml, has_no_prefix, misplaced, plain_names};
pub use yaml::{YamlDocument, parse_documents, parse_yaml};
