//! Location of a bag: its description, and the files that a new bag replaces.

use std::collections::BTreeSet;
use std::fs;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use mcap::records::op;

use super::fields::Fields;
use super::metadata::{BagInformation, METADATA_LIMIT_BYTES, MetadataFile, from_yaml};

/// Bytes of a recording's start that hold its header.
const HEADER_BYTES: u64 = 1024;

/// Rejects an output that is or contains the input, because replacing the output would delete the input.
///
/// # Errors
/// The input lies inside the output directory or is that directory; the input's path cannot be resolved.
pub(crate) fn refuse_same(input: &Path, output: &Path) -> io::Result<()> {
    let Ok(output_real) = fs::canonicalize(output) else { return Ok(()) };
    let input_real = fs::canonicalize(input)?;
    if input_real.starts_with(&output_real) {
        let message = format!("{} is the recording itself or contains it", output.display());
        return Err(io::Error::new(io::ErrorKind::InvalidInput, message));
    }
    Ok(())
}

/// Files in `directory` that a new bag replaces: those that its metadata lists and those numbered after `name`, which
/// an interrupted recording leaves. All are regular files in the directory itself, written by this program: links and
/// folders of the directory are not followed. `None` if the directory is not a bag of this program.
pub(super) fn replaceable(directory: &Path, name: &str) -> io::Result<Option<Vec<PathBuf>>> {
    let metadata_path = directory.join("metadata.yaml");
    let files = mcap_files(directory)?;
    let mut own: Vec<PathBuf> =
        files.iter().filter(|path| is_numbered(path, name)).cloned().collect();
    match read_metadata(&metadata_path) {
        Ok(information) => {
            let entries: BTreeSet<_> =
                information.relative_file_paths.iter().map(|entry| directory.join(entry)).collect();
            own.extend(files.into_iter().filter(|path| entries.contains(path)));
            own.push(metadata_path.clone());
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let is_empty = fs::read_dir(directory)?.next().is_none();
            if own.is_empty() && !is_empty {
                return Ok(None);
            }
        }
        Err(_) => return Ok(None),
    }
    own.sort();
    own.dedup();
    let is_foreign = |path: &PathBuf| *path != metadata_path && !is_of_this_program(path);
    Ok(Some(own).filter(|own| !own.iter().any(is_foreign)))
}

/// True if the header of a recording names this program, or there is no header yet.
fn is_of_this_program(path: &Path) -> bool {
    let mut start = Vec::new();
    let read = fs::File::open(path).and_then(|it| it.take(HEADER_BYTES).read_to_end(&mut start));
    if read.is_err() || start.is_empty() {
        return read.is_ok();
    }
    let body = start.strip_prefix(mcap::MAGIC).and_then(|it| it.strip_prefix(&[op::HEADER]));
    let mut fields = Fields::of(body.unwrap_or_default());
    let library = fields.u64().and_then(|_length| fields.string()).and_then(|_| fields.string());
    library.is_some_and(|library| library.split(' ').next() == Some(env!("CARGO_PKG_NAME")))
}

/// Reads a `metadata.yaml`.
pub(super) fn read_metadata(path: &Path) -> io::Result<BagInformation> {
    let mut text = String::new();
    fs::File::open(path)?.take(METADATA_LIMIT_BYTES).read_to_string(&mut text)?;
    let invalid = |error: serde_saphyr::Error| {
        let message = error.to_string();
        io::Error::new(
            io::ErrorKind::InvalidData,
            message.lines().next().unwrap_or_default().to_owned(),
        )
    };
    let file: MetadataFile = from_yaml(&text).map_err(invalid)?;
    Ok(file.rosbag2_bagfile_information)
}

fn mcap_files(directory: &Path) -> io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(directory)? {
        let entry = entry?;
        let path = entry.path();
        // Of a link, this is the type of the link.
        if entry.file_type()?.is_file() && path.extension().is_some_and(|it| it == "mcap") {
            files.push(path);
        }
    }
    Ok(files)
}

