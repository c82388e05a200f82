//! Settings. Each is one entry of a `settings!` table: field, unit, default, range and text. The table declares the
//! structs, checks the ranges and describes the fields; the binding reads Python's records by it, and
//! `crates/python/settings.py` writes those records and docs/reference/settings.md from it.

use std::f64::consts::{PI, TAU};

use crate::error::{Error, Result};

/// Values that a setting may have, as numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Least value.
    pub min: f64,
    /// Largest value; infinity is a value.
    pub max: f64,
    /// The least value itself is excluded.
    pub above: bool,
}

/// More than zero, at most `max`.
pub const fn positive(max: f64) -> Range {
    Range { min: 0.0, max, above: true }
}

/// From `min` to `max`, both included.
pub const fn between(min: f64, max: f64) -> Range {
    Range { min, max, above: false }
}

/// Any value.
pub const ANY: Range = between(f64::NEG_INFINITY, f64::INFINITY);

/// Zero or more, but a number.
pub const NOT_NEGATIVE: Range = between(0.0, f64::MAX);

impl Range {
    /// Description of the allowed values; empty if all are allowed.
    pub fn text(self) -> String {
        let Self { min, max, above } = self;
        let shown = number(max);
        match (min, max) {
            (f64::NEG_INFINITY, _) => String::new(),
            (0.0, f64::MAX..) if above => "positive".into(),
            (0.0, _) if above => format!("positive and at most {shown}"),
            (0.0, f64::MAX..) => "not negative".into(),
            _ => format!("between {min} and {shown}"),
        }
    }

    fn check(self, value: f64) -> std::result::Result<(), String> {
        if self.min <= value && value <= self.max && !(self.above && value == self.min) {
            Ok(())
        } else if self == NOT_NEGATIVE {
            Err(format!("must not be negative, is {value:?}"))
        } else if self.above && value > self.max {
            Err(format!("must be at most {}, not {value:?}", number(self.max)))
        } else {
            Err(format!("must be {}, not {value:?}", self.text()))
        }
    }
}

/// A bound as text.
fn number(bound: f64) -> String {
    match bound {
        PI => "pi".into(),
        TAU => "2 pi".into(),
        _ => bound.to_string(),
    }
}

/// The entry of a setting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Field {
    /// Its name; empty for a record whose fields count as the outer record's own.
    pub name: &'static str,
    /// Its unit; empty if it has none.
    pub unit: &'static str,
    /// Its meaning, as lines.
    pub text: &'static str,
    /// Its range.
    pub range: Range,
}

/// The value of a field.
#[derive(Debug)]
pub enum Value<'a> {
    /// A number.
    Number(&'a mut f64),
    /// A whole number.
    Count(&'a mut usize),
    /// Yes or no.
    Flag(&'a mut bool),
    /// One of several words.
    Choice(&'a mut dyn Choice),
    /// Settings of their own.
    Record(&'a mut dyn Record),
}

/// One of several words, declared by `choice!`.
pub trait Choice: std::fmt::Debug {
    /// All words.
    fn words(&self) -> &'static [&'static str];
    /// Its own.
    fn word(&self) -> &'static str;
    /// Changes to another word; says whether there is such a word.
    fn choose(&mut self, word: &str) -> bool;
}

/// A struct of settings, declared by `settings!`.
pub trait Record: std::fmt::Debug {
    /// Name in Python, and text as lines.
    fn about(&self) -> (&'static str, &'static str);
    /// All fields with their values, in the order of the table.
    fn fields(&mut self) -> Vec<(Field, Value<'_>)>;
    /// Checks what one setting demands of another.
    ///
    /// # Errors
    /// `Setting` with the name of the field.
    fn relations(&self) -> Result<()>;
}

/// What a field can be.
pub(crate) trait AsValue {
    fn as_value(&mut self) -> Value<'_>;
}

impl AsValue for f64 {
    fn as_value(&mut self) -> Value<'_> {
        Value::Number(self)
    }
}

impl AsValue for usize {
    fn as_value(&mut self) -> Value<'_> {
        Value::Count(self)
    }
}

impl AsValue for bool {
    fn as_value(&mut self) -> Value<'_> {
        Value::Flag(self)
    }
}

impl<T: Record> AsValue for T {
    fn as_value(&mut self) -> Value<'_> {
        Value::Record(self)
    }
}

/// Checks all fields of a record and of those in it.
///
/// # Errors
/// `Setting` with the dotted name of the field.
pub fn check(record: &mut dyn Record) -> Result<()> {
    for (field, value) in record.fields() {
        let refused = |message: String| Error::Setting { name: field.name.to_owned(), message };
        match value {
            Value::Number(value) => field.range.check(*value).map_err(refused)?,
            Value::Count(value) if *value as f64 > field.range.max || (*value as f64) < field.range.min => {
                let Range { min, max, .. } = field.range;
                return Err(refused(format!("must be {min} to {max}, not {value}")));
            }
            Value::Count(_) | Value::Flag(_) | Value::Choice(_) => {}
            Value::Record(inner) => check(inner).map_err(|error| match error {
                Error::Setting { name, message } if !field.name.is_empty() => {
                    Error::Setting { name: format!("{}.{name}", field.name), message }
                }
                error => error,
            })?,
        }
    }
    record.relations()
}

