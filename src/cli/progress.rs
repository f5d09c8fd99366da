//! Progress bars.

use indicatif::{ProgressBar, ProgressStyle};

use super::terminal;

/// Returns a bar with count, rate and remaining time; without a length, with count, rate and elapsed time. Draws nothing
/// unless standard error is a terminal.
pub(super) fn progress_bar(length: Option<u64>, what: &str) -> ProgressBar {
    let (bar, template) = match length {
        Some(length) => (
            ProgressBar::new(length),
            format!("{{bar:40}} {{human_pos}}/{{human_len}} {what}, {{per_sec}}, {{eta}} left"),
        ),
        None => (
            ProgressBar::new_spinner(),
            format!("{{spinner}} {{human_pos}} {what}, {{per_sec}}, {{elapsed}}"),
        ),
    };
    let styled = match ProgressStyle::with_template(&template) {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    };
    terminal::show(styled)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_terminal_no_bar_is_drawn() {
        let bar = progress_bar(Some(10), "frames");
        bar.set_position(3);
        assert_eq!((bar.position(), bar.length()), (3, Some(10)));
        assert!(bar.is_hidden() || std::io::IsTerminal::is_terminal(&std::io::stderr()));
    }
}