fn is_numbered(path: &Path, name: &str) -> bool {
    let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    let number =
        stem.strip_prefix(name).and_then(|rest| rest.strip_prefix('_')).unwrap_or_default();
    !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit())
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    fn bag(files: &[(&str, &str)]) -> tempfile::TempDir {
        let directory = tempfile::tempdir().unwrap();
        for (name, content) in files {
            fs::write(directory.path().join(name), content).unwrap();
        }
        directory
    }

    fn metadata(storage: &str, file: &str) -> String {
        format!(
            "rosbag2_bagfile_information:\n  version: 9\n  storage_identifier: {storage}\n  relative_file_paths: [{file}]\n"
        )
    }

    #[test]
    fn only_the_files_of_a_bag_are_replaceable() {
        let names = |directory: &Path, name| {
            let files = replaceable(directory, name).unwrap()?;
            Some(
                files
                    .iter()
                    .map(|path| path.file_name().unwrap().to_str().unwrap().to_owned())
                    .collect::<Vec<_>>(),
            )
        };
        let listed = bag(&[
            ("metadata.yaml", &metadata("mcap", "x.mcap")),
            ("x.mcap", ""),
            ("y.mcap", ""),
            ("z", ""),
        ]);
        assert_eq!(names(listed.path(), "out").unwrap(), ["metadata.yaml", "x.mcap"]);
        let cut_short = bag(&[("out_0.mcap", ""), ("out_x.mcap", ""), ("other_0.mcap", "")]);
        assert_eq!(names(cut_short.path(), "out").unwrap(), ["out_0.mcap"]);
        assert_eq!(names(bag(&[("thesis.tex", "")]).path(), "out"), None);
        assert_eq!(
            names(bag(&[("metadata.yaml", "title: of another program")]).path(), "out"),
            None
        );
    }

    #[test]
    fn links_folders_and_foreign_recordings_are_not_replaced() {
        let place = bag(&[]);
        let elsewhere = place.path().join("elsewhere");
        fs::create_dir(&elsewhere).unwrap();
        fs::write(elsewhere.join("thesis.mcap"), "years").unwrap();
        let output = place.path().join("out");
        fs::create_dir(&output).unwrap();
        let list = "folder/thesis.mcap, link.mcap, out_0.mcap, ../elsewhere/thesis.mcap";
        fs::write(output.join("metadata.yaml"), metadata("mcap", list)).unwrap();
        fs::write(output.join("out_0.mcap"), "").unwrap();
        symlink(&elsewhere, output.join("folder")).unwrap();
        symlink(elsewhere.join("thesis.mcap"), output.join("link.mcap")).unwrap();
        symlink(elsewhere.join("thesis.mcap"), output.join("out_1.mcap")).unwrap();
        let expected = ["metadata.yaml", "out_0.mcap"].map(|name| output.join(name));
        assert_eq!(replaceable(&output, "out").unwrap().unwrap(), expected);

        let header = |library: &str| {
            let text = |text: &str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
            let body = [text("ros2"), text(library)].concat();
            let length = (body.len() as u64).to_le_bytes();
            [mcap::MAGIC, &[op::HEADER], &length, &body, b"more"].concat()
        };
        for (library, is_ours) in [
            (concat!("laser_profiler ", env!("CARGO_PKG_VERSION")), true),
            ("laser_profiler 0.0.1", true),
            ("libmcap 1.4", false),
            ("laser_profiler_other 1", false),
        ] {
            fs::write(output.join("out_0.mcap"), header(library)).unwrap();
            assert_eq!(replaceable(&output, "out").unwrap().is_some(), is_ours, "{library}");
        }
    }

    #[test]
    fn an_output_that_contains_the_input_is_refused() {
        let directory = bag(&[("a_0.mcap", "")]);
        assert!(refuse_same(directory.path(), directory.path()).is_err());
        assert!(refuse_same(&directory.path().join("a_0.mcap"), directory.path()).is_err());
        assert!(refuse_same(directory.path(), &directory.path().join("out")).is_ok());
    }
}
