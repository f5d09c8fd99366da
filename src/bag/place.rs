//! Location of a bag: its description, and the files that a new bag replaces.

use std::fs;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use super::find::stays_inside;
use super::metadata::{BagInformation, METADATA_LIMIT_BYTES, MetadataFile};

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
/// an interrupted recording leaves. `None` if the directory is not a bag.
pub(super) fn replaceable(directory: &Path, name: &str) -> io::Result<Option<Vec<PathBuf>>> {
    let metadata_path = directory.join("metadata.yaml");
    let mut own: Vec<PathBuf> = mcap_files(directory)?;
    own.retain(|path| is_numbered(path, name));
    match read_metadata(&metadata_path) {
        Ok(information) => {
            let entries = information.relative_file_paths.iter();
            let listed = entries
                .filter(|entry| stays_inside(Path::new(entry)))
                .map(|entry| directory.join(entry));
            own.extend(listed.filter(|path| is_mcap(path)));
            own.push(metadata_path);
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
    Ok(Some(own))
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
    let file: MetadataFile = serde_saphyr::from_str(&text).map_err(invalid)?;
    Ok(file.rosbag2_bagfile_information)
}

fn mcap_files(directory: &Path) -> io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(directory)? {
        let path = entry?.path();
        if is_mcap(&path) {
            files.push(path);
        }
    }
    Ok(files)
}

fn is_mcap(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "mcap") && path.is_file()
}

fn is_numbered(path: &Path, name: &str) -> bool {
    let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    let number =
        stem.strip_prefix(name).and_then(|rest| rest.strip_prefix('_')).unwrap_or_default();
    !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit())
}

#[cfg(test)]
mod tests {
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
    fn an_output_that_contains_the_input_is_refused() {
        let directory = bag(&[("a_0.mcap", "")]);
        assert!(refuse_same(directory.path(), directory.path()).is_err());
        assert!(refuse_same(&directory.path().join("a_0.mcap"), directory.path()).is_err());
        assert!(refuse_same(directory.path(), &directory.path().join("out")).is_ok());
    }
}
