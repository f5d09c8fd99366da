//! Lists that are wrong, and the files beside them.

use super::*;

/// A directory with these files; `*` stands for the content of a finished MCAP file.
fn bag(files: &[(&str, &str)]) -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    for (name, content) in files {
        let finished = [mcap::MAGIC, mcap::MAGIC].concat();
        let bytes = if *content == "*" { finished } else { content.as_bytes().to_vec() };
        let is_packed = name.contains(".zstd") && !bytes.is_empty();
        let bytes = if is_packed { zstd::encode_all(&bytes[..], 1).unwrap() } else { bytes };
        fs::write(directory.path().join(name), bytes).unwrap();
    }
    directory
}

fn metadata(files: &str) -> String {
    format!(
        "rosbag2_bagfile_information:\n  version: 9\n  storage_identifier: mcap\n  relative_file_paths: [{files}]\n"
    )
}

/// Names of the files, those that are not read with the word `lost`; and the notes.
fn names(directory: &Path) -> (String, String) {
    let found = find(directory).unwrap();
    let word = |file: &FoundFile| {
        let is_lost = file.lost.is_some();
        name(&file.path) + if is_lost { " lost" } else { "" }
    };
    (
        found.files.iter().map(word).collect::<Vec<_>>().join(", "),
        found.notes.join("\n").replace(&format!("{}: ", directory.display()), ""),
    )
}

#[test]
fn files_beside_a_wrong_list_are_found() {
    for (list, files, found, note) in [
        ("a_0.mcap, a_1.mcap", "a_0.mcap", "a_0.mcap, a_1.mcap lost", ""),
        (
            "old_0.mcap",
            "new.mcap",
            "old_0.mcap lost, new.mcap",
            "does not list new.mcap; it is read",
        ),
        (
            "a_0.mcap",
            "a_0.mcap a_1.mcap a_10.mcap",
            "a_0.mcap, a_1.mcap, a_10.mcap",
            "a_1.mcap, a_10.mcap; they are read",
        ),
        (
            "a_0.mcap",
            "a_0.mcap b.mcap",
            "a_0.mcap",
            "does not list b.mcap; it is not read; to read it, name its own path",
        ),
        ("", "b_10.mcap b_9.mcap", "b_9.mcap, b_10.mcap", "they are read"),
        ("a.mcap.zstd", "a.mcap", "a.mcap", "lists \"a.mcap.zstd\"; a.mcap beside it is read"),
        ("a.mcap", "a.mcap.zstd", "a.mcap.zstd", "lists \"a.mcap\"; a.mcap.zstd beside it is read"),
        ("bag/a.mcap", "a.mcap", "a.mcap", "a.mcap beside it is read"),
        ("/gone/a.mcap", "a.mcap", "a.mcap", "a.mcap beside it is read"),
        ("../secret.mcap", "a.mcap", "secret.mcap lost, a.mcap", "a.mcap; it is read"),
        ("a.mcap, a.mcap", "a.mcap", "a.mcap", ""),
        ("a_0.mcap", "a_0.mcap renamed", "a_0.mcap", "does not list renamed; it is not read"),
    ] {
        let described = metadata(list);
        let mut all = vec![("metadata.yaml", described.as_str())];
        all.extend(files.split(' ').map(|name| (name, "*")));
        let directory = bag(&all);
        let (names, notes) = names(directory.path());
        assert_eq!(names, found, "{list} beside {files}: {notes}");
        assert!(notes.contains(note) && notes.is_empty() == note.is_empty(), "{list}: {notes}");
    }
}

#[test]
fn empty_and_foreign_files_cost_only_themselves() {
    for content in ["", "short", "a diary of a scan"] {
        for list in ["a_0.mcap, a_1.mcap, a_2.mcap", "a_0.mcap"] {
            let directory = bag(&[
                ("metadata.yaml", &metadata(list)),
                ("a_0.mcap", "*"),
                ("a_1.mcap", content),
                ("a_2.mcap", "*"),
                ("notes.txt", "a diary of a scan"),
            ]);
            assert_eq!(names(directory.path()).0, "a_0.mcap, a_1.mcap lost, a_2.mcap");
        }
    }
}

