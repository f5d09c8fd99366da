//! Where files may lie that peers name: those on the network set parameters, and must not make the node read or write
//! anywhere.

use std::{
    collections::BTreeSet,
    env, fs, io,
    path::{Component, Path, PathBuf},
};

use crate::ros::{
    parameters::Parameters,
    table::{ALLOWED_DIRECTORIES, is_directory, is_path},
    value::Value,
};

/// Directories in which peers may name files, and everything below them.
#[derive(Clone, Debug, Default)]
pub(crate) struct AllowedDirectories(BTreeSet<PathBuf>);

impl AllowedDirectories {
    /// Returns the directories that the values at the start allow: the working directory, those of the parameter files
    /// and of the files that they and `-p` name, and those of `allowed_directories`.
    pub(crate) fn of(values: &Parameters) -> Self {
        let mut allowed = Self::default();
        allowed.add_unless_root(env::current_dir());
        for declared in values.iter() {
            let base = declared.base();
            // A file on the command line has no directory of its own, and the working directory is there already.
            if !base.as_os_str().is_empty() {
                allowed.add_unless_root(Ok(base.to_owned()));
            }
            match declared.value() {
                Value::Text(path) if is_path(declared.row()) && !path.is_empty() => {
                    let path = base.join(path);
                    let directory =
                        if is_directory(declared.row()) { Some(&*path) } else { path.parent() };
                    allowed.add_unless_root(directory.map(Path::to_owned).ok_or_else(no_parent));
                }
                Value::TextList(paths) if declared.name() == ALLOWED_DIRECTORIES => {
                    // Whoever names the root means it.
                    for path in paths {
                        allowed.add(&base.join(path));
                    }
                }
                _ => {}
            }
        }
        allowed
    }

    /// Adds a directory that nobody named. A service started in the root would allow everything.
    fn add_unless_root(&mut self, directory: io::Result<PathBuf>) {
        if let Ok(directory) = directory
            && resolved(&directory).is_ok_and(|directory| directory.parent().is_some())
        {
            self.add(&directory);
        }
    }

    fn add(&mut self, directory: &Path) {
        // One that cannot be resolved allows nothing.
        self.0.extend(resolved(directory));
    }

    /// Checks the paths that differ from the values before.
    ///
    /// # Errors
    /// The reason as text: a path leaves the allowed directories.
    pub(crate) fn check(&self, before: &Parameters, after: &Parameters) -> Result<(), String> {
        for declared in after.iter().filter(|declared| is_path(declared.row())) {
            let is_same = before
                .get(declared.name())
                .is_some_and(|it| it.value() == declared.value() && it.base() == declared.base());
            if let (false, Value::Text(path)) = (is_same, declared.value()) {
                self.check_path(Path::new(path))
                    .map_err(|reason| format!("{}: {path:?} {reason}", declared.name()))?;
            }
        }
        Ok(())
    }

    /// The answer is the same for all that lies outside, so that nobody learns what is there.
    fn check_path(&self, path: &Path) -> Result<(), String> {
        if path.as_os_str().is_empty() {
            return Ok(());
        }
        if path.components().any(|part| part == Component::ParentDir) {
            return Err("must not contain `..`".to_owned());
        }
        let is_inside =
            resolved(path).is_ok_and(|path| self.0.iter().any(|it| path.starts_with(it)));
        if is_inside {
            return Ok(());
        }
        let allowed: Vec<_> = self.0.iter().map(|it| it.display().to_string()).collect();
        let allowed = if allowed.is_empty() { "none".to_owned() } else { allowed.join(", ") };
        Err(format!(
            "is outside the directories that a running node may use: {allowed}; name it or one above it in \
             {ALLOWED_DIRECTORIES} when starting the node"
        ))
    }
}

fn no_parent() -> io::Error {
    io::ErrorKind::InvalidInput.into()
}

