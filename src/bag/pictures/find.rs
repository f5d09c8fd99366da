//! Finds pictures: in folders, among files, by pattern.

use std::ffi::OsStr;
use std::fs::{self, DirEntry, FileType};
use std::io::Read;
use std::path::{Path, PathBuf};

use glob::{GlobError, Pattern};

use super::error::PictureError;
use super::{natural, video};
use crate::bag::kind;
use crate::msg::convert::file_kind::FileKind;

/// Endings of the names of pictures, lower case.
const PICTURES: [&str; 9] = ["png", "jpg", "jpeg", "tif", "tiff", "bmp", "pgm", "ppm", "pnm"];
/// Names listed in a note.
const MAX_LISTED: usize = 3;
/// Bytes that tell what kind of picture a file is.
const HEAD_BYTES: u64 = 16;

/// Pictures of one series, in natural order.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Found {
    /// Path of the folder, or of the first picture.
    pub(super) path: PathBuf,
    /// Their names for users.
    pub(super) name: String,
    /// The pictures.
    pub(super) pictures: Vec<PathBuf>,
    /// Notes for the user about what else there is.
    pub(super) notes: Vec<String>,
}

/// An input of the user.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Input {
    /// Pictures.
    Pictures(Found),
    /// A video.
    Video(PathBuf),
    /// Anything else: a recording, or a path that does not exist.
    Recording(PathBuf),
}

/// Sorts inputs into recordings, videos and series of pictures: each folder is a series, all single files together are one, in
/// the place of the first. Expands patterns.
///
/// # Errors
/// A folder that cannot be read or has neither; a pattern without a match.
pub(super) fn sort(paths: &[PathBuf]) -> Result<Vec<Input>, PictureError> {
    let mut inputs = Vec::new();
    let mut single = Vec::new();
    let mut place = None;
    for path in &expanded(paths)? {
        if path.is_dir() {
            inputs.push(match in_folder(path)? {
                Some(found) => Input::Pictures(found),
                None => Input::Recording(path.clone()),
            });
        } else if is_picture(path) {
            place.get_or_insert(inputs.len());
            single.push(path.clone());
        } else if has_ending(path, &video::ENDINGS) {
            inputs.push(Input::Video(path.clone()));
        } else {
            inputs.push(Input::Recording(path.clone()));
        }
    }
    if let Some(place) = place {
        inputs.insert(place, Input::Pictures(of_files(single)));
    }
    Ok(inputs)
}

fn of_files(mut pictures: Vec<PathBuf>) -> Found {
    sort_naturally(&mut pictures);
    let num_before = pictures.len();
    pictures.dedup();
    let mut notes = Vec::new();
    if pictures.len() < num_before {
        notes.push(format!(
            "{} pictures are named twice; each is read once",
            num_before - pictures.len()
        ));
    }
    let name = |path: Option<&PathBuf>| path.map(|path| name_of(path)).unwrap_or_default();
    let (first, last) = (name(pictures.first()), name(pictures.last()));
    let name = if pictures.len() == 1 { first } else { format!("{first} to {last}") };
    Found { path: pictures.first().cloned().unwrap_or_default(), name, pictures, notes }
}

/// Names inputs for users: their number and the first ones.
pub(super) fn listed_inputs(inputs: &[Input]) -> String {
    let name = |input: &Input| match input {
        Input::Pictures(Found { path, .. }) | Input::Video(path) | Input::Recording(path) => {
            path.display().to_string()
        }
    };
    listed(inputs.iter().map(name).collect(), ["input", "inputs"]).unwrap_or_default()
}

