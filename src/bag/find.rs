//! Finds the files of a bag: those that `metadata.yaml` lists, and those beside it if it is missing or wrong.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::fs;
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Component, Path, PathBuf};

use super::convert;
use super::kind::{self, Content, Kind, is_finished};
use super::metadata::BagInformation;
use super::{BagError, place};

/// Maximum number of files named in a note or an error.
const MAX_NAMED: usize = 10;

/// Maximum number of files of a bag. Each takes memory as long as the bag is open.
const MAX_FILES: usize = 10_000;

/// The files of a bag, and notes for the user about the search.
#[derive(Debug, Default)]
pub(super) struct Found {
    /// The files in order.
    pub(super) files: Vec<FoundFile>,
    /// Notes about everything that differs from `metadata.yaml`.
    pub(super) notes: Vec<String>,
    /// True if the order of the files is only that of their names.
    pub(super) is_order_unknown: bool,
    /// Number of messages according to `metadata.yaml`; `None` if it states none.
    pub(super) stated_messages: Option<u64>,
    /// True if the messages are compressed one by one according to `metadata.yaml`.
    pub(super) has_packed_messages: bool,
}

/// One file of a bag.
#[derive(Debug)]
pub(super) struct FoundFile {
    pub(super) path: PathBuf,
    /// The reason why the file is not read; `None` if it is.
    pub(super) lost: Option<String>,
    /// Relation to `metadata.yaml`.
    pub(super) state: State,
}

/// Relation of a file to `metadata.yaml`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    /// Listed, and there.
    Listed,
    /// Listed, but neither it nor another form of it is there.
    Missing,
    /// Not listed.
    Unlisted,
}

/// Finds the files of a rosbag2 directory or a bare file.
///
/// # Errors
/// The path does not exist, or nothing in the directory can be read.
pub(super) fn find(path: &Path) -> Result<Found, BagError> {
    let io_error = |source| BagError::Io { path: path.into(), source };
    if !fs::metadata(path).map_err(io_error)?.is_dir() {
        let is_description = path.file_name() == Some(OsStr::new("metadata.yaml"));
        return match path.parent() {
            Some(parent) if is_description => {
                find(if parent.as_os_str().is_empty() { Path::new(".") } else { parent })
            }
            _ => bare(path),
        };
    }
    let beside = Beside::of(path).map_err(io_error)?;
    let mut found = match place::read_metadata(&path.join("metadata.yaml")) {
        Ok(information) => listed(path, &information, &beside),
        Err(error) => {
            let why = match error.kind() {
                io::ErrorKind::NotFound => "metadata.yaml is missing".into(),
                _ => format!("metadata.yaml is unreadable ({error})"),
            };
            let notes =
                vec![format!("{}: {why}; reading the recordings beside it", path.display())];
            Found { notes, is_order_unknown: true, ..Found::default() }
        }
    };
    found.add_unlisted(path, &beside);
    if found.files.iter().any(|file| file.lost.is_none()) {
        return Ok(found);
    }
    Err(nothing(path, &found, &beside))
}

/// A path that is no directory.
fn bare(path: &Path) -> Result<Found, BagError> {
    if !path.is_file() {
        let why = "it is a pipe or a device, and reading needs random access; store it in a file";
        return Err(BagError::NotMcap { path: path.into(), why: why.into() });
    }
    let kind = Kind::of(path).map_err(|source| BagError::Io { path: path.into(), source })?;
    if !kind.is_readable() {
        let why = if kind.is_packed {
            // Other programs do not read them compressed.
            format!("{}; unpack it with unzstd first", kind.refusal())
        } else {
            kind.refusal() + &convert::advice(path, kind.content)
        };
        return Err(BagError::NotMcap { path: path.into(), why });
    }
    let file = FoundFile { path: path.into(), lost: None, state: State::Listed };
    Ok(Found { files: vec![file], ..Found::default() })
}

