//! Errors that name the field they are about, and the decoder that produces them.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// Something is wrong with one field of a document.
///
/// Displays as `transfer_function.points[2].extinction: must be finite and >= 0, got -1`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[error("{}{}{message}", field, if field.is_empty() { "" } else { ": " })]
pub struct FieldError {
    /// Path of the field, for example `lights[1].position`; empty for the document itself.
    pub field: String,
    /// What is wrong and what is expected, as a phrase.
    pub message: String,
}

impl FieldError {
    /// An error about `field`.
    pub fn new(field: impl Into<String>, message: impl Into<String>) -> Self {
        Self { field: field.into(), message: message.into() }
    }
}

/// Separates the inner field path from the message while an error passes through a serde
/// deserializer that knows only strings. No JSON text contains it unescaped.
const NESTED: char = '\u{1}';

/// Decodes a JSON text. Syntax errors give line and column, all others the field.
pub fn from_json<T: DeserializeOwned>(text: &str) -> Result<T, FieldError> {
    let value: serde_json::Value = serde_json::from_str(text)
        .map_err(|error| FieldError::new("", format!("not valid JSON: {error}")))?;
    from_value(value)
}

/// Decodes a JSON value; errors give the field.
pub fn from_value<T: DeserializeOwned>(value: serde_json::Value) -> Result<T, FieldError> {
    serde_path_to_error::deserialize(value).map_err(into_field_error)
}

fn into_field_error(error: serde_path_to_error::Error<serde_json::Error>) -> FieldError {
    let outer = match error.path().to_string() {
        path if path == "." => String::new(),
        path => path,
    };
    let text = error.into_inner().to_string();
    let Some(nested) = text.strip_prefix(NESTED) else {
        return FieldError::new(outer, text);
    };
    let (inner, message) = nested.split_once(NESTED).unwrap_or(("", nested));
    FieldError::new(join(&outer, inner), message)
}

/// Joins two field paths: `lights[1]` and `position` give `lights[1].position`.
fn join(outer: &str, inner: &str) -> String {
    match (outer.is_empty(), inner.is_empty()) {
        (true, _) => inner.to_owned(),
        (_, true) => outer.to_owned(),
        _ if inner.starts_with('[') => format!("{outer}{inner}"),
        _ => format!("{outer}.{inner}"),
    }
}

/// Turns a field error into the string a serde deserializer can carry outwards.
pub(crate) fn nest(error: FieldError) -> String {
    format!("{NESTED}{}{NESTED}{}", error.field, error.message)
}

/// Implements `Deserialize` for an enum of structs told apart by a `"type"` key.
///
/// serde's own internally tagged enums lose the path of a nested error and cannot refuse
/// unknown fields; this keeps both.
macro_rules! tagged_by_type {
    ($name:ident { $($tag:literal => $variant:ident),+ $(,)? }) => {
        impl<'de> serde::Deserialize<'de> for $name {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                use serde::de::Error as _;
                let mut object = serde_json::Map::deserialize(deserializer)?;
                let tag = match object.remove("type") {
                    Some(serde_json::Value::String(tag)) => tag,
                    Some(_) => return Err(D::Error::custom($crate::field::nest(
                        $crate::FieldError::new("type", "must be a string")))),
                    None => return Err(D::Error::custom($crate::field::nest(
                        $crate::FieldError::new("type", concat!("is missing; one of", $(" ", $tag),+))))),
                };
                let value = serde_json::Value::Object(object);
                match tag.as_str() {
                    $($tag => $crate::field::from_value(value).map($name::$variant),)+
                    other => Err($crate::FieldError::new("type",
                        format!(concat!("unknown type `{}`; one of", $(" ", $tag),+), other))),
                }
                .map_err(|error| D::Error::custom($crate::field::nest(error)))
            }
        }
    };
}
pub(crate) use tagged_by_type;
