//! The architecture as a test: the source obeys ARCHITECTURE.md.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use laser_profiler::simulate::scene_from_yaml;

use crate::program::{end, laser_profiler};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");
const MAX_LINES: usize = 400;

/// The modules that each module may use.
const MAY_USE: [(&str, &[&str]); 16] = [
    ("parameters", &[]),
    ("statistics", &[]),
    ("scanner", &["parameters", "statistics"]),
    ("metrology", &["scanner", "statistics"]),
    ("simulate", &["scanner"]),
    ("evaluate", &["scanner", "simulate", "statistics"]),
    ("calibrate", &["metrology", "scanner", "statistics"]),
    ("msg", &["scanner"]),
    ("results", &["bag", "msg", "metrology", "scanner", "statistics"]),
    ("report", &["results", "bag", "msg", "scanner", "statistics"]),
    ("ros", &["msg", "parameters", "scanner"]),
    ("bag", &["msg"]),
    ("foxglove", &["msg"]),
    // Only in builds of cargo-fuzz.
    ("fuzzing", &["bag", "msg", "ros", "scanner"]),
    ("node", &["ros", "bag", "foxglove", "msg", "parameters", "scanner"]),
    (
        "cli",
        &[
            "node",
            "ros",
            "bag",
            "results",
            "report",
            "msg",
            "scanner",
            "simulate",
            "evaluate",
            "metrology",
            "calibrate",
            "parameters",
            "statistics",
        ],
    ),
];

/// Words that pure modules must not contain.
const PURE: [&str; 9] = [
    "parameters",
    "statistics",
    "scanner",
    "metrology",
    "simulate",
    "evaluate",
    "calibrate",
    "msg",
    "report",
];
const IMPURE: [&str; 14] = [
    "std::fs",
    "std::net",
    "std::io",
    "std::thread",
    "std::process",
    "std::env",
    "std::time",
    "Instant",
    "SystemTime",
    "tokio",
    "async ",
    ".await",
    "Mutex",
    "atomic::",
];

/// Marks of unfinished code, and printing that bypasses the writer passed to commands.
const FORBIDDEN: [&str; 9] =
    ["todo!", "unimplemented!", "dbg!", "#[ignore", "FIXME", "TODO", "XXX", "println!", "eprint!"];

/// Every file of the repository that git has or would take, by its path from the root.
fn files() -> Vec<PathBuf> {
    let mut command = Command::new("git");
    command.args(["ls-files", "--cached", "--others", "--exclude-standard"]).current_dir(ROOT);
    let listed = end(&mut command);
    assert_eq!(listed.code, Some(0), "{listed:?}");
    listed
        .stdout
        .lines()
        .map(PathBuf::from)
        .filter(|path| Path::new(ROOT).join(path).is_file())
        .collect()
}

fn files_ending_in(ending: &str) -> Vec<PathBuf> {
    files().into_iter().filter(|path| path.to_string_lossy().ends_with(ending)).collect()
}

fn text(path: &Path) -> String {
    String::from_utf8_lossy(&fs::read(Path::new(ROOT).join(path)).unwrap()).into_owned()
}

/// The shipped code without comments. Unit tests are at the end of a file or in files named `tests`.
fn shipped(path: &Path) -> String {
    if path.iter().any(|part| part == "tests" || part == "tests.rs") {
        return String::new();
    }
    let text = text(path);
    let own = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
    own.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n")
}

fn is_source(path: &Path) -> bool {
    path.starts_with("src") || path.starts_with("laser_triangulation/src")
}

/// The files of a module, in whichever crate it is.
fn source_of(module: &str) -> Vec<PathBuf> {
    let crates = ["src", "laser_triangulation/src"];
    let parts =
        crates.map(|sources| [format!("{sources}/{module}/"), format!("{sources}/{module}.rs")]);
    let parts = parts.concat();
    let files = files_ending_in(".rs").into_iter();
    files.filter(|path| parts.iter().any(|part| path.to_string_lossy().starts_with(part))).collect()
}

/// The modules that code names behind `crate::`, alone or in braces.
fn modules_used(code: &str) -> Vec<String> {
    names_behind("crate::", code)
}

/// The names behind a prefix, alone or in braces.
fn names_behind(prefix: &str, code: &str) -> Vec<String> {
    let code: String = code.split_whitespace().collect();
    let mut used = Vec::new();
    for rest in code.split(prefix).skip(1) {
        let Some(list) = rest.strip_prefix('{') else {
            used.push(rest.to_owned());
            continue;
        };
        let mut depth = 0;
        let mut is_start = true;
        for (at, letter) in list.char_indices() {
            if depth == 0 && is_start && letter.is_alphabetic() {
                used.push(list[at..].to_owned());
            }
            is_start = letter == ',';
            depth += i32::from(letter == '{') - i32::from(letter == '}');
            if depth < 0 {
                break;
            }
        }
    }
    let name = |text: String| {
        text.chars().take_while(|letter| letter.is_alphanumeric() || *letter == '_').collect()
    };
    used.into_iter().map(name).collect()
}

