//! Types that a parameter can have.

use std::{ops::RangeInclusive, path::PathBuf};

use super::{Kind, Value};

/// A type of a field that one parameter sets.
pub trait Setting: Sized {
    /// Range of allowed values; `()` for types without one.
    type Range;

    /// Returns type, range and default of the parameter; `self` is the default.
    fn kind(&self, range: Self::Range) -> Kind;

    /// Converts a value; `None` if it has another type or does not fit.
    fn from_value(value: &Value) -> Option<Self>;
}

impl Setting for bool {
    type Range = ();

    fn kind(&self, (): ()) -> Kind {
        Kind::Bool { default: *self }
    }

    fn from_value(value: &Value) -> Option<Self> {
        match value {
            Value::Bool(value) => Some(*value),
            _ => None,
        }
    }
}

impl Setting for i64 {
    type Range = RangeInclusive<Self>;

    fn kind(&self, range: RangeInclusive<Self>) -> Kind {
        Kind::Integer { default: *self, min: *range.start(), max: *range.end() }
    }

    fn from_value(value: &Value) -> Option<Self> {
        match value {
            Value::Integer(value) => Some(*value),
            _ => None,
        }
    }
}

impl Setting for u32 {
    type Range = RangeInclusive<i64>;

    fn kind(&self, range: RangeInclusive<i64>) -> Kind {
        i64::from(*self).kind(range)
    }

    fn from_value(value: &Value) -> Option<Self> {
        Self::try_from(i64::from_value(value)?).ok()
    }
}

impl Setting for u64 {
    type Range = RangeInclusive<i64>;

    fn kind(&self, range: RangeInclusive<i64>) -> Kind {
        i64::try_from(*self).unwrap_or(i64::MAX).kind(range)
    }

    fn from_value(value: &Value) -> Option<Self> {
        Self::try_from(i64::from_value(value)?).ok()
    }
}

impl Setting for f64 {
    type Range = RangeInclusive<Self>;

    fn kind(&self, range: RangeInclusive<Self>) -> Kind {
        Kind::Float { default: *self, min: *range.start(), max: *range.end() }
    }

    fn from_value(value: &Value) -> Option<Self> {
        match value {
            Value::Float(value) => Some(*value),
            _ => None,
        }
    }
}

/// Types whose zero means "off" as a parameter: `None` in a field of type `Option`.
trait Zero: Copy + PartialEq + Default {}
impl Zero for u32 {}
impl Zero for u64 {}
impl Zero for f64 {}

impl<T: Setting + Zero> Setting for Option<T> {
    type Range = T::Range;

    fn kind(&self, range: T::Range) -> Kind {
        self.unwrap_or_default().kind(range)
    }

    fn from_value(value: &Value) -> Option<Self> {
        T::from_value(value).map(|number| (number != T::default()).then_some(number))
    }
}

/// Empty by default.
impl Setting for String {
    type Range = ();

    fn kind(&self, (): ()) -> Kind {
        Kind::Text { default: "" }
    }

    fn from_value(value: &Value) -> Option<Self> {
        match value {
            Value::Text(text) => Some(text.clone()),
            _ => None,
        }
    }
}

/// The working directory by default.
impl Setting for PathBuf {
    type Range = ();

    fn kind(&self, (): ()) -> Kind {
        Kind::Text { default: "." }
    }

    fn from_value(value: &Value) -> Option<Self> {
        String::from_value(value).map(Self::from)
    }
}

/// No file by default; an empty path as a parameter.
impl Setting for Option<PathBuf> {
    type Range = ();

    fn kind(&self, (): ()) -> Kind {
        Kind::Text { default: "" }
    }

    fn from_value(value: &Value) -> Option<Self> {
        PathBuf::from_value(value).map(|path| (!path.as_os_str().is_empty()).then_some(path))
    }
}
