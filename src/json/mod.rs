//! Reading of JSON and YAML descriptions: parsing with places, checks of values, errors as sentences.

pub(crate) mod check;
mod error;
mod kind;
mod numbers;
mod parse;
mod place;
mod scalar;
mod xml;
mod yaml;

pub use error::DescriptionError;
pub(crate) use error::did_you_mean;
pub use kind::FileKind;
pub(crate) use numbers::{fixed, shortened, spoken, written};
pub(crate) use parse::{check_version, nearest, parse, plain_words, read_limited, unknown_key};
pub use place::Place;
pub(crate) use scalar::Quantity;
pub(crate) use xml::check_xml;
pub(crate) use yaml::{Document, parse_documents, parse_yaml};
