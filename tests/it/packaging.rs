//! The package as ROS finds it, checked by ROS's own tools: `catkin_pkg` and colcon from Python's package index, `ament_cmake`
//! and `ament_index_python` from Debian.

use std::{
    env, fs, io,
    path::{Path, PathBuf},
    process::Command,
};

use crate::{
    interop::python,
    program::{EXECUTABLE, Ended, end, skip},
};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Runs the script that lays out an install prefix.
fn install_prefix(prefix: &Path, arguments: &[&str]) -> Ended {
    let mut command = Command::new(Path::new(ROOT).join("packaging/install_prefix.sh"));
    end(command.arg(prefix).args(arguments))
}

/// Lays out a prefix with the executable under test.
pub(crate) fn installed(prefix: &Path) {
    let ended = install_prefix(prefix, &["--binary", EXECUTABLE]);
    assert_eq!(ended.code, Some(0), "{ended:?}");
}

/// A Python with Debian's ament modules; `None` after reporting that there is none.
fn ament_python() -> Option<&'static str> {
    const MODULES: &str = "import ament_index_python, ament_package, catkin_pkg";
    let has_modules = |python: &&str| {
        let output = Command::new(python).args(["-c", MODULES]).output();
        output.is_ok_and(|output| output.status.success())
    };
    let found = ["python3", "/usr/bin/python3"].into_iter().find(has_modules);
    if found.is_none() {
        let reason = "Debian's ament-cmake and python3-ament-index are missing";
        skip("packaging", reason);
        assert!(env::var_os("CI").is_none(), "CI skips nothing: {reason}");
    }
    found
}

/// Package locations and interfaces that `ament_index_python` finds in a prefix.
fn indexed(python: &str, ament_prefix_path: &str) -> Ended {
    const FIND: &str = "
from ament_index_python import get_resource
from ament_index_python.packages import get_package_prefix, get_package_share_directory
print(get_package_prefix('laser_profiler'), get_package_share_directory('laser_profiler'), sep='\\n')
print(get_resource('rosidl_interfaces', 'laser_profiler_msgs')[0])
";
    end(Command::new(python).args(["-c", FIND]).env("AMENT_PREFIX_PATH", ament_prefix_path))
}

/// `AMENT_PREFIX_PATH` after a shell has run a command in a clean environment.
fn sourced(shell: &str, command: &str) -> String {
    let mut shell = Command::new(shell);
    shell.args(["-c", &format!("{command} && printf %s \"$AMENT_PREFIX_PATH\"")]);
    let ended = end(shell.env("AMENT_PREFIX_PATH", "/other"));
    assert_eq!((ended.code, ended.stderr.as_str()), (Some(0), ""), "{command}: {ended:?}");
    ended.stdout
}

/// Checks everything that ROS needs of a prefix at its current place.
fn is_found(prefix: &Path) {
    let place = prefix.to_str().unwrap();
    let expected = format!("{place}:/other");
    for setup in ["setup.bash", "local_setup.bash"] {
        let twice = format!("cd / && . '{place}/{setup}' && . '{place}/{setup}'");
        assert_eq!(sourced("bash", &twice), expected);
    }
    let posix = format!("AMENT_CURRENT_PREFIX='{place}' && . '{place}/local_setup.sh'");
    assert_eq!(sourced("sh", &posix), expected);

    let executable = prefix.join("lib/laser_profiler/laser_profiler");
    let version = end(Command::new(executable).arg("--version"));
    assert_eq!(version.stdout, concat!("laser_profiler ", env!("CARGO_PKG_VERSION"), "\n"));

    let Some(python) = ament_python() else { return };
    let found = indexed(python, &expected);
    let interfaces = ["action/Scan.action", "msg/Centerline.msg", "srv/StartScan.srv"];
    assert!(interfaces.iter().all(|name| found.stdout.contains(name)), "{found:?}");
    for interface in found.stdout.lines().skip(2).filter(|line| !line.is_empty()) {
        assert!(prefix.join("share/laser_profiler_msgs").join(interface).is_file(), "{interface}");
    }
    let places = format!("{place}\n{place}/share/laser_profiler\n");
    assert!(found.stdout.starts_with(&places), "{found:?}");
}

#[test]
fn a_moved_prefix_still_works() {
    let directory = tempfile::tempdir().unwrap();
    let (first, second) = (directory.path().join("first"), directory.path().join("second place"));
    installed(&first);
    is_found(&first);
    fs::rename(&first, &second).unwrap();
    is_found(&second);
}

