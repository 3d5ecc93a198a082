//! Objects that must be objects: serde reads a list as a struct, by position; here such a list is an error.

use std::fmt;

use serde::de::{
    DeserializeOwned, DeserializeSeed, Deserializer, EnumAccess, Error, MapAccess, SeqAccess,
    Visitor,
};

use super::quoted;

const MOST_NAMED: usize = 6;
/// Words that such an error begins with.
pub(super) const IS_A_LIST: &str = "is a list; ";

/// Reads a whole text as a `T`; a list is no struct.
///
/// # Errors
/// Errors of `serde_json`, and a list where an object belongs.
pub fn from_text<T: DeserializeOwned>(text: &str) -> Result<T, serde_json::Error> {
    let mut json = serde_json::Deserializer::from_str(text);
    let value = T::deserialize(Objects(&mut json))?;
    json.end()?;
    Ok(value)
}

/// Wraps whatever serde reads from, and all that is read inside of it: a list where a struct belongs is
/// an error. Structs in variants of enums are not looked at; no file has any.
pub struct Objects<T>(pub T);

/// Visitor that hands values on; `keys` are the fields of the struct that it reads, if it reads one.
struct Keys<V> {
    of: V,
    keys: Option<&'static [&'static str]>,
}

impl<V> Keys<V> {
    fn any(of: V) -> Self {
        Self { of, keys: None }
    }
}

fn is_a_list<E: Error>(keys: &[&str]) -> E {
    let own = || keys.iter().filter(|key| !key.starts_with('$'));
    let named = quoted(own().take(MOST_NAMED));
    let more = if own().count() > MOST_NAMED { ", …" } else { "" };
    E::custom(format!("{IS_A_LIST}write an object with {named}{more}"))
}

/// Methods that hand the visitor over, wrapped, behind their other arguments.
macro_rules! plain {
    ($($method:ident $(($($of:ident: $kind:ty),*))?;)*) => {$(
        fn $method<V: Visitor<'de>>(self, $($($of: $kind,)*)? visitor: V) -> Result<V::Value, D::Error> {
            self.0.$method($($($of,)*)? Keys::any(visitor))
        }
    )*};
}

impl<'de, D: Deserializer<'de>> Deserializer<'de> for Objects<D> {
    type Error = D::Error;

    plain! {
        deserialize_any; deserialize_bool; deserialize_i8; deserialize_i16; deserialize_i32;
        deserialize_i64; deserialize_i128; deserialize_u8; deserialize_u16; deserialize_u32;
        deserialize_u64; deserialize_u128; deserialize_f32; deserialize_f64; deserialize_char;
        deserialize_str; deserialize_string; deserialize_bytes; deserialize_byte_buf;
        deserialize_option; deserialize_unit; deserialize_seq; deserialize_map;
        deserialize_identifier; deserialize_ignored_any;
        deserialize_unit_struct(name: &'static str);
        deserialize_newtype_struct(name: &'static str);
        deserialize_tuple(length: usize);
        deserialize_tuple_struct(name: &'static str, length: usize);
        deserialize_enum(name: &'static str, variants: &'static [&'static str]);
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, D::Error> {
        self.0.deserialize_struct(name, fields, Keys { of: visitor, keys: Some(fields) })
    }
}

/// Methods that hand over nested values, wrapped.
macro_rules! wrapped {
    ($($method:ident: $kind:ident;)*) => {$(
        fn $method<S: $kind<'de>>(self, from: S) -> Result<V::Value, S::Error> {
            self.of.$method(Objects(from))
        }
    )*};
}

/// Methods that hand a value over as it is.
macro_rules! values {
    ($($method:ident: $kind:ty;)*) => {$(
        fn $method<E: Error>(self, value: $kind) -> Result<V::Value, E> {
            self.of.$method(value)
        }
    )*};
}

impl<'de, V: Visitor<'de>> Visitor<'de> for Keys<V> {
    type Value = V::Value;

    values! {
        visit_bool: bool; visit_i8: i8; visit_i16: i16; visit_i32: i32; visit_i64: i64; visit_i128: i128;
        visit_u8: u8; visit_u16: u16; visit_u32: u32; visit_u64: u64; visit_u128: u128; visit_f32: f32;
        visit_f64: f64; visit_char: char; visit_str: &str; visit_borrowed_str: &'de str; visit_string: String;
        visit_bytes: &[u8]; visit_borrowed_bytes: &'de [u8]; visit_byte_buf: Vec<u8>;
    }

    wrapped! {
        visit_some: Deserializer; visit_newtype_struct: Deserializer; visit_map: MapAccess;
    }

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.of.expecting(f)
    }

    fn visit_none<E: Error>(self) -> Result<V::Value, E> {
        self.of.visit_none()
    }

    fn visit_unit<E: Error>(self) -> Result<V::Value, E> {
        self.of.visit_unit()
    }

    fn visit_enum<A: EnumAccess<'de>>(self, data: A) -> Result<V::Value, A::Error> {
        self.of.visit_enum(data)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<V::Value, A::Error> {
        match self.keys {
            Some(keys) => Err(is_a_list(keys)),
            None => self.of.visit_seq(Objects(list)),
        }
    }
}

impl<'de, S: DeserializeSeed<'de>> DeserializeSeed<'de> for Objects<S> {
    type Value = S::Value;

    fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<S::Value, D::Error> {
        self.0.deserialize(Objects(from))
    }
}

impl<'de, A: SeqAccess<'de>> SeqAccess<'de> for Objects<A> {
    type Error = A::Error;

    fn next_element_seed<S: DeserializeSeed<'de>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, A::Error> {
        self.0.next_element_seed(Objects(seed))
    }
}

impl<'de, A: MapAccess<'de>> MapAccess<'de> for Objects<A> {
    type Error = A::Error;

    fn next_key_seed<S: DeserializeSeed<'de>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, A::Error> {
        self.0.next_key_seed(Objects(seed))
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, A::Error> {
        self.0.next_value_seed(Objects(seed))
    }
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;

    #[derive(Debug, Deserialize, PartialEq)]
    struct Point {
        x: f64,
        y: f64,
    }

    #[derive(Debug, Deserialize, PartialEq)]
    struct All {
        one: Option<Point>,
        #[serde(default)]
        many: Vec<Point>,
        #[serde(default)]
        numbers: [f64; 2],
    }

    #[test]
    fn objects_and_lists_of_numbers_are_read_as_before() {
        let text = r#"{"one": {"x": 1, "y": 2}, "many": [{"y": 4, "x": 3}], "numbers": [5, 6]}"#;
        let read: All = from_text(text).unwrap();
        assert_eq!(read, serde_json::from_str(text).unwrap());
        assert_eq!(from_text::<(f64, Option<Point>)>("[1, null]").unwrap(), (1.0, None));
        assert!(from_text::<f64>("1 2").is_err());
    }

    #[test]
    fn a_list_is_no_struct_wherever_it_stands() {
        for text in
            ["[null, [], [1, 2]]", r#"{"one": [1, 2]}"#, r#"{"many": [{"x": 3, "y": 4}, [1, 2]]}"#]
        {
            serde_json::from_str::<All>(text).unwrap();
            let told = from_text::<All>(text).unwrap_err().to_string();
            assert!(told.starts_with("is a list; write an object with `"), "{text}: {told}");
        }
    }
}
