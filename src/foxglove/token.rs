//! The secret that a viewer states to change things.

use std::fmt::{self, Write as _};

use subtle::ConstantTimeEq;

use super::ViewError;

/// Random bytes of a generated token.
const RANDOM_BYTES: usize = 16;
/// Letters of a token.
const LENGTHS: std::ops::RangeInclusive<usize> = 6..=128;

/// A secret.
#[derive(Clone, PartialEq, Eq)]
pub(crate) struct Token(String);

impl Token {
    /// Takes a token.
    ///
    /// # Errors
    /// It is too short or too long, or has letters other than A to Z, a to z, 0 to 9, `-`, `_` and `.`.
    pub(crate) fn new(text: &str) -> Result<Self, ViewError> {
        let is_letter = |letter: u8| letter.is_ascii_alphanumeric() || b"-_.".contains(&letter);
        if LENGTHS.contains(&text.len()) && text.bytes().all(is_letter) {
            Ok(Self(text.to_owned()))
        } else {
            Err(ViewError::Token)
        }
    }

    /// Makes a token from the system's randomness.
    ///
    /// # Errors
    /// The system has none.
    pub(crate) fn generate() -> Result<Self, ViewError> {
        let mut bytes = [0; RANDOM_BYTES];
        getrandom::fill(&mut bytes).map_err(|error| ViewError::Randomness(error.into()))?;
        let mut token = String::with_capacity(2 * RANDOM_BYTES);
        for byte in bytes {
            // Writing to a string cannot fail.
            _ = write!(token, "{byte:02x}");
        }
        Ok(Self(token))
    }

    /// True if the text is this token. The time does not depend on where they differ.
    pub(super) fn is(&self, text: &str) -> bool {
        self.0.as_bytes().ct_eq(text.as_bytes()).into()
    }

    /// Returns the secret, for the URL that the operator is shown.
    pub(crate) fn secret(&self) -> &str {
        &self.0
    }
}

impl fmt::Debug for Token {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Token")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn generated_tokens_differ_and_are_tokens() {
        let [one, other] = [(); 2].map(|()| Token::generate().unwrap());
        assert_ne!(one, other);
        assert!(one.is(one.secret()) && !one.is(other.secret()));
        assert_eq!(Token::new(one.secret()).unwrap(), one);
        assert!(!format!("{one:?}").contains(one.secret()), "a secret is in no log");
    }

    #[test]
    fn a_token_fits_a_url() {
        for text in ["", "short", "with space", "a&token=b", "täglich", &"x".repeat(129)] {
            assert!(Token::new(text).unwrap_err().is_usage(), "{text}");
        }
        Token::new("six-to.128_letters").unwrap();
    }
}
