//! Rows whose fields are watched: those that no reader knows are kept by name.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fmt;
use std::marker::PhantomData;

use serde::de::{Deserialize, DeserializeSeed, Deserializer, Error, MapAccess, Visitor};
use serde::forward_to_deserialize_any;

/// Most unknown names that a table keeps; a table of other things has one a row.
const MOST_KEPT: usize = 8;
/// Most characters of a name that are kept.
const LONGEST: usize = 40;

/// Names of fields that are neither read nor passed over.
#[derive(Default)]
pub(super) struct Unknown {
    names: RefCell<BTreeSet<String>>,
}

impl Unknown {
    fn keep(&self, name: &str) {
        let mut names = self.names.borrow_mut();
        if names.len() < MOST_KEPT {
            names.insert(name.escape_debug().take(LONGEST).collect());
        }
    }

    /// The names in words; `None` where every field is known.
    pub(super) fn in_words(self) -> Option<String> {
        let names = self.names.into_inner();
        let quoted: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
        (!quoted.is_empty()).then(|| quoted.join(", "))
    }
}

/// A deserializer, or a visitor, that looks at the names of a row's fields on their way through.
pub(super) struct Watched<'a, T> {
    pub(super) of: T,
    /// Names that the row's struct reads; empty until the struct names them.
    pub(super) read: &'static [&'static str],
    /// Names that are passed over.
    pub(super) passed: &'static [&'static str],
    pub(super) unknown: &'a Unknown,
}

impl<'a, T> Watched<'a, T> {
    fn around<U>(&self, of: U) -> Watched<'a, U> {
        Watched { of, read: self.read, passed: self.passed, unknown: self.unknown }
    }
}

impl<R> Watched<'_, PhantomData<R>> {
    /// For one more row.
    pub(super) fn again(&self) -> Self {
        Self { of: PhantomData, read: self.read, passed: self.passed, unknown: self.unknown }
    }
}

impl<'de, R: Deserialize<'de>> DeserializeSeed<'de> for Watched<'_, PhantomData<R>> {
    type Value = R;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<R, D::Error> {
        R::deserialize(self.around(deserializer))
    }
}

impl<'de, D: Deserializer<'de>> Deserializer<'de> for Watched<'_, D> {
    type Error = D::Error;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, D::Error> {
        self.of.deserialize_any(visitor)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, D::Error> {
        let visitor = Watched { read: fields, ..self.around(visitor) };
        self.of.deserialize_struct(name, fields, visitor)
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit unit_struct
        newtype_struct seq tuple tuple_struct map enum identifier ignored_any
    }
}

impl<'de, V: Visitor<'de>> Visitor<'de> for Watched<'_, V> {
    type Value = V::Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.of.expecting(f)
    }

    fn visit_map<A: MapAccess<'de>>(self, fields: A) -> Result<V::Value, A::Error> {
        let fields = self.around(fields);
        self.of.visit_map(fields)
    }
}

impl<'de, A: MapAccess<'de>> MapAccess<'de> for Watched<'_, A> {
    type Error = A::Error;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, A::Error> {
        let name = self.around(seed);
        self.of.next_key_seed(Name(name))
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, A::Error> {
        self.of.next_value_seed(seed)
    }
}

/// The name of a field, which goes on to the row's struct.
struct Name<'a, K>(Watched<'a, K>);

impl<'de, K: DeserializeSeed<'de>> DeserializeSeed<'de> for Name<'_, K> {
    type Value = K::Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<K::Value, D::Error> {
        deserializer.deserialize_str(self)
    }
}

impl<'de, K: DeserializeSeed<'de>> Visitor<'de> for Name<'_, K> {
    type Value = K::Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the name of a field")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<K::Value, E> {
        let Watched { of, read, passed, unknown } = self.0;
        if !read.contains(&name) && !passed.contains(&name) {
            unknown.keep(name);
        }
        of.deserialize(serde::de::value::StrDeserializer::new(name))
    }
}