/// The error for a directory in which nothing can be read.
fn nothing(directory: &Path, found: &Found, beside: &Beside) -> BagError {
    let advice = beside.files.iter().find_map(|(path, kind)| match kind.content {
        Content::Sqlite => Some(convert::advice(directory, kind.content)),
        Content::Ros1 => Some(convert::advice(path, kind.content)),
        _ => None,
    });
    let mut reasons: Vec<_> = found
        .files
        .iter()
        .filter_map(|file| Some((&file.path, file.lost.as_ref()?)))
        .map(|(path, why)| format!("{}: {why}", name(path)))
        .collect();
    if reasons.is_empty() {
        return BagError::NoBag(directory.into());
    }
    shorten(&mut reasons);
    let is_known = |path: &PathBuf| found.files.iter().any(|file| file.path == *path);
    let mut others: Vec<_> = beside
        .files
        .iter()
        .filter(|(path, kind)| kind.is_readable() && !is_known(path))
        .map(|(path, _)| name(path))
        .collect();
    if !others.is_empty() {
        shorten(&mut others);
        reasons.push(format!("not in metadata.yaml is {}: name its own path", others.join(", ")));
    }
    let why = reasons.join("; ") + &advice.unwrap_or_default();
    BagError::NothingReadable { path: directory.into(), why }
}

fn shorten(texts: &mut Vec<String>) {
    if texts.len() > MAX_NAMED {
        let rest = texts.len() - MAX_NAMED;
        texts.truncate(MAX_NAMED);
        texts.push(format!("{rest} more"));
    }
}

/// The recordings in a directory.
struct Beside {
    /// Path and kind, in order of name.
    files: Vec<(PathBuf, Kind)>,
    kinds: BTreeMap<PathBuf, Kind>,
}

impl Beside {
    fn of(directory: &Path) -> io::Result<Self> {
        let entries = fs::read_dir(directory)?;
        let mut paths = entries.map(|entry| Ok(entry?.path())).collect::<io::Result<Vec<_>>>()?;
        paths.sort_by_cached_key(|path| natural_key(path));
        let mut beside = Self { files: kind::recordings(paths), kinds: BTreeMap::new() };
        beside.drop_twins();
        beside.kinds.extend(beside.files.iter().cloned());
        Ok(beside)
    }

    /// Of a file and its compressed form, keeps one. The uncompressed one is whole if its writer finished it: rosbag2
    /// deletes it only after the other is complete.
    fn drop_twins(&mut self) {
        let readable: BTreeSet<_> = self
            .files
            .iter()
            .filter(|(_, kind)| kind.is_readable())
            .map(|(path, _)| path.clone())
            .collect();
        self.files.retain(|(path, kind)| {
            let other = other_form(path);
            let plain = if kind.is_packed { &other } else { path };
            !readable.contains(&other) || kind.is_packed != is_finished(plain)
        });
    }

    fn kind(&self, path: &Path) -> Option<Kind> {
        self.kinds.get(path).copied()
    }
}

/// The files that `metadata.yaml` lists.
fn listed(directory: &Path, information: &BagInformation, beside: &Beside) -> Found {
    let mut found = Found {
        stated_messages: Some(information.message_count).filter(|count| *count > 0),
        has_packed_messages: information.has_packed_messages(),
        ..Found::default()
    };
    let num_listed = information.relative_file_paths.len();
    let mut known = BTreeSet::new();
    for entry in information.relative_file_paths.iter().take(MAX_FILES) {
        let path = match present(directory, entry, beside) {
            Some(path) if !known.insert(Identity::of(&path)) => continue,
            Some(path) => path,
            None if !known.insert(Identity::Missing(entry.clone())) => continue,
            None => {
                let counted = information.files.iter().find(|file| file.path == *entry);
                let counted = counted.map_or_else(String::new, |file| {
                    format!(" and states {} messages in it", file.message_count)
                });
                let lost = format!("the file is missing; metadata.yaml lists it{counted}");
                let path = directory.join(name(Path::new(entry)));
                found.files.push(FoundFile { path, lost: Some(lost), state: State::Missing });
                continue;
            }
        };
        if directory.join(entry) != path {
            found.notes.push(format!(
                "{}: metadata.yaml lists {entry:?}; {} beside it is read instead",
                directory.display(),
                name(&path)
            ));
        }
        let kind = beside.kind(&path).map_or_else(|| Kind::of(&path), Ok);
        let lost = match kind {
            Ok(kind) if kind.is_readable() => None,
            Ok(kind) => Some(kind.refusal()),
            Err(error) => Some(error.to_string()),
        };
        found.files.push(FoundFile { path, lost, state: State::Listed });
    }
    if num_listed > MAX_FILES {
        let lost = format!("it lists {num_listed} files, of which the first {MAX_FILES} are read");
        let path = directory.join("metadata.yaml");
        found.files.push(FoundFile { path, lost: Some(lost), state: State::Listed });
    }
    found
}

