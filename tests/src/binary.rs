//! Finding the binary under test, building it when it is missing or older than its sources.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;
use std::time::SystemTime;

/// The `lightfarm` binary of the profile that the tests were built with.
pub fn binary() -> &'static Path {
    static BINARY: OnceLock<PathBuf> = OnceLock::new();
    BINARY.get_or_init(|| {
        // Tests lie in target/<profile>/deps.
        let test = std::env::current_exe().expect("the test's own path");
        let profile = test.ancestors().nth(2).expect("the profile's folder");
        let binary = profile.join("lightfarm");
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace");
        let sources = ["proto", "renderer", "statcheck", "coordinator", "worker", "cli", "Cargo.lock"];
        let newest = sources.iter().filter_map(|s| newest(&root.join(s))).max();
        let built = std::fs::metadata(&binary).and_then(|m| m.modified()).ok();
        if built < newest {
            build(root, profile);
        }
        assert!(binary.is_file(), "{} is not there", binary.display());
        binary
    })
}

/// The time of the latest change below `path`, tests left out.
fn newest(path: &Path) -> Option<SystemTime> {
    let meta = std::fs::metadata(path).ok()?;
    if !meta.is_dir() {
        let counts = ["rs", "toml", "proto", "lock"].iter().any(|e| path.extension() == Some(OsStr::new(e)));
        return meta.modified().ok().filter(|_| counts);
    }
    let entries = std::fs::read_dir(path).ok()?.flatten();
    entries.filter(|e| e.file_name() != "tests").filter_map(|e| newest(&e.path())).max()
}

fn build(root: &Path, profile: &Path) {
    eprintln!("building lightfarm");
    let name = profile.file_name().and_then(OsStr::to_str).expect("the profile's name");
    let target = profile.parent().expect("the target folder");
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or("cargo".into()));
    cargo.args(["build", "-p", "lightfarm", "--profile", if name == "debug" { "dev" } else { name }]);
    let status = cargo.arg("--target-dir").arg(target).current_dir(root).status().expect("cargo");
    assert!(status.success(), "lightfarm does not build");
}

/// Runs `lightfarm` to its end, away from the settings of whoever runs the tests.
pub fn lightfarm<S: AsRef<OsStr>>(args: impl IntoIterator<Item = S>) -> Output {
    command().args(args).output().expect("lightfarm runs")
}

/// A `lightfarm` command in a clean environment.
pub fn command() -> Command {
    let mut command = Command::new(binary());
    for key in ["LIGHTFARM_COORDINATOR", "LIGHTFARM_TOKEN", "RUST_LOG"] {
        command.env_remove(key);
    }
    command
}