/// Declares an enum of words; the first one is the default.
macro_rules! choice {
    (
        $(#[$about:meta])*
        pub enum $name:ident {
            $(#[$about_first:meta])* $first:ident = $word:literal,
            $($(#[$about_other:meta])* $other:ident = $other_word:literal,)*
        }
    ) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
        pub enum $name { $(#[$about_first])* #[default] $first, $($(#[$about_other])* $other,)* }

        impl $crate::settings::Choice for $name {
            fn words(&self) -> &'static [&'static str] {
                &[$word, $($other_word),*]
            }
            fn word(&self) -> &'static str {
                match self { Self::$first => $word, $(Self::$other => $other_word),* }
            }
            fn choose(&mut self, word: &str) -> bool {
                *self = match word { $word => Self::$first, $($other_word => Self::$other,)* _ => return false };
                true
            }
        }

        impl $crate::settings::AsValue for $name {
            fn as_value(&mut self) -> $crate::settings::Value<'_> {
                $crate::settings::Value::Choice(self)
            }
        }
    };
}
pub(crate) use choice;

/// Declares structs of settings:
///
/// ```text
/// settings! {
///     /// What it is for.
///     pub struct RustName as PythonName(inner: Inner) {   // the fields of `inner` count as its own, likewise those of
///                                                         // others behind a comma; `PythonName [N]` instead: N
///                                                         // numbers, which `as_array` gives
///         /// What it means.
///         horizon: f64 ["s"] = 3.0, positive(60.0);       // unit and range may be left out
///         /// Settings of their own.
///         comfort: Comfort;
///     }, relations                                        // what fields demand of each other, may be left out
/// }
/// ```
macro_rules! settings {
    (@array $name:ident [] $($field:ident)*) => {};
    (@array $name:ident [$n:expr] $($field:ident)*) => {
        impl $name {
            /// Names of the fields, in the order of the table.
            pub const NAMES: [&'static str; $n] = [$(stringify!($field)),*];

            /// The values in the order of `NAMES`.
            pub fn as_array(&self) -> [f64; $n] {
                [$(self.$field),*]
            }

            /// From values in the order of `NAMES`.
            pub fn from_array([$($field),*]: [f64; $n]) -> Self {
                Self { $($field),* }
            }
        }
    };
    (@or $otherwise:expr) => { $otherwise };
    (@or $otherwise:expr, $given:expr) => { $given };
    ($(
        $(#[doc = $about:literal])+
        pub struct $name:ident as $python:ident $([$n:expr])? $(($($base:ident: $base_type:ty $(= $base_default:expr)?),+))? {
            $(
                $(#[doc = $text:literal])+
                $field:ident: $type:ty $([$unit:literal])? $(= $default:expr $(, $range:expr)?)?;
            )*
        } $(, $relations:path)?
    )+) => { $(
        $(#[doc = $about])+
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct $name {
            $($(
                /// Fields that count as its own.
                pub $base: $base_type,
            )+)?
            $(
                $(#[doc = $text])+
                $(#[doc = concat!("[", $unit, "]")])?
                pub $field: $type,
            )*
        }

        settings!(@array $name [$($n)?] $($field)*);

        impl Default for $name {
            fn default() -> Self {
                Self {
                    $($($base: settings!(@or Default::default() $(, $base_default)?),)+)?
                    $($field: settings!(@or Default::default() $(, $default)?),)*
                }
            }
        }

        impl $name {
            /// Checks every setting.
            ///
            /// # Errors `Setting` with its dotted name and the allowed values.
            pub fn validate(&self) -> $crate::error::Result<()> {
                $crate::settings::check(&mut Self::clone(self))
            }
        }

        impl $crate::settings::Record for $name {
            fn about(&self) -> (&'static str, &'static str) {
                (stringify!($python), concat!($($about, "\n"),+))
            }

            fn fields(&mut self) -> Vec<($crate::settings::Field, $crate::settings::Value<'_>)> {
                use $crate::settings::{AsValue, Field};
                vec![
                    $($((Field { name: "", unit: "", text: "", range: $crate::settings::ANY }, self.$base.as_value()),)+)?
                    $((
                        Field {
                            name: stringify!($field),
                            unit: settings!(@or "" $(, $unit)?),
                            text: concat!($($text, "\n"),+),
                            range: settings!(@or $crate::settings::ANY $($(, $range)?)?),
                        },
                        self.$field.as_value(),
                    ),)*
                ]
            }

            fn relations(&self) -> $crate::error::Result<()> {
                $($relations(self)?;)?
                Ok(())
            }
        }
    )+ };
}
pub(crate) use settings;