/// Identity of a file, which may have many names by links.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Identity {
    /// Number of the device, and of the file on it.
    File(u64, u64),
    Missing(String),
}

impl Identity {
    fn of(path: &Path) -> Self {
        match fs::metadata(path) {
            Ok(found) => Self::File(found.dev(), found.ino()),
            Err(_gone) => Self::Missing(path.to_string_lossy().into_owned()),
        }
    }
}

/// Returns the file that an entry names, or another form of it: in this directory instead of another, unpacked, or
/// packed.
fn present(directory: &Path, entry: &str, beside: &Beside) -> Option<PathBuf> {
    let here = directory.join(Path::new(entry).file_name()?);
    let named = Some(directory.join(entry)).filter(|_| stays_inside(Path::new(entry)));
    named.into_iter().chain([here]).find_map(|path| {
        let other = other_form(&path);
        if beside.kind(&path).is_some() {
            Some(path)
        } else if beside.kind(&other).is_some() {
            Some(other)
        } else {
            Some(path).filter(|path| path.is_file())
        }
    })
}

/// `a.mcap` for `a.mcap.zstd` and the reverse.
fn other_form(path: &Path) -> PathBuf {
    if path.extension() == Some(OsStr::new("zstd")) {
        return path.with_extension("");
    }
    let mut packed = path.as_os_str().to_owned();
    packed.push(".zstd");
    packed.into()
}

impl Found {
    /// Adds files beside `metadata.yaml` that it does not list: all of them if it is missing or a listed file is, else
    /// those that continue the numbers of the listed ones, which an interrupted recording leaves.
    fn add_unlisted(&mut self, directory: &Path, beside: &Beside) {
        // A listed file that is there but cannot be read has no other name.
        let is_missing = |file: &FoundFile| file.state == State::Missing;
        let is_wrong = self.files.is_empty() || self.files.iter().any(is_missing);
        let series: BTreeSet<_> = self.files.iter().map(|file| natural_key(&file.path).0).collect();
        let has_list = !self.is_order_unknown;
        let mut known: BTreeSet<_> = self.files.iter().map(|it| Identity::of(&it.path)).collect();
        let (mut read, mut ignored) = (Vec::new(), Vec::new());
        for (path, kind) in &beside.files {
            if !known.insert(Identity::of(path)) {
                continue;
            }
            if !is_wrong && !series.contains(&natural_key(path).0) {
                ignored.push(name(path));
                continue;
            }
            if self.files.len() + read.len() >= MAX_FILES {
                let lost = format!("beyond the {MAX_FILES} files of a bag that are read");
                let path = path.clone();
                read.push(FoundFile { path, lost: Some(lost), state: State::Unlisted });
                break;
            }
            let lost = Some(kind.refusal()).filter(|_| !kind.is_readable());
            read.push(FoundFile { path: path.clone(), lost, state: State::Unlisted });
        }
        if has_list && !read.is_empty() {
            self.note(directory, "it is read", read.iter().map(|file| name(&file.path)).collect());
        }
        self.is_order_unknown |= !read.is_empty();
        self.files.append(&mut read);
        if !ignored.is_empty() {
            self.note(directory, "it is not read; to read it, name its own path", ignored);
        }
    }

    fn note(&mut self, directory: &Path, what: &str, mut names: Vec<String>) {
        shorten(&mut names);
        let what = if names.len() > 1 { what.replace("it is", "they are") } else { what.into() };
        let (directory, names) = (directory.display(), names.join(", "));
        self.notes.push(format!("{directory}: metadata.yaml does not list {names}; {what}"));
    }
}

/// True if a path of `metadata.yaml` cannot leave the directory.
pub(super) fn stays_inside(path: &Path) -> bool {
    path.components().all(|component| matches!(component, Component::Normal(_) | Component::CurDir))
        && path.file_name().is_some()
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// Sort key that puts `name_2` before `name_10`: the text before the trailing number, the number, the whole path.
fn natural_key(path: &Path) -> (String, u64, PathBuf) {
    let mut stem = name(path);
    for ending in [".zstd", ".mcap", ".db3", ".bag"] {
        if let Some(rest) = stem.strip_suffix(ending) {
            stem = rest.to_owned();
        }
    }
    let prefix = stem.trim_end_matches(|character: char| character.is_ascii_digit()).to_owned();
    let number = stem.strip_prefix(&prefix).and_then(|digits| digits.parse().ok());
    (prefix, number.unwrap_or(0), path.into())
}

#[cfg(test)]
mod tests;