#[test]
fn modules_are_found_in_every_form() {
    let code = "use crate::{\n bag::{self, info::x}, node,\n};\nfn f() { crate::ros::names::g(); }";
    assert_eq!(modules_used(code), ["bag", "node", "ros"]);
}

fn complain(complaints: &[String]) {
    assert!(complaints.is_empty(), "\n{}", complaints.join("\n"));
}

#[test]
fn dependencies_point_one_way() {
    let mut complaints = Vec::new();
    for (module, may_use) in MAY_USE {
        let files = source_of(module);
        assert!(!files.is_empty(), "{module} is there");
        for path in files {
            for used in modules_used(&shipped(&path)) {
                let is_module = MAY_USE.iter().any(|(name, _)| *name == used);
                if is_module && used != module && !may_use.contains(&used.as_str()) {
                    complaints.push(format!("{}: {module} must not use {used}", path.display()));
                }
            }
        }
    }
    complain(&complaints);
}

/// The verbs of the command line, by the modules that run them.
fn verbs() -> Vec<String> {
    let code = text(Path::new("src/cli/mod.rs"));
    let arms = code.lines().filter(|line| line.trim_start().starts_with("Verb::"));
    arms.filter_map(|arm| Some(arm.split_once("=> ")?.1.split_once("::run(")?.0.to_owned()))
        .collect()
}

/// The other verbs that a file of `src/cli` imports.
fn other_verbs_used(path: &Path, code: &str, verbs: &[String]) -> Vec<String> {
    let own = path.strip_prefix("src/cli").unwrap().with_extension("");
    let own = if own.ends_with("mod") { own.parent().unwrap() } else { &own };
    let depth = own.iter().count();
    let own = own.iter().next().unwrap().to_string_lossy();
    let mut used = names_behind("cli::", code);
    used.extend(names_behind(&"super::".repeat(depth), code));
    used.retain(|name| *name != own && verbs.contains(name));
    used
}

#[test]
fn imports_of_verbs_are_found_in_every_form() {
    let verbs = ["replay", "simulate"].map(str::to_owned);
    let cases = [
        ("src/cli/evaluate/truth.rs", "use crate::{\n cli::{output, simulate::recording::X},\n};"),
        ("src/cli/evaluate/truth.rs", "fn f() { crate::cli::simulate::run(); }"),
        ("src/cli/evaluate/truth.rs", "use super::super::simulate;"),
        ("src/cli/evaluate.rs", "use super::{Outcome, simulate};"),
    ];
    for (path, code) in cases {
        assert_eq!(other_verbs_used(Path::new(path), code, &verbs), ["simulate"], "{code}");
    }
    let own = "use super::output;\nuse super::super::settings;\nuse crate::simulate::scene;";
    assert!(other_verbs_used(Path::new("src/cli/evaluate/truth.rs"), own, &verbs).is_empty());
}

#[test]
fn verbs_do_not_import_verbs() {
    let verbs = verbs();
    assert!(verbs.len() >= 14, "{verbs:?}");
    let mut complaints = Vec::new();
    // `cli/mod.rs` calls them all.
    for path in source_of("cli").into_iter().filter(|path| !path.ends_with("cli/mod.rs")) {
        for used in other_verbs_used(&path, &shipped(&path), &verbs) {
            complaints.push(format!("{}: must not import the verb {used}", path.display()));
        }
    }
    complain(&complaints);
}

#[test]
fn every_module_has_its_rule() {
    let declared =
        ["src/lib.rs", "laser_triangulation/src/lib.rs"].map(|path| text(Path::new(path)));
    let declared: Vec<_> = declared
        .iter()
        .flat_map(|text| text.lines())
        .filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';'))
        .collect();
    assert!(MAY_USE.iter().all(|(name, _)| declared.contains(name)), "{declared:?}");
    assert_eq!(declared.len(), MAY_USE.len(), "{declared:?}");
}

#[test]
fn pure_modules_use_no_file_thread_or_clock() {
    let mut complaints = Vec::new();
    for path in PURE.into_iter().flat_map(source_of) {
        let code = shipped(&path);
        // `use std::{fs, …}` would hide the words.
        let hidden = ["std::{fs", "std::{io", "std::{net", "std::{thread", "std::{time"];
        for word in IMPURE.iter().chain(&hidden).filter(|word| code.contains(**word)) {
            complaints.push(format!("{}: {word}", path.display()));
        }
    }
    complain(&complaints);
}