/// Expands patterns: paths with `*`, `?` or `[` that no file has. As in a shell, `*` does not stand for the dot of a
/// hidden file.
///
/// # Errors
/// A pattern that is malformed or without a match; a folder that it leads to and that cannot be read.
fn expanded(paths: &[PathBuf]) -> Result<Vec<PathBuf>, PictureError> {
    let mut all = Vec::new();
    for path in paths {
        let text = path.to_string_lossy();
        if !text.contains(['*', '?', '[']) || fs::symlink_metadata(path).is_ok() {
            all.push(path.clone());
            continue;
        }
        let matches = glob::glob(&text).map_err(|error| PictureError::Pattern {
            pattern: text.clone().into_owned(),
            why: error.to_string(),
        })?;
        let unreadable = |error: GlobError| {
            let path = error.path().into();
            PictureError::Io { path, source: error.into() }
        };
        let found: Result<Vec<_>, _> = matches.collect();
        let mut found = found.map_err(unreadable)?;
        found.retain(|path| !is_hidden_from(&text, path));
        if found.is_empty() {
            return Err(PictureError::NoMatch(text.into_owned()));
        }
        sort_naturally(&mut found);
        all.extend(found);
    }
    Ok(all)
}

/// True for a match with a hidden name that no part of the pattern with a dot in front stands for.
fn is_hidden_from(pattern: &str, path: &Path) -> bool {
    let mut names = path.iter().map(OsStr::to_string_lossy);
    names.any(|name| {
        let stands_for_it = |part: &str| {
            part.starts_with('.') && Pattern::new(part).is_ok_and(|part| part.matches(&name))
        };
        name.starts_with('.') && !pattern.split('/').any(stands_for_it)
    })
}

fn sort_naturally(paths: &mut [PathBuf]) {
    let bytes = |path: &'_ PathBuf| path.as_os_str().as_encoded_bytes().to_vec();
    paths.sort_by(|first, second| natural::compare(&bytes(first), &bytes(second)));
}

/// Finds the pictures in a folder; `None` if it is a recording.
fn in_folder(folder: &Path) -> Result<Option<Found>, PictureError> {
    let io_error = |source| PictureError::Io { path: folder.into(), source };
    let (mut pictures, mut folders, mut others) = (Vec::new(), Vec::new(), Vec::new());
    for entry in fs::read_dir(folder).map_err(io_error)? {
        let entry = entry.map_err(io_error)?;
        let path = entry.path();
        let is_hidden = name_of(&path).starts_with('.');
        match kind(&entry) {
            Some(kind) if kind.is_dir() => folders.push(path),
            // A link that leads nowhere is a picture that cannot be read.
            None => pictures.push(path),
            Some(kind) if kind.is_file() && has_ending(&path, &PICTURES) && !is_hidden => {
                pictures.push(path);
            }
            Some(_) => others.push(path),
        }
    }
    let is_description = |path: &PathBuf| name_of(path) == "metadata.yaml";
    if others.iter().any(is_description) || !kind::recordings(others.clone()).is_empty() {
        return Ok(None);
    }
    let names = |paths: Vec<PathBuf>| paths.iter().map(|path| name_of(path)).collect();
    let notes: Vec<_> = [
        listed(
            names(others),
            ["file that is not read as a picture", "files that are not read as pictures"],
        ),
        listed(
            names(folders),
            ["folder whose content is not read", "folders whose content is not read"],
        ),
    ]
    .into_iter()
    .flatten()
    .collect();
    if pictures.is_empty() {
        let others =
            if notes.is_empty() { String::new() } else { format!("; it has {}", notes.join("; ")) };
        return Err(PictureError::NoPictures { folder: folder.into(), others });
    }
    sort_naturally(&mut pictures);
    let name = name_of(folder);
    let notes =
        notes.iter().map(|note| format!("{}: beside the pictures: {note}", folder.display()));
    Ok(Some(Found { path: folder.into(), name, pictures, notes: notes.collect() }))
}

/// Last component of a path for users.
pub(super) fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// Kind of an entry, behind links; `None` for a link to a picture that cannot be followed.
fn kind(entry: &DirEntry) -> Option<FileType> {
    let path = entry.path();
    match entry.file_type() {
        Ok(kind) if !kind.is_symlink() => Some(kind),
        own => match fs::metadata(&path) {
            Ok(behind) => Some(behind.file_type()),
            Err(_) if has_ending(&path, &PICTURES) => None,
            Err(_) => own.ok(),
        },
    }
}

