//! Enums whose values have names.

/// Declares an enum whose variants have names: in parameter files, on the command line and in messages.
///
/// ```
/// laser_triangulation::named_enum! {
///     /// A colour.
///     Colour {
///         /// A warm colour.
///         Red = "red",
///     }
/// }
/// assert_eq!(Colour::from_name("red"), Some(Colour::Red));
/// assert_eq!(Colour::NAMES, ["red"]);
/// ```
#[macro_export]
macro_rules! named_enum {
    ($(#[$doc:meta])* $name:ident { $($(#[$vdoc:meta])* $variant:ident = $text:literal),+ $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name { $($(#[$vdoc])* $variant),+ }

        impl $name {
            /// Every name, in order of declaration.
            pub const NAMES: &[&str] = &[$($text),+];

            /// Returns the value with that name.
            pub fn from_name(name: &str) -> Option<Self> {
                match name { $($text => Some(Self::$variant),)+ _ => None }
            }

            /// Returns the name.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$variant => $text),+ }
            }
        }

        impl $crate::parameters::Setting for $name {
            type Range = ();

            fn kind(&self, (): ()) -> $crate::parameters::Kind {
                $crate::parameters::Kind::Choice { default: self.name(), names: Self::NAMES }
            }

            fn from_value(value: &$crate::parameters::Value) -> Option<Self> {
                match value {
                    $crate::parameters::Value::Text(text) => Self::from_name(text),
                    _ => None,
                }
            }
        }
    };
}