#[test]
fn files_are_short_and_finished() {
    let mut complaints = Vec::new();
    let mut lengths = Vec::new();
    for path in files_ending_in(".rs").into_iter().filter(|path| !path.ends_with("tidy.rs")) {
        let text = text(&path);
        lengths.push(text.lines().count());
        if text.lines().count() > MAX_LINES {
            complaints.push(format!("{}: more than {MAX_LINES} lines", path.display()));
        }
        let is_shipped = is_source(&path) && !shipped(&path).is_empty();
        let code = if is_shipped { shipped(&path) } else { text.replace("eprintln!", "") };
        // Examples print for their reader.
        let is_example = path.iter().any(|part| part == "examples");
        let code = if is_example { code.replace("println!", "") } else { code };
        for word in FORBIDDEN.iter().filter(|word| code.contains(**word)) {
            complaints.push(format!("{}: {word}", path.display()));
        }
    }
    lengths.sort_unstable();
    eprintln!("{} Rust files, median {} lines", lengths.len(), lengths[lengths.len() / 2]);
    complain(&complaints);
}

/// `rustc` ignores files without a `mod` line, so their tests would never run.
#[test]
fn every_file_is_a_module_of_its_parent() {
    let is_module = |path: &PathBuf| is_source(path) || path.starts_with("tests/it");
    let is_root = |path: &PathBuf| path.ends_with("lib.rs") || path.ends_with("main.rs");
    let mut complaints = Vec::new();
    for path in files_ending_in(".rs").into_iter().filter(|path| is_module(path) && !is_root(path))
    {
        // `a/b/mod.rs` and `a/b.rs` both are `mod b;` of `a`.
        let own = if path.ends_with("mod.rs") {
            path.parent().unwrap()
        } else {
            &path.with_extension("")
        };
        let (home, name) = (own.parent().unwrap(), own.file_name().unwrap().to_string_lossy());
        let inside = ["mod.rs", "lib.rs", "main.rs"].map(|file| home.join(file));
        let parents = inside.into_iter().chain([home.with_extension("rs")]);
        let mut parents = parents.filter(|parent| Path::new(ROOT).join(parent).exists());
        if !parents.any(|parent| text(&parent).contains(&format!("mod {name};"))) {
            complaints.push(format!("{}: `mod {name};` is missing", path.display()));
        }
    }
    complain(&complaints);
}

#[test]
fn no_file_contains_a_local_path() {
    let places = [["/wo", "rk/"], ["/ro", "ot/"], ["/ho", "me/"], ["/tmp/", "wt"]]
        .map(|parts| parts.concat());
    let mut complaints = Vec::new();
    for path in files().into_iter().filter(|path| !path.to_string_lossy().ends_with(".mcap")) {
        for place in places.iter().filter(|place| text(&path).contains(place.as_str())) {
            complaints.push(format!("{}: {place}", path.display()));
        }
    }
    complain(&complaints);
}

/// Paths in backquotes, alone or with the name of a function in the file.
#[test]
fn documents_name_existing_paths_and_tests() {
    let mut complaints = Vec::new();
    let mut checked = 0;
    for document in files_ending_in(".md") {
        let text = text(&document);
        for span in text.split('`').skip(1).step_by(2) {
            let (path, function) = span.split_once("::").unwrap_or((span, ""));
            let place = path.split('/').next().unwrap_or_default();
            let is_path =
                ["src", "laser_triangulation", "tests", "bags", "benches", "docs", "msgs"]
                    .contains(&place)
                    && !path.contains(['*', '$', ' ', '\n']);
            if !is_path || !path.contains('/') {
                continue;
            }
            checked += 1;
            let path = Path::new(path);
            let is_there = Path::new(ROOT).join(path).exists()
                && (function.is_empty() || self::text(path).contains(&format!("fn {function}(")));
            if !is_there {
                complaints.push(format!("{}: {span}", document.display()));
            }
        }
    }
    assert!(checked > 30, "only {checked} paths found");
    complain(&complaints);
}

#[test]
fn every_stored_parameter_file_and_scenario_loads() {
    let directory = tempfile::tempdir().unwrap();
    let parameter_files = files_ending_in(".params.yaml");
    assert!(parameter_files.len() >= 2, "{parameter_files:?}");
    for path in parameter_files {
        let name =
            path.file_name().unwrap().to_str().unwrap().strip_suffix(".params.yaml").unwrap();
        let mut command = laser_profiler(&["replay", "--params-file"]);
        command
            .arg(&path)
            .arg(Path::new("bags").join(name))
            .arg("-o")
            .arg(directory.path().join(name));
        let ended = end(&mut command);
        assert!(matches!(ended.code, Some(0 | 3)), "{}: {ended:?}", path.display());
    }
    for path in files_ending_in(".scenario.yaml") {
        let scenario = scene_from_yaml(&text(&path));
        assert!(scenario.is_ok(), "{}: {:?}", path.display(), scenario.err());
    }
}
