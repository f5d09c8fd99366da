//! Location of a bag: the files of an input, the directory of an output.

use std::fs;
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

use super::BagError;
use super::metadata::{BagInformation, METADATA_LIMIT_BYTES, MetadataFile};

/// The files of a bag in order, and notes for the user about the search.
#[derive(Debug)]
pub(super) struct Files {
    pub(super) paths: Vec<PathBuf>,
    pub(super) notes: Vec<String>,
}

/// Finds the files of a rosbag2 directory or a bare `.mcap`.
pub(super) fn find(path: &Path) -> Result<Files, BagError> {
    let io_error = |source| BagError::Io { path: path.into(), source };
    if !fs::metadata(path).map_err(io_error)?.is_dir() {
        return Ok(Files { paths: vec![path.into()], notes: vec![] });
    }
    let metadata_path = path.join("metadata.yaml");
    let why = match read_metadata(&metadata_path) {
        Ok(information) => return listed(path, &metadata_path, &information),
        Err(error) if error.kind() == io::ErrorKind::NotFound => "metadata.yaml is missing".into(),
        Err(error) => format!("metadata.yaml is unreadable ({error})"),
    };
    let mut paths = mcap_files(path).map_err(io_error)?;
    if paths.is_empty() {
        return Err(BagError::NoBag(path.into()));
    }
    paths.sort_by_cached_key(|path| natural_key(path));
    Ok(Files {
        paths,
        notes: vec![format!("{}: {why}; reading its .mcap files in order of name", path.display())],
    })
}

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

fn read_metadata(path: &Path) -> io::Result<BagInformation> {
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

fn listed(
    directory: &Path,
    metadata_path: &Path,
    information: &BagInformation,
) -> Result<Files, BagError> {
    let unsupported = |what| Err(BagError::Unsupported { path: metadata_path.into(), what });
    if information.storage_identifier != "mcap" {
        return unsupported(format!(
            "storage {:?} is not supported",
            information.storage_identifier
        ));
    }
    if !information.compression_mode.is_empty()
        && !information.compression_mode.eq_ignore_ascii_case("none")
    {
        return unsupported(format!(
            "compression mode {:?} is not supported",
            information.compression_mode
        ));
    }
    let mut paths = Vec::new();
    for entry in &information.relative_file_paths {
        if !stays_inside(Path::new(entry)) {
            return Err(BagError::PathEscapes { path: metadata_path.into(), entry: entry.clone() });
        }
        let path = directory.join(entry);
        fs::metadata(&path).map_err(|source| BagError::Io { path: path.clone(), source })?;
        paths.push(path);
    }
    if paths.is_empty() {
        return Err(BagError::NoBag(directory.into()));
    }
    Ok(Files { paths, notes: vec![] })
}

fn stays_inside(path: &Path) -> bool {
    path.components().all(|component| matches!(component, Component::Normal(_) | Component::CurDir))
        && path.file_name().is_some()
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

/// Sort key that puts `name_2` before `name_10`: the text before the trailing number, the number, the whole path.
fn natural_key(path: &Path) -> (String, u64, PathBuf) {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let prefix = stem.trim_end_matches(|character: char| character.is_ascii_digit());
    (prefix.to_owned(), stem[prefix.len()..].parse().unwrap_or(0), path.into())
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
    fn paths_stay_inside_the_directory() {
        for entry in ["../secret.mcap", "/etc/passwd", "a/../../b.mcap", "''", "."] {
            let directory = bag(&[("metadata.yaml", &metadata("mcap", entry))]);
            assert!(matches!(find(directory.path()), Err(BagError::PathEscapes { .. })), "{entry}");
        }
    }

    #[test]
    fn a_listed_file_that_is_missing_is_named() {
        let directory = bag(&[("metadata.yaml", &metadata("mcap", "gone_0.mcap"))]);
        assert!(find(directory.path()).unwrap_err().to_string().contains("gone_0.mcap"));
    }

    #[test]
    fn other_storages_are_refused_by_name() {
        let directory = bag(&[("metadata.yaml", &metadata("sqlite3", "a.db3"))]);
        assert!(find(directory.path()).unwrap_err().to_string().contains("\"sqlite3\""));
    }

    #[test]
    fn without_metadata_the_files_are_sorted_by_number_and_a_note_reports_it() {
        for broken in [None, Some("no: [yaml"), Some("rosbag2_bagfile_information: 3")] {
            let directory = bag(&[("a_10.mcap", ""), ("a_2.mcap", ""), ("notes.txt", "")]);
            if let Some(text) = broken {
                fs::write(directory.path().join("metadata.yaml"), text).unwrap();
            }
            let files = find(directory.path()).unwrap();
            let names: Vec<_> = files.paths.iter().map(|path| path.file_name().unwrap()).collect();
            assert_eq!(names, ["a_2.mcap", "a_10.mcap"]);
            assert!(files.notes[0].contains("metadata.yaml is"), "{:?}", files.notes);
        }
    }

    #[test]
    fn a_directory_without_recordings_is_not_a_bag() {
        assert!(matches!(find(bag(&[("a.txt", "")]).path()), Err(BagError::NoBag(_))));
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