#[test]
fn an_unreadable_file_does_not_make_other_recordings_part_of_the_bag() {
    for content in ["", "short", "a diary of a scan", "SQLite format 3\0"] {
        let directory = bag(&[
            ("metadata.yaml", &metadata("a_0.mcap, a_1.mcap")),
            ("a_0.mcap", "*"),
            ("a_1.mcap", content),
            ("a_2.mcap", "*"),
            ("other.mcap", "*"),
        ]);
        let (names, notes) = names(directory.path());
        assert_eq!(names, "a_0.mcap, a_1.mcap lost, a_2.mcap", "{content:?}");
        assert!(notes.contains("does not list other.mcap; it is not read"), "{notes}");
    }
}

#[test]
fn if_nothing_listed_can_be_read_the_error_names_the_recordings_beside_it() {
    let directory =
        bag(&[("metadata.yaml", &metadata("a_0.mcap")), ("a_0.mcap", ""), ("other.mcap", "*")]);
    let error = find(directory.path()).unwrap_err().to_string();
    assert!(error.contains("a_0.mcap: not an MCAP file: the file is empty"), "{error}");
    assert!(error.contains("not in metadata.yaml is other.mcap: name its own path"), "{error}");
}

#[test]
fn of_a_file_and_its_compressed_form_the_whole_one_is_read() {
    for (plain, packed, read) in [
        ("*", "*", "a_0.mcap"),
        ("*", "", "a_0.mcap"),
        ("", "*", "a_0.mcap.zstd"),
        ("not finished", "*", "a_0.mcap.zstd"),
    ] {
        for list in [Some("a_0.mcap"), Some("a_0.mcap.zstd"), None] {
            let described = list.map(metadata);
            let mut files = vec![("a_0.mcap", plain), ("a_0.mcap.zstd", packed)];
            files.extend(described.iter().map(|text| ("metadata.yaml", text.as_str())));
            let directory = bag(&files);
            assert_eq!(names(directory.path()).0, read, "{list:?} {plain:?} {packed:?}");
        }
    }
}

#[test]
fn without_metadata_the_files_are_sorted_by_number_and_a_note_reports_it() {
    for broken in [None, Some("no: [yaml"), Some("rosbag2_bagfile_information: 3"), Some("")] {
        let directory =
            bag(&[("a_10.mcap", "*"), ("a_2.mcap", "*"), ("a_3.mcap.zstd", "*"), ("x", "")]);
        if let Some(text) = broken {
            fs::write(directory.path().join("metadata.yaml"), text).unwrap();
        }
        let (names, notes) = names(directory.path());
        assert_eq!(names, "a_2.mcap, a_3.mcap.zstd, a_10.mcap");
        assert!(notes.contains("metadata.yaml is"), "{notes:?}");
    }
}

#[test]
fn a_directory_in_which_nothing_can_be_read_names_the_reasons() {
    let error = |files: &[(&str, &str)]| find(bag(files).path()).unwrap_err().to_string();
    assert!(error(&[("a.txt", "")]).contains("neither metadata.yaml nor an .mcap file"));
    let gone = error(&[("metadata.yaml", &metadata("gone_0.mcap"))]);
    assert!(gone.contains("gone_0.mcap: the file is missing"), "{gone}");
    for list in ["../secret.mcap", "/etc/passwd", "a/../../b.mcap", "''", "."] {
        let outside = error(&[("metadata.yaml", &metadata(list))]);
        assert!(outside.contains("the file is missing"), "{list}: {outside}");
    }
    let sqlite = error(&[("a.db3", "SQLite format 3\0")]);
    assert!(sqlite.contains("rosbags-convert") && sqlite.contains("ros2 bag convert"), "{sqlite}");
    let ros1 = error(&[("a.bag", "#ROSBAG V2.0\n")]);
    assert!(ros1.contains("a.bag --dst") && ros1.contains("--dst-storage mcap"), "{ros1}");
}

#[test]
fn the_description_stands_for_its_bag() {
    let directory = bag(&[("metadata.yaml", &metadata("a.mcap")), ("a.mcap", "*")]);
    let found = find(&directory.path().join("metadata.yaml")).unwrap();
    assert_eq!(found.files[0].path, directory.path().join("a.mcap"));
}
