//! Texts from elsewhere, made fit for a terminal and a log.
//!
//! Names in recordings and parameters of peers may hold anything: sequences that move the cursor, change colours or the
//! window's title, and line breaks that forge a line of a log. Here they become visible escapes.

use std::{borrow::Cow, fmt::Write};

/// Escapes everything but printable characters: for a name or a line of a log.
pub fn line(text: &str) -> Cow<'_, str> {
    escaped(text, is_unfit)
}

/// Escapes everything but printable characters, line breaks and tabs: for texts of several lines. The escapes are also
/// those of JSON, whose texts keep their meaning.
pub fn text(text: &str) -> Cow<'_, str> {
    escaped(text, |letter| is_unfit(letter) && letter != '\n' && letter != '\t')
}

/// Like [`text`], with every line after the first set in, so that none can pose as the first.
pub fn paragraph(text: &str) -> String {
    let mut lines = String::new();
    for (number, part) in self::text(text).split('\n').enumerate() {
        if number > 0 {
            lines.push('\n');
            if !part.is_empty() && !part.starts_with(' ') {
                lines.push_str("  ");
            }
        }
        lines.push_str(part);
    }
    lines
}

/// True for characters that move the cursor or the direction of writing instead of showing something.
fn is_unfit(letter: char) -> bool {
    letter.is_control()
        || matches!(letter,
            '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{feff}')
}

fn escaped(text: &str, is_unfit: impl Fn(char) -> bool) -> Cow<'_, str> {
    if !text.contains(&is_unfit) {
        return Cow::Borrowed(text);
    }
    let mut fit = String::with_capacity(text.len() + 16);
    for letter in text.chars() {
        match letter {
            letter if !is_unfit(letter) => fit.push(letter),
            '\n' => fit.push_str("\\n"),
            '\r' => fit.push_str("\\r"),
            '\t' => fit.push_str("\\t"),
            // None is beyond the first 65 536 characters. Writing to a text cannot fail.
            letter => write!(fit, "\\u{:04x}", u32::from(letter)).unwrap_or_default(),
        }
    }
    Cow::Owned(fit)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOSTILE: &str = "/a\u{1b}]0;title\u{7}\u{9b}2J\r\n\tERROR b\u{202e}c\u{7f}";

    #[test]
    fn ordinary_texts_stay_as_they_are() {
        for plain in ["", "/image_raw", "µm, 90 °, 深さ", "a \\ \"b\""] {
            assert!(matches!(line(plain), Cow::Borrowed(same) if same == plain));
        }
        assert!(matches!(text("a\n\tb"), Cow::Borrowed("a\n\tb")));
    }

    #[test]
    fn nothing_reaches_a_terminal_but_visible_characters() {
        assert_eq!(
            line(HOSTILE),
            "/a\\u001b]0;title\\u0007\\u009b2J\\r\\n\\tERROR b\\u202ec\\u007f"
        );
        let all: String = ('\0'..=char::MAX).collect();
        assert!(!line(&all).chars().any(is_unfit));
        assert!(!text(&all).chars().any(|it| is_unfit(it) && it != '\n' && it != '\t'));
    }

    #[test]
    fn a_foreign_line_is_set_in() {
        let forged = paragraph("cannot read a\nerror: forged\n  listed\n\u{1b}[2J\n");
        assert_eq!(forged, "cannot read a\n  error: forged\n  listed\n  \\u001b[2J\n");
    }

    #[test]
    fn json_keeps_its_meaning() {
        let json = serde_json::to_string_pretty(&[HOSTILE]).unwrap();
        let read: Vec<String> = serde_json::from_str(&text(&json)).unwrap();
        assert_eq!(read, [HOSTILE]);
    }
}
