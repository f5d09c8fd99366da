//! A human-readable report: sections of text, tables and plots, as terminal text or Markdown.

use std::{fmt::Write as _, path::Path};

/// A section of a report.
#[derive(Clone, Debug, Default)]
pub(super) struct Section {
    /// Its heading.
    pub(super) title: String,
    /// Introductory text before the tables.
    pub(super) paragraphs: Vec<String>,
    /// Its tables.
    pub(super) tables: Vec<Table>,
    /// File name and description of each plot.
    pub(super) plots: Vec<(String, String)>,
}

/// A table of text cells. The first column is left-aligned, all others are right-aligned.
#[derive(Clone, Debug, Default)]
pub(super) struct Table {
    /// Caption; empty if the section already explains the table.
    pub(super) caption: String,
    /// Heads of the columns.
    pub(super) header: Vec<String>,
    /// The rows, as long as the header.
    pub(super) rows: Vec<Vec<String>>,
}

/// Returns text for a terminal.
pub(super) fn plain(sections: &[Section]) -> String {
    let mut text = String::new();
    for (number, section) in sections.iter().enumerate() {
        let gap = if number == 0 { "" } else { "\n" };
        push(&mut text, format_args!("{gap}{}\n", section.title.to_uppercase()));
        for paragraph in &section.paragraphs {
            text.push_str(&wrapped(paragraph));
        }
        for table in &section.tables {
            push(&mut text, format_args!("\n{}", table.plain()));
        }
    }
    text
}

/// Returns Markdown. Includes plots that have been drawn, with the paths given in `plots`.
pub(super) fn markdown(sections: &[Section], plots: Option<&Path>) -> String {
    let mut text = String::new();
    for (number, section) in sections.iter().enumerate() {
        let gap = if number == 0 { "" } else { "\n" };
        push(&mut text, format_args!("{gap}## {}\n", section.title));
        for paragraph in &section.paragraphs {
            push(&mut text, format_args!("\n{paragraph}\n"));
        }
        for table in &section.tables {
            push(&mut text, format_args!("\n{}", table.markdown()));
        }
        let Some(directory) = plots else { continue };
        for (file, description) in &section.plots {
            let path = directory.join(file);
            push(&mut text, format_args!("\n![{description}]({})\n", path.display()));
        }
    }
    text
}

impl Table {
    fn plain(&self) -> String {
        let rows = || std::iter::once(&self.header).chain(&self.rows);
        let width = |column: usize| {
            let cells = rows().filter_map(|row| row.get(column));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let widths: Vec<_> = (0..self.header.len()).map(width).collect();
        let mut text =
            if self.caption.is_empty() { String::new() } else { format!("{}\n", self.caption) };
        for row in rows() {
            let mut line = String::from(" ");
            for (column, (cell, &width)) in row.iter().zip(&widths).enumerate() {
                if column == 0 {
                    push(&mut line, format_args!(" {cell:<width$}"));
                } else {
                    push(&mut line, format_args!("  {cell:>width$}"));
                }
            }
            push(&mut text, format_args!("{}\n", line.trim_end()));
        }
        text
    }

    fn markdown(&self) -> String {
        let mut text = if self.caption.is_empty() {
            String::new()
        } else {
            format!("**{}**\n\n", self.caption)
        };
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
        text.push_str(&line(&self.header));
        let rule = |column| if column == 0 { "---|" } else { "---:|" };
        push(
            &mut text,
            format_args!("|{}\n", (0..self.header.len()).map(rule).collect::<String>()),
        );
        self.rows.iter().for_each(|row| text.push_str(&line(row)));
        text
    }
}

/// Breaks text into lines of at most 100 characters.
fn wrapped(paragraph: &str) -> String {
    let mut text = String::new();
    let mut length = 0;
    for word in paragraph.split_whitespace() {
        let letters = word.chars().count();
        if length > 0 && length + 1 + letters > 100 {
            text.push('\n');
            length = 0;
        } else if length > 0 {
            text.push(' ');
            length += 1;
        }
        text.push_str(word);
        length += letters;
    }
    text.push('\n');
    text
}

fn push(text: &mut String, what: std::fmt::Arguments<'_>) {
    text.write_fmt(what).unwrap_or_else(|_| unreachable!("writing to a string cannot fail"));
}

/// Formats a length with four decimals; a dash if it is not finite.
pub(super) fn px(value: f64) -> String {
    number(value, 4)
}

/// Formats a number with the given decimals; a dash if it is not finite.
pub(super) fn number(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return "-".to_owned();
    }
    let text = format!("{value:.decimals$}");
    // Values that round to zero have no sign.
    match text.strip_prefix('-') {
        Some(zero) if zero.chars().all(|letter| "0.".contains(letter)) => zero.to_owned(),
        _ => text,
    }
}

/// Formats a share in percent; a dash if it is not finite.
pub(super) fn percent(share: f64) -> String {
    number(100.0 * share, 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn section() -> Section {
        let texts = |cells: &[&str]| cells.iter().map(|&cell| cell.to_owned()).collect::<Vec<_>>();
        Section {
            title: "Noise".to_owned(),
            paragraphs: vec!["word ".repeat(30)],
            tables: vec![Table {
                caption: "RMS [px]".to_owned(),
                header: texts(&["method", "÷ bound", "RMS"]),
                rows: vec![texts(&["steger", "1.05", "0.1"])],
            }],
            plots: vec![("noise.svg".to_owned(), "RMS over noise".to_owned())],
        }
    }

    #[test]
    fn terminal_text_has_columns_and_short_lines() {
        let text = plain(&[section()]);
        assert!(text.starts_with("NOISE\nword word"), "{text}");
        assert!(
            text.ends_with("\nRMS [px]\n  method  ÷ bound  RMS\n  steger     1.05  0.1\n"),
            "{text}"
        );
        assert!(text.lines().all(|line| line.chars().count() <= 100));
    }

    #[test]
    fn markdown_has_tables_and_the_plots_that_were_drawn() {
        let text = markdown(&[section()], Some(Path::new("plots")));
        assert!(
            text.contains("| method | ÷ bound | RMS |\n|---|---:|---:|\n| steger | 1.05 | 0.1 |\n")
        );
        assert!(text.ends_with("\n![RMS over noise](plots/noise.svg)\n"), "{text}");
        assert!(!markdown(&[section()], None).contains("svg"));
    }

    #[test]
    fn missing_values_are_dashes() {
        assert_eq!((px(0.012_34).as_str(), px(f64::NAN).as_str()), ("0.0123", "-"));
        assert_eq!((percent(0.683).as_str(), px(-0.000_01).as_str()), ("68.3", "0.0000"));
        assert_eq!(px(-0.012), "-0.0120");
    }
}
