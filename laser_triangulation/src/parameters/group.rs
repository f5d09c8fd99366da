//! The macro that declares a group of parameters.

/// Declares a struct of parameters, one row per parameter: description, field, type, default, name, range, unit.
///
/// The description is the field's documentation, followed by the range. The struct gets `Default`, `parameters()` (its
/// table), `from_values()` (its reader) and `check_ranges()`. After `=>` stands one of
/// - `["name"]` or `["name", read_only]`: a parameter without a range;
/// - `["name", range, "unit"]` or `["name", range, "unit", read_only]`: a number. A field of type `Option` is `None`
///   where the parameter is 0;
/// - `group`: another struct declared by this macro;
/// - `computed`: a field that no parameter sets.
///
/// ```
/// laser_triangulation::parameter_group! {
///     /// The blur.
///     #[derive(Debug, PartialEq)]
///     pub struct Blur {
///         /// Radius of the kernel.
///         radius: u32 = 3 => ["blur.radius", 0..=15, "px"],
///     }
/// }
/// use laser_triangulation::parameters::Value;
/// assert_eq!(Blur::default(), Blur { radius: 3 });
/// assert_eq!(Blur::parameters()[0].text, "Radius of the kernel.");
/// let values = [("blur.radius", Value::Integer(5)), ("other", Value::Bool(true))];
/// let find = |name: &str| values.iter().find(|(key, _)| *key == name).map(|(_, value)| value);
/// assert_eq!(Blur::from_values(&find), Ok(Blur { radius: 5 }));
/// let error = Blur { radius: 16 }.check_ranges().unwrap_err();
/// assert_eq!(error.to_string(), "blur.radius must be an integer from 0 to 15 [px]");
/// ```
#[macro_export]
macro_rules! parameter_group {
    (
        $(#[$attribute:meta])*
        pub struct $group:ident {
            $($(#[doc = $text:literal])+ $field:ident: $type:ty = $default:expr => $how:tt,)+
        }
    ) => {
        $(#[$attribute])*
        #[allow(clippy::doc_markdown, reason = "descriptions are read as plain text too")]
        pub struct $group {
            $($(#[doc = $text])+ #[doc = $crate::parameter_group!(@doc $how)] pub $field: $type,)+
        }

        impl Default for $group {
            fn default() -> Self {
                Self { $($field: $default),+ }
            }
        }

        impl $group {
            /// Returns the table: one row per parameter, in order of declaration.
            pub fn parameters() -> Vec<$crate::parameters::Parameter> {
                Self::default().rows()
            }

            /// Returns the table with these values as defaults.
            #[doc(hidden)]
            #[allow(clippy::vec_init_then_push, reason = "a row may add any number of entries")]
            pub fn rows(&self) -> Vec<$crate::parameters::Parameter> {
                let mut rows = Vec::new();
                $($crate::parameter_group!(@row rows, self.$field, $how, [$($text)+]);)+
                rows
            }

            /// Checks that every number is in its range; NaN is in none.
            ///
            /// # Errors
            /// The first parameter out of range.
            pub fn check_ranges(&self) -> Result<(), $crate::parameters::NotAllowed> {
                self.rows().iter().try_for_each(|row| row.check_found(Some(&row.default_value())))
            }

            /// Takes the values that `value` returns for a name; other fields keep their default.
            ///
            /// # Errors
            /// A value of another type or out of range.
            pub fn from_values<'a>(
                value: &impl Fn(&str) -> Option<&'a $crate::parameters::Value>,
            ) -> Result<Self, $crate::parameters::NotAllowed> {
                for row in Self::parameters() {
                    row.check_found(value(row.name))?;
                }
                let mut group = Self::default();
                $($crate::parameter_group!(@read value, group.$field, $type, $how);)+
                Ok(group)
            }
        }
    };

    (@doc [$name:literal, $range:expr, $unit:literal $($rest:tt)*]) => {
        concat!("\n Range: `", stringify!($range), "` ", $unit, ". Parameter `", $name, "`.")
    };
    (@doc [$name:literal $($rest:tt)*]) => { concat!("\n Parameter `", $name, "`.") };
    (@doc $how:tt) => { "" };

    (@row $rows:ident, $default:expr, group, $text:tt) => {
        $rows.extend($default.rows())
    };
    (@row $rows:ident, $default:expr, computed, $text:tt) => {};
    (@row $rows:ident, $default:expr, [$name:literal], $text:tt) => {
        $crate::parameter_group!(@push $rows, $default, $name, (), "", false, $text)
    };
    (@row $rows:ident, $default:expr, [$name:literal, read_only], $text:tt) => {
        $crate::parameter_group!(@push $rows, $default, $name, (), "", true, $text)
    };
    (@row $rows:ident, $default:expr, [$name:literal, $range:expr, $unit:literal], $text:tt) => {
        $crate::parameter_group!(@push $rows, $default, $name, $range, $unit, false, $text)
    };
    (@row $rows:ident, $default:expr, [$name:literal, $range:expr, $unit:literal, read_only], $text:tt) => {
        $crate::parameter_group!(@push $rows, $default, $name, $range, $unit, true, $text)
    };
    (@push $rows:ident, $default:expr, $name:literal, $range:expr, $unit:literal, $read_only:literal, [$($text:literal)+]) => {
        $rows.push($crate::parameters::Parameter {
            name: $name,
            unit: $unit,
            kind: $crate::parameters::Setting::kind(&$default, $range),
            is_read_only: $read_only,
            text: concat!($($text),+).trim_ascii_start(),
        })
    };

    (@read $value:ident, $target:expr, $type:ty, group) => {
        $target = <$type>::from_values($value)?
    };
    (@read $value:ident, $target:expr, $type:ty, computed) => {};
    (@read $value:ident, $target:expr, $type:ty, [$name:literal $($rest:tt)*]) => {
        if let Some(found) = $value($name).and_then($crate::parameters::Setting::from_value) {
            $target = found;
        }
    };
}
