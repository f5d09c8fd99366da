//! Enums with names.

/// Declares an enum whose variants users know by name: in parameter files, on the command line and in messages.
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

            /// The value of that name.
            pub fn from_name(name: &str) -> Option<Self> {
                match name { $($text => Some(Self::$variant),)+ _ => None }
            }

            /// The name users know.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$variant => $text),+ }
            }
        }
    };
}
