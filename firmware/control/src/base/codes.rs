//! Enums that pass between drive and host as numbers: each code with its number, its name and a sentence for a person.

/// Makes an enum of codes, with `ALL`, `of_word`, `word`, `name` and `sentence`.
#[macro_export]
macro_rules! codes {
    ($(#[$about:meta])* $code:ident { $($(#[$doc:meta])* $name:ident = $number:literal, $short:literal, $sentence:literal;)* }) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u32)]
        pub enum $code {
            $($(#[$doc])* #[doc = $sentence] $name = $number,)*
        }

        impl $code {
            /// All of them.
            pub const ALL: &'static [Self] = &[$(Self::$name),*];

            /// The code that a word holds.
            #[must_use]
            pub const fn of_word(word: u32) -> Option<Self> {
                match word {
                    $($number => Some(Self::$name),)*
                    _ => None,
                }
            }

            /// The word.
            #[must_use]
            pub const fn word(self) -> u32 {
                self as u32
            }

            /// Its name in a few words.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$name => $short,)*
                }
            }

            /// What it means, and what to do.
            #[must_use]
            pub const fn sentence(self) -> &'static str {
                match self {
                    $(Self::$name => $sentence,)*
                }
            }
        }
    };
}
