//! Tables whose rows are structs. A `table!` declares the struct, and so the columns: the binding hands them over by
//! their names, and the records of `interdrive.run` say what they mean.

use crate::geometry::Pose;

/// The values of a column.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Ids, time steps, counts and codes; -1 for none.
    Integers(Vec<i64>),
    /// Amounts; NaN for none.
    Numbers(Vec<f64>),
    /// Yes or no.
    Truths(Vec<bool>),
    /// For people.
    Texts(Vec<String>),
}

/// What a row can have in a field.
pub trait Cell: Sized {
    /// The columns of a field with this name, and their values.
    fn columns(name: &str, values: impl Iterator<Item = Self> + Clone) -> Vec<(String, Values)>;
}

macro_rules! cells {
    ($($type:ty => $kind:ident($of:expr);)+) => { $(
        impl Cell for $type {
            fn columns(name: &str, values: impl Iterator<Item = Self> + Clone) -> Vec<(String, Values)> {
                vec![(name.into(), Values::$kind(values.map($of).collect()))]
            }
        }
    )+ };
}

cells! {
    i64 => Integers(|value| value);
    usize => Integers(|value| value as i64);
    u8 => Integers(i64::from);
    Option<i64> => Integers(|value| value.unwrap_or(-1));
    f64 => Numbers(|value| value);
    bool => Truths(|value| value);
    String => Texts(|value| value);
}

impl Cell for Pose {
    fn columns(name: &str, values: impl Iterator<Item = Self> + Clone) -> Vec<(String, Values)> {
        let column =
            |part, of: fn(Self) -> f64| (format!("{name}_{part}"), Values::Numbers(values.clone().map(of).collect()));
        vec![
            column("x", |pose| pose.position.x),
            column("y", |pose| pose.position.y),
            column("heading", |pose| pose.orientation),
        ]
    }
}

/// Declares the rows of a table: a struct whose fields are columns, called like the field, or as it says behind `as`.
macro_rules! table {
    (
        $(#[$about:meta])*
        pub struct $row:ident { $(
            $(#[$meaning:meta])*
            pub $field:ident $(as $column:literal)?: $type:ty,
        )+ }
    ) => {
        $(#[$about])*
        pub struct $row { $(
            $(#[$meaning])*
            pub $field: $type,
        )+ }

        impl $row {
            /// The columns of a table of such rows, by their names.
            pub fn columns(rows: &[&Self]) -> Vec<(String, $crate::columns::Values)> {
                let fields = [$({
                    let name = [$($column,)? stringify!($field)][0];
                    <$type as $crate::columns::Cell>::columns(name, rows.iter().map(|row| row.$field.clone()))
                }),+];
                fields.into_iter().flatten().collect()
            }
        }
    };
}
pub(crate) use table;

/// Codes are columns of integers.
macro_rules! coded {
    ($type:ty) => {
        impl $crate::columns::Cell for $type {
            fn columns(
                name: &str,
                values: impl Iterator<Item = Self> + Clone,
            ) -> Vec<(String, $crate::columns::Values)> {
                vec![(name.into(), $crate::columns::Values::Integers(values.map(|value| value as i64).collect()))]
            }
        }
    };
}
pub(crate) use coded;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Point;

    table! {
        /// A row.
        #[derive(Debug, Clone)]
        pub struct Row {
            /// An id, which need not be there.
            pub by as "by_id": Option<i64>,
            /// A place.
            pub bar: Pose,
            /// A text.
            pub message: String,
        }
    }

    #[test]
    fn a_field_is_a_column_with_its_name_or_the_stated_one() {
        let bar = Pose { position: Point::new(1.0, 2.0), orientation: 3.0 };
        let rows = [Row { by: Some(7), bar, message: "a".into() }, Row { by: None, bar, message: "b".into() }];
        let columns = Row::columns(&rows.iter().collect::<Vec<_>>());
        let number = |value| Values::Numbers(vec![value; 2]);
        let expected = [
            ("by_id", Values::Integers(vec![7, -1])),
            ("bar_x", number(1.0)),
            ("bar_y", number(2.0)),
            ("bar_heading", number(3.0)),
            ("message", Values::Texts(vec!["a".into(), "b".into()])),
        ];
        assert_eq!(columns, expected.map(|(name, values)| (name.to_owned(), values)));
    }
}
