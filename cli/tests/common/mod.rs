//! What the tests of the command share: a folder with a small scene, and the program run in it.

#![allow(dead_code, clippy::unwrap_used, reason = "test code; each test file uses a part of it")]

use renderer::film::exr::{self, Picture};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// A lamp over a floor in front of a wall, 48 x 32 pixels.
const SCENE: &str = r#"<scene version="3.0.0">
    <integrator type="path"><integer name="max_depth" value="4"/></integrator>
    <sensor type="perspective">
        <float name="fov" value="60"/>
        <transform name="to_world"><lookat origin="0, 1, 4" target="0, 0.7, 0" up="0, 1, 0"/></transform>
        <sampler type="independent"><integer name="sample_count" value="16"/></sampler>
        <film type="hdrfilm"><integer name="width" value="48"/><integer name="height" value="32"/></film>
    </sensor>
    <bsdf type="twosided" id="grey"><bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf></bsdf>
    <shape type="rectangle">
        <transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/></transform><ref id="grey"/>
    </shape>
    <shape type="rectangle">
        <transform name="to_world"><scale value="3"/><translate z="-2"/></transform><ref id="grey"/>
    </shape>
    <shape type="rectangle">
        <transform name="to_world"><rotate x="1" angle="90"/><scale value="0.5"/><translate y="2"/></transform><ref id="grey"/>
        <emitter type="area"><rgb name="radiance" value="9, 8, 7"/></emitter>
    </shape>
</scene>
"#;

/// A folder that goes away with the test.
pub struct Lab {
    folder: tempfile::TempDir,
}

impl Lab {
    /// With `scene.xml` in it.
    pub fn new() -> Self {
        let lab = Self { folder: tempfile::tempdir().unwrap() };
        lab.write("scene.xml", SCENE);
        lab
    }

    /// A path in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file.
    pub fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    /// The program, to be run in the folder.
    pub fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lightfarm"));
        // Files that can't be written where they should be are saved in the folder for temporary files: this one.
        command.args(args).current_dir(self.folder.path()).env("TMPDIR", self.folder.path()).stdin(Stdio::null());
        command
    }

    /// Runs the program to its end.
    pub fn run(&self, args: &[&str]) -> Run {
        Run(self.command(args).output().unwrap())
    }

    /// Reads an EXR.
    pub fn picture(&self, name: &str) -> Picture {
        read(&self.path(name))
    }
}

/// Reads an EXR.
pub fn read(path: &Path) -> Picture {
    exr::decode(&std::fs::read(path).unwrap()).unwrap()
}

/// A program that has ended.
pub struct Run(pub Output);

impl Run {
    /// Checks the exit status; returns what was written to standard error.
    #[track_caller]
    pub fn status(&self, want: i32) -> String {
        let stderr = String::from_utf8_lossy(&self.0.stderr).into_owned();
        assert_eq!(self.0.status.code(), Some(want), "{stderr}");
        assert!(!stderr.contains("panicked"), "{stderr}");
        stderr
    }

    /// Standard output.
    pub fn stdout(&self) -> String {
        String::from_utf8_lossy(&self.0.stdout).into_owned()
    }

    /// Standard output as JSON lines, of which the last is returned.
    #[track_caller]
    pub fn json(&self) -> Value {
        let lines: Vec<Value> = self.stdout().lines().map(|l| serde_json::from_str(l).unwrap()).collect();
        lines.into_iter().next_back().unwrap()
    }
}