#[test]
fn the_script_overwrites_nothing() {
    let directory = tempfile::tempdir().unwrap();
    fs::write(directory.path().join("mine"), "mine").unwrap();
    let ended = install_prefix(directory.path(), &["--binary", EXECUTABLE]);
    assert_eq!(ended.code, Some(1), "{ended:?}");
    assert!(ended.stderr.contains("not an empty directory"), "{ended:?}");
    assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);

    let prefix = directory.path().join("prefix");
    for wrong in [&["--binary"] as &[_], &["--bogus"], &["another"]] {
        assert_eq!(install_prefix(&prefix, wrong).code, Some(2), "{wrong:?}");
    }
    let ended = install_prefix(&prefix, &["--binary", "missing"]);
    assert!(ended.code == Some(1) && ended.stderr.contains("missing"), "{ended:?}");
    assert!(!prefix.exists());
}

#[test]
fn the_manifests_are_valid_and_of_this_version() {
    const CHECK: &str = "
import sys
from catkin_pkg.package import parse_package
for path in sys.argv[1:]:
    warnings = []
    package = parse_package(path, warnings=warnings)
    assert package.package_format == 3 and not warnings, warnings
    print(package.name, package.version, package.get_build_type())
";
    let Some(python) = python() else { return };
    let mut command = Command::new(python);
    command.args(["-c", CHECK, "packaging/laser_profiler", "msgs/laser_profiler_msgs"]);
    let ended = end(command.current_dir(ROOT));
    let version = env!("CARGO_PKG_VERSION");
    let expected = format!(
        "laser_profiler {version} ament_cmake\nlaser_profiler_msgs {version} ament_cmake\n"
    );
    assert_eq!((ended.stdout, ended.code), (expected, Some(0)), "{}", ended.stderr);
}

/// A colcon workspace with the repository as in a fresh clone, without build output.
fn workspace(place: &Path) -> io::Result<()> {
    let clone = place.join("src/laser_profiler");
    fs::create_dir_all(&clone)?;
    let mut command = Command::new("git");
    let listed = end(command.args(["ls-files"]).current_dir(ROOT));
    let mut entries: Vec<_> =
        listed.stdout.lines().filter_map(|path| path.split('/').next()).collect();
    entries.dedup();
    assert!(entries.contains(&"packaging") && entries.contains(&"msgs"), "{entries:?}");
    entries.into_iter().try_for_each(|name| {
        std::os::unix::fs::symlink(Path::new(ROOT).join(name), clone.join(name))
    })
}

fn colcon(python: &Path, workspace: &Path) -> Command {
    let mut command = Command::new(python.with_file_name("colcon"));
    command.current_dir(workspace).env("COLCON_HOME", workspace.join("home"));
    command
}

#[test]
fn colcon_sees_both_packages() {
    let Some(python) = python() else { return };
    let directory = tempfile::tempdir().unwrap();
    workspace(directory.path()).unwrap();
    let ended = end(colcon(python, directory.path()).args(["list"]));
    assert_eq!(
        ended.stdout,
        "laser_profiler\tsrc/laser_profiler/packaging/laser_profiler\t(ros.ament_cmake)\n\
         laser_profiler_msgs\tsrc/laser_profiler/msgs/laser_profiler_msgs\t(ros.ament_cmake)\n",
        "{ended:?}"
    );
}

/// The files below a directory, by their paths from there.
fn files(directory: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut open = vec![directory.to_owned()];
    while let Some(next) = open.pop() {
        for entry in fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else {
                found.push(path.strip_prefix(directory).unwrap().to_owned());
            }
        }
    }
    found.sort();
    found
}

/// The messages are left out: Debian has no `rosidl_default_generators`. So is cargo: the executable under test is installed.
#[test]
fn colcon_installs_the_same_files_as_the_script() {
    let (Some(colcon_python), Some(python)) = (python(), ament_python()) else { return };
    let directory = tempfile::tempdir().unwrap();
    workspace(directory.path()).unwrap();
    let mut command = colcon(colcon_python, directory.path());
    command.args(["build", "--packages-ignore", "laser_profiler_msgs", "--cmake-args"]);
    command.arg(format!("-DLASER_PROFILER_BINARY={EXECUTABLE}"));
    let python = end(Command::new(python).args(["-c", "import sys; print(sys.executable)"]));
    let ended = end(command.arg(format!("-DPython3_EXECUTABLE={}", python.stdout.trim())));
    assert_eq!(ended.code, Some(0), "{ended:?}");

    let built = directory.path().join("install/laser_profiler");
    let prefix = directory.path().join("prefix");
    installed(&prefix);
    for part in [
        "lib",
        "share/laser_profiler/launch",
        "share/laser_profiler/config",
        "share/laser_profiler/viewers",
    ] {
        assert_eq!(files(&built.join(part)), files(&prefix.join(part)), "{part}");
        assert!(!files(&built.join(part)).is_empty(), "{part}");
    }
    let marker = "share/ament_index/resource_index/packages/laser_profiler";
    assert!(built.join(marker).is_file() && prefix.join(marker).is_file());
    let executable = built.join("lib/laser_profiler/laser_profiler");
    assert_eq!(end(Command::new(executable).arg("--version")).code, Some(0));
}