/// Follows the links of the part of a path that exists.
fn resolved(path: &Path) -> io::Result<PathBuf> {
    let path = std::path::absolute(path)?;
    let mut missing = Vec::new();
    for existing in path.ancestors() {
        // A link to nothing exists too, and would be followed when it is written.
        if fs::symlink_metadata(existing).is_ok() {
            let mut whole = fs::canonicalize(existing)?;
            whole.extend(missing.iter().rev());
            return Ok(whole);
        }
        missing.extend(existing.file_name());
    }
    Err(io::ErrorKind::NotFound.into())
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    fn text(path: &Path) -> Value {
        Value::Text(path.to_str().unwrap().to_owned())
    }

    /// A node that was started with one calibration, and a directory that is allowed besides.
    fn start(place: &Path) -> (Parameters, AllowedDirectories) {
        for name in ["own", "more/below", "secret"] {
            fs::create_dir_all(place.join(name)).unwrap();
        }
        fs::write(place.join("secret/key"), "s").unwrap();
        let mut values = Parameters::default();
        let bags = place.join("bags");
        let more = Value::TextList(vec![place.join("more").to_str().unwrap().to_owned()]);
        values.set("calibration_file", text(&place.join("own/c.yaml")), "-p").unwrap();
        values.set("recording.directory", text(&bags), "-p").unwrap();
        values.set(ALLOWED_DIRECTORIES, more, "-p").unwrap();
        let allowed = AllowedDirectories::of(&values);
        (values, allowed)
    }

    #[test]
    fn peers_name_files_where_the_operator_did() {
        let place = tempfile::tempdir().unwrap();
        let place = place.path();
        let (before, allowed) = start(place);
        symlink(place.join("secret"), place.join("own/link")).unwrap();
        symlink(place.join("secret/key"), place.join("own/key")).unwrap();
        symlink(place.join("nowhere"), place.join("own/dangling")).unwrap();
        symlink(place.join("more"), place.join("own/inside")).unwrap();
        let set = |name: &str, path: &Path| {
            let mut after = before.clone();
            after.set(name, text(path), "refused").unwrap();
            allowed.check(&before, &after)
        };
        let within = ["own/other.yaml", "more/below/new/c.yaml", "own/inside/c.yaml"];
        let outside = [
            "secret/key",
            "own/../secret/key",
            "own/link/key",
            "own/key",
            "own/dangling",
            "secret/missing",
            "ownership/c.yaml",
        ];
        for name in ["calibration_file", "extraction.background_file", "recording.directory"] {
            for path in within {
                set(name, &place.join(path)).unwrap();
            }
            for path in outside {
                let reason = set(name, &place.join(path)).unwrap_err();
                assert!(reason.starts_with(name) && reason.contains(path), "{reason}");
            }
            for path in ["/etc/passwd", "/dev/zero", "/"] {
                let reason = set(name, Path::new(path)).unwrap_err();
                assert!(reason.contains(ALLOWED_DIRECTORIES), "{reason}");
            }
            set(name, Path::new("below_the_working_directory")).unwrap();
            assert!(set(name, Path::new("../above")).unwrap_err().contains("`..`"));
        }
        set("recording.directory", &place.join("bags/today")).unwrap();
        set("calibration_file", Path::new("")).unwrap();
    }

    #[test]
    fn what_is_there_is_not_told() {
        let place = tempfile::tempdir().unwrap();
        let (before, allowed) = start(place.path());
        let reason = |name: &str| {
            let mut after = before.clone();
            after.set("calibration_file", text(&place.path().join(name)), "refused").unwrap();
            allowed.check(&before, &after).unwrap_err().replace(name, "X")
        };
        assert_eq!(reason("secret/key"), reason("secret/missing"));
    }

    #[test]
    fn values_of_the_start_stay_as_they_are() {
        let place = tempfile::tempdir().unwrap();
        symlink("/etc/hostname", place.path().join("c.yaml")).unwrap();
        let mut before = Parameters::default();
        before.set("calibration_file", text(&place.path().join("c.yaml")), "-p").unwrap();
        before.set("extraction.background_file", text(Path::new("/a.png")), "-p").unwrap();
        let allowed = AllowedDirectories::of(&before);
        let mut after = before.clone();
        after.set("slice.profiles", Value::Integer(7), "refused").unwrap();
        allowed.check(&before, &after).unwrap();
        // A dump of the node sets all of its values.
        after.set("calibration_file", text(&place.path().join("c.yaml")), "a peer").unwrap();
        allowed.check(&before, &after).unwrap();
        after.set("extraction.background_file", text(Path::new("/etc/passwd")), "refused").unwrap();
        assert!(allowed.check(&before, &after).is_err(), "a file in the root allows no other");
    }
}
