//! A `string` field that borrows from its source bytes, for `#[serde(borrow, with = "text")]`.
//!
//! In CDR a string is a byte sequence that ends in NUL. The strings of the CDR crate are copies and silently lose their
//! last character if the NUL is missing.

use std::{borrow::Cow, fmt};

use serde::{
    Deserialize, Deserializer, Serialize, Serializer,
    de::{Error, Visitor},
};

/// A text in a sequence.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub(crate) struct Text<'a>(#[serde(borrow, with = "self")] pub Cow<'a, str>);

impl<'a> From<&'a str> for Text<'a> {
    fn from(text: &'a str) -> Self {
        Self(Cow::Borrowed(text))
    }
}

pub(super) fn serialize<S: Serializer>(text: &str, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(text)
}

pub(super) fn deserialize<'de: 'a, 'a, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Cow<'a, str>, D::Error> {
    deserializer.deserialize_bytes(TextVisitor).map(Cow::Borrowed)
}

struct TextVisitor;

impl<'de> Visitor<'de> for TextVisitor {
    type Value = &'de str;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("text ending in NUL")
    }

    fn visit_borrowed_bytes<E: Error>(self, bytes: &'de [u8]) -> Result<Self::Value, E> {
        let text = match bytes.split_last() {
            // Some writers send an empty string without a NUL.
            None => bytes,
            Some((0, text)) => text,
            Some(_) => {
                return Err(E::custom(format_args!(
                    "string of {} bytes does not end in NUL",
                    bytes.len()
                )));
            }
        };
        std::str::from_utf8(text)
            .map_err(|error| E::custom(format_args!("string is not UTF-8: {error}")))
    }
}