/// Names things by their number, what one or several of them are, and the first ones; `None` if there are none.
fn listed(mut names: Vec<String>, [one, several]: [&str; 2]) -> Option<String> {
    names.sort_by(|first, second| natural::compare(first.as_bytes(), second.as_bytes()));
    let num = names.len();
    let more = if num > MAX_LISTED { ", ..." } else { "" };
    names.truncate(MAX_LISTED);
    let what = if num == 1 { one } else { several };
    (num > 0).then(|| format!("{num} {what}: {}{more}", names.join(", ")))
}

/// Returns the path without the ending of a picture; an ending such as `.0001` stays.
pub(super) fn without_ending(path: &Path) -> PathBuf {
    if has_ending(path, &PICTURES) { path.with_extension("") } else { path.to_owned() }
}

fn has_ending(path: &Path, endings: &[&str]) -> bool {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    ending.is_some_and(|ending| endings.contains(&ending.as_str()))
}

/// True for the name of a picture and for a file that begins as one.
pub(crate) fn is_picture(path: &Path) -> bool {
    let begins_as_picture = || {
        let mut head = Vec::new();
        let is_file = fs::metadata(path).is_ok_and(|behind| behind.is_file());
        is_file
            && fs::File::open(path)
                .is_ok_and(|file| file.take(HEAD_BYTES).read_to_end(&mut head).is_ok())
            && FileKind::of(&head).is_some()
    };
    has_ending(path, &PICTURES) || begins_as_picture()
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;
    use std::os::unix::fs::{PermissionsExt as _, symlink};

    use super::*;

    fn folder(names: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for name in names {
            fs::write(folder.path().join(name), "").unwrap();
        }
        folder
    }

    fn names(found: &Found) -> Vec<String> {
        let name = |path: &PathBuf| path.file_name().unwrap().to_string_lossy().into_owned();
        found.pictures.iter().map(name).collect()
    }

    fn only(inputs: &[Input]) -> &Found {
        match inputs {
            [Input::Pictures(found)] => found,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn pictures_of_a_folder_are_in_natural_order_and_the_rest_is_named() {
        let folder =
            folder(&["b10.PNG", "b9.png", "a.jpeg", "c.pgm", "notes.txt", "t.csv", "._b9.png"]);
        fs::create_dir(folder.path().join("deeper.png")).unwrap();
        symlink("/nowhere/at/all", folder.path().join("d.tiff")).unwrap();
        symlink("/nowhere/at/all", folder.path().join("d.txt")).unwrap();
        let inputs = sort(&[folder.path().into()]).unwrap();
        let found = only(&inputs);
        assert_eq!(names(found), ["a.jpeg", "b9.png", "b10.PNG", "c.pgm", "d.tiff"]);
        let notes = found.notes.join("\n");
        assert!(
            notes
                .contains("4 files that are not read as pictures: ._b9.png, d.txt, notes.txt, ..."),
            "{notes}"
        );
        assert!(notes.contains("1 folder whose content is not read: deeper.png"), "{notes}");
    }

    #[test]
    fn a_folder_with_a_recording_is_a_recording() {
        for name in ["metadata.yaml", "x_0.mcap", "x.db3", "x.bag", "x.mcap.zstd"] {
            let folder = folder(&["a.png", name]);
            let inputs = sort(&[folder.path().into()]).unwrap();
            assert_eq!(inputs, [Input::Recording(folder.path().into())], "{name}");
        }
    }

    #[test]
    fn the_content_tells_a_recording_and_not_only_its_name() {
        let packed = |content: &[u8]| zstd::encode_all(content, 1).unwrap();
        for (name, content, is_recording) in [
            ("night_scan", mcap::MAGIC.to_vec(), true),
            ("x", b"SQLite format 3\0".to_vec(), true),
            ("x.zstd", packed(mcap::MAGIC), true),
            ("pictures.tar.zstd", packed(b"an archive"), false),
            ("pictures.tar.zstd", vec![], false),
            ("x.txt", b"text".to_vec(), false),
        ] {
            let folder = folder(&["a.png"]);
            fs::write(folder.path().join(name), content).unwrap();
            let inputs = sort(&[folder.path().into()]).unwrap();
            assert_eq!(matches!(inputs[..], [Input::Recording(_)]), is_recording, "{name}");
        }
        let folder = folder(&["a.png"]);
        fs::create_dir(folder.path().join("x.mcap")).unwrap();
        let inputs = sort(&[folder.path().into()]).unwrap();
        assert!(only(&inputs).notes[0].contains("1 folder whose content is not read: x.mcap"));
    }

    #[test]
    fn a_folder_without_pictures_names_what_it_has() {
        let empty = folder(&[]);
        let error = sort(&[empty.path().into()]).unwrap_err().to_string();
        assert!(error.ends_with("nor pictures (PNG, JPEG, TIFF, BMP or PGM)"), "{error}");
        let other = folder(&["a.txt", ".hidden.png"]);
        fs::create_dir(other.path().join("left")).unwrap();
        let error = sort(&[other.path().into()]).unwrap_err().to_string();
        assert!(
            error.contains("2 files") && error.contains("a.txt") && error.contains("left"),
            "{error}"
        );
    }

    #[test]
    fn single_files_are_one_series_in_natural_order() {
        let folder = folder(&["img10.png", "img2.png", "x_0.mcap"]);
        let path = |name: &str| folder.path().join(name);
        fs::write(path("raw"), b"P5 1 1 255\n0").unwrap();
        let given = ["x_0.mcap", "img10.png", "raw", "img2.png", "img2.png"].map(path);
        let inputs = sort(&given).unwrap();
        let [Input::Recording(bag), Input::Pictures(found)] = &inputs[..] else {
            panic!("{inputs:?}")
        };
        assert_eq!(*bag, path("x_0.mcap"));
        assert_eq!(names(found), ["img2.png", "img10.png", "raw"]);
        assert_eq!(found.name, "img2.png to raw");
        assert!(found.notes[0].contains("named twice"));
    }

    #[test]
    fn patterns_are_expanded_unless_a_file_has_that_name() {
        let folder = folder(&["img10.png", "img2.png", "[a]*.png", "other.txt"]);
        let inputs = sort(&[folder.path().join("img*.png")]).unwrap();
        assert_eq!(names(only(&inputs)), ["img2.png", "img10.png"]);
        let inputs = sort(&[folder.path().join("[a]*.png")]).unwrap();
        assert_eq!(names(only(&inputs)), ["[a]*.png"]);
        let error = sort(&[folder.path().join("x*.png")]).unwrap_err().to_string();
        assert!(error.ends_with("x*.png: no file has such a name"), "{error}");
        assert!(sort(&[folder.path().join("x***.png")]).is_err());
    }

    #[test]
    fn patterns_do_not_match_hidden_files_unless_they_begin_with_a_dot() {
        let folder = folder(&["a.png", ".b.png", "._a.png"]);
        let inputs = sort(&[folder.path().join("*.png")]).unwrap();
        assert_eq!(names(only(&inputs)), ["a.png"]);
        let inputs = sort(&[folder.path().join(".*.png")]).unwrap();
        assert_eq!(names(only(&inputs)), ["._a.png", ".b.png"]);
    }

    #[test]
    fn a_pattern_into_a_folder_that_cannot_be_read_is_an_error() {
        let folder = folder(&["a.png"]);
        let locked = folder.path().join("locked");
        fs::create_dir(&locked).unwrap();
        fs::set_permissions(&locked, fs::Permissions::from_mode(0o0)).unwrap();
        if fs::read_dir(&locked).is_ok() {
            // Not by `eprintln!`, which the test harness hides when a test passes.
            let skipped = b"SKIPPED a locked folder: root reads every folder\n";
            std::io::stderr().write_all(skipped).unwrap();
            return;
        }
        let error = sort(&[folder.path().join("*/*.png")]).unwrap_err().to_string();
        assert!(error.contains("locked") && error.contains("denied"), "{error}");
    }

    #[test]
    fn a_missing_path_is_left_to_the_reader() {
        assert_eq!(sort(&["/missing".into()]).unwrap(), [Input::Recording("/missing".into())]);
    }
}
