//! The command that converts a recording of another kind.

use std::path::Path;

use super::kind::Content;

/// Returns the commands that make a readable recording, for a kind that is not read; empty for any other kind.
pub(super) fn advice(path: &Path, content: Content) -> String {
    // `DIR/` and `DIR` are the same bag.
    let source: std::path::PathBuf = path.components().collect();
    let output = source.with_extension("").display().to_string() + "_mcap";
    let (source, quoted) = (shell_quoted(&source.display().to_string()), shell_quoted(&output));
    match content {
        Content::Sqlite => format!(
            "; convert it with (pip install rosbags)\n  rosbags-convert --src {source} --dst {quoted} --dst-storage mcap\nor, where ROS 2 is installed, with\n  \
             echo \"output_bags: [{{uri: {output}, storage_id: mcap, all: true}}]\" > convert.yaml && ros2 bag convert -i {source} -o convert.yaml"
        ),
        Content::Ros1 => format!(
            "; convert it with (pip install rosbags)\n  rosbags-convert --src {source} --dst {quoted} --dst-storage mcap"
        ),
        _ => String::new(),
    }
}

/// Quotes a path for a shell if it needs that.
fn shell_quoted(text: &str) -> String {
    let is_plain =
        |character: char| character.is_ascii_alphanumeric() || "/._-+,:@%".contains(character);
    if !text.is_empty() && text.chars().all(is_plain) {
        return text.to_owned();
    }
    format!("'{}'", text.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_can_be_copied_whatever_the_name() {
        let ros1 = |path: &str| advice(Path::new(path), Content::Ros1);
        assert!(
            ros1("scan.bag").contains("--src scan.bag --dst scan_mcap "),
            "{}",
            ros1("scan.bag")
        );
        let spaced = ros1("/data/my scan/it's.bag");
        assert!(spaced.contains(r"--src '/data/my scan/it'\''s.bag'"), "{spaced}");
        let sqlite = advice(Path::new("bags/run/"), Content::Sqlite);
        assert!(sqlite.contains("ros2 bag convert -i bags/run -o convert.yaml"), "{sqlite}");
        assert!(sqlite.contains("uri: bags/run_mcap, storage_id: mcap"), "{sqlite}");
        assert_eq!(advice(Path::new("a"), Content::Other), "");
    }
}
