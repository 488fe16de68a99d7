//! Other renderers, told by a small TOML file: a command, how to read its picture, what its time covers.

use super::measure::Shot;
use super::picture_file::{self, Format};
use super::scene::BenchScene;
use crate::error::process;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A renderer's file, as it is written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    /// What curves and tables call it.
    name: String,
    /// `mitsuba`: the scenes that are Mitsuba XML; `any`: all; else the path of the renderer's own file, with places to fill in.
    scenes: String,
    /// Whether the scene file itself has places to fill in.
    #[serde(default)]
    template: bool,
    /// The command and its arguments, with places to fill in.
    command: Vec<String>,
    image: Format,
    time: Timing,
    #[serde(default)]
    startup: Startup,
    /// What the time covers, in words.
    covers: String,
    /// What to do when the command can't be started.
    #[serde(default)]
    missing: String,
    /// Samples per pixel of the first checkpoint.
    #[serde(default = "one")]
    first_spp: u32,
}

fn one() -> u32 {
    1
}

/// Where the time comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Timing {
    /// The last line of standard output is JSON with `render_s` and, if it can tell, `load_s`, `warmup_s` and `cpu_s`.
    Printed,
    /// From the start of the command to its end.
    Wall,
}

/// What is done about the time before the first sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Startup {
    /// It counts.
    #[default]
    Include,
    /// The time of one sample in 16 x 16 pixels is taken off.
    Subtract,
}

/// A renderer that can be asked for pictures.
#[derive(Clone, Debug)]
pub struct External {
    /// The TOML file.
    path: PathBuf,
    file: File,
}

/// The line that a renderer prints.
#[derive(Debug, Deserialize)]
struct Printed {
    render_s: f64,
    load_s: Option<f64>,
    warmup_s: Option<f64>,
    cpu_s: Option<f64>,
}

/// What a render is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// The scene.
    pub scene: &'a BenchScene,
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Samples per pixel.
    pub spp: u32,
    /// The seed.
    pub seed: u64,
    /// Threads.
    pub threads: usize,
}

impl External {
    /// Reads a renderer's file.
    pub fn read(path: &Path) -> Result<Self, String> {
        let text = std::fs::read_to_string(path).map_err(|e| {
            format!(
                "{}: {e}; --with takes the TOML file of a renderer, such as bench/renderers/mitsuba-llvm.toml",
                path.display()
            )
        })?;
        let file: File = toml::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))?;
        if file.command.is_empty() || file.first_spp == 0 {
            return Err(format!("{}: `command` must not be empty, and `first_spp` must be above 0", path.display()));
        }
        Ok(Self { path: path.into(), file })
    }

    /// What curves and tables call it.
    pub fn name(&self) -> &str {
        &self.file.name
    }

    /// What its time covers.
    pub fn covers(&self) -> &str {
        &self.file.covers
    }

    /// Samples per pixel of the first checkpoint.
    pub fn first_spp(&self) -> u32 {
        self.file.first_spp
    }

    /// Why it can't render a scene; `None` if it can.
    pub fn objection(&self, scene: &BenchScene) -> Option<String> {
        match self.file.scenes.as_str() {
            "any" => None,
            "mitsuba" if scene.file.extension().is_some_and(|e| e == "xml") => None,
            "mitsuba" => Some("the scene is not a Mitsuba file".into()),
            template => match self.fill(template, &[("name", scene.name.clone())]) {
                Err(e) => Some(e),
                Ok(path) if !Path::new(&path).is_file() => Some(format!("there is no {path}")),
                Ok(_) => None,
            },
        }
    }

    /// Wall and processor seconds of a render too small to matter: what starting takes; 0 where it counts or is not in the time.
    pub fn startup(&self, request: Request<'_>) -> Result<(f64, f64), String> {
        if self.file.startup == Startup::Include {
            return Ok((0.0, 0.0));
        }
        let tiny = Request { size: (16, 16), spp: 1, ..request };
        self.render(tiny, (0.0, 0.0)).map(|o| (o.seconds, o.cpu_seconds.unwrap_or(0.0)))
    }

    /// Renders; `startup`, wall and processor seconds, is taken off.
    pub fn render(&self, request: Request<'_>, startup: (f64, f64)) -> Result<Shot, String> {
        let folder = tempfile::tempdir().map_err(|e| format!("no temporary folder: {e}"))?;
        let out = folder.path().join(format!("picture.{}", self.file.image.extension()));
        let (command, _scratch) = self.command(request, &out)?;
        let cpu = process::children_cpu_seconds();
        let (seconds, stdout, peak_mib) = self.start(&command)?;
        let cpu_seconds = process::children_cpu_seconds().zip(cpu).map(|(after, before)| after - before);
        let pixels = picture_file::read(&out, self.file.image, request.size)
            .map_err(|e| format!("{}: the picture that the command should have made: {e}", self.path.display()))?;
        let mut shot = Shot { seconds, cpu_seconds, load_s: None, warmup_s: None, peak_mib, pixels };
        match self.file.time {
            Timing::Wall => {
                shot.seconds = (seconds - startup.0).max(1e-3);
                shot.cpu_seconds = cpu_seconds.map(|s| (s - startup.1).max(1e-3));
                shot.load_s = Some(startup.0).filter(|s| *s > 0.0);
            }
            Timing::Printed => {
                let line = stdout.lines().rev().find(|l| !l.trim().is_empty()).unwrap_or_default();
                let told: Printed = serde_json::from_str(line).map_err(|e| {
                    format!(
                        "{}: `time = \"printed\"` wants JSON with render_s as the last line of the command's output: {e}: {line:?}",
                        self.path.display()
                    )
                })?;
                shot.seconds = told.render_s;
                // That of the command covers more than the render.
                shot.cpu_seconds = told.cpu_s;
                (shot.load_s, shot.warmup_s) = (told.load_s, told.warmup_s);
            }
        }
        Ok(shot)
    }

    /// The command line with everything filled in.
    fn command(&self, r: Request<'_>, out: &Path) -> Result<(Vec<String>, Option<Scratch>), String> {
        let depth = r.scene.max_depth.to_string();
        let mut places = vec![
            ("name", r.scene.name.clone()),
            ("spp", r.spp.to_string()),
            ("seed", r.seed.to_string()),
            ("width", r.size.0.to_string()),
            ("height", r.size.1.to_string()),
            ("max_depth", depth),
            ("threads", r.threads.to_string()),
            ("out", out.display().to_string()),
            ("python", std::env::var("BENCH_PYTHON").unwrap_or_else(|_| "python3".into())),
            ("here", self.path.parent().unwrap_or(Path::new(".")).display().to_string()),
        ];
        let scene = match self.file.scenes.as_str() {
            "any" | "mitsuba" => r.scene.file.clone(),
            template => PathBuf::from(self.fill(template, &places)?),
        };
        let scratch = if self.file.template { Some(filled_scene(&scene, &places)?) } else { None };
        places.push(("scene", scratch.as_ref().map_or(&scene, |s| &s.0).display().to_string()));
        let command = self.file.command.iter().map(|a| self.fill(a, &places)).collect::<Result<_, _>>()?;
        Ok((command, scratch))
    }

    /// Fills in `{key}`, `{env:NAME}` and `{env:NAME=default}`.
    fn fill(&self, text: &str, places: &[(&str, String)]) -> Result<String, String> {
        let (mut out, mut rest) = (String::new(), text);
        while let Some(open) = rest.find('{') {
            let close = rest[open..].find('}').map(|i| open + i);
            let close = close.ok_or_else(|| format!("{}: {text:?} has a {{ without a }}", self.path.display()))?;
            let key = &rest[open + 1..close];
            out += &rest[..open];
            out += &self.place(key, places)?;
            rest = &rest[close + 1..];
        }
        Ok(out + rest)
    }

    fn place(&self, key: &str, places: &[(&str, String)]) -> Result<String, String> {
        if let Some(variable) = key.strip_prefix("env:") {
            let (name, default) = variable.split_once('=').map_or((variable, None), |(n, d)| (n, Some(d)));
            let value = std::env::var(name).ok().or(default.map(str::to_string));
            return value.ok_or_else(|| format!("{}: the environment variable {name} is not set", self.path.display()));
        }
        let found = places.iter().find(|(k, _)| *k == key).map(|(_, v)| v.clone());
        found.ok_or_else(|| {
            let known: Vec<&str> = places.iter().map(|(k, _)| *k).collect();
            format!("{}: nothing is known as {{{key}}}, only env:NAME, {}", self.path.display(), known.join(", "))
        })
    }

    /// Runs a command to its end: wall seconds, standard output, largest memory.
    fn start(&self, command: &[String]) -> Result<(f64, String, Option<f64>), String> {
        let (program, arguments) = command.split_first().ok_or("there is no command")?;
        let started = Instant::now();
        let mut child = Command::new(program)
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|e| format!("{}: {program} can't be started: {e}; {}", self.path.display(), self.file.missing))?;
        let drain = |pipe: Option<Box<dyn std::io::Read + Send>>| {
            std::thread::spawn(move || {
                let mut bytes = Vec::new();
                // What could not be read is missing from a message, no more.
                let _ = pipe.map(|mut p| p.read_to_end(&mut bytes));
                String::from_utf8_lossy(&bytes).into_owned()
            })
        };
        let stdout = drain(child.stdout.take().map(|p| Box::new(p) as _));
        let stderr = drain(child.stderr.take().map(|p| Box::new(p) as _));
        let mut peak: Option<f64> = None;
        let status = loop {
            match child.try_wait().map_err(|e| e.to_string())? {
                Some(status) => break status,
                None => {
                    let now = process::peak_mib_of(child.id());
                    peak = now.map(|n| peak.map_or(n, |p| p.max(n))).or(peak);
                    std::thread::sleep(Duration::from_millis(2));
                }
            }
        };
        let seconds = started.elapsed().as_secs_f64();
        let text = |t: std::thread::JoinHandle<String>| t.join().unwrap_or_default();
        let (stdout, stderr) = (text(stdout), text(stderr));
        if !status.success() {
            let tail: Vec<&str> = stderr.trim().lines().rev().take(8).collect();
            let tail: Vec<&str> = tail.into_iter().rev().collect();
            return Err(format!(
                "{}: {} ended with {status}: {}",
                self.path.display(),
                command.join(" "),
                tail.join("\n  ")
            ));
        }
        Ok((seconds, stdout, peak))
    }
}

/// A file that goes with this value.
struct Scratch(PathBuf);

impl Drop for Scratch {
    fn drop(&mut self) {
        // A file that is left over does no harm.
        let _ = std::fs::remove_file(&self.0);
    }
}

/// A copy of a scene template, filled in, beside the original, so that its relative paths hold.
fn filled_scene(scene: &Path, places: &[(&str, String)]) -> Result<Scratch, String> {
    let mut text = std::fs::read_to_string(scene).map_err(|e| format!("{}: {e}", scene.display()))?;
    for (key, value) in places {
        text = text.replace(&format!("{{{key}}}"), value);
    }
    let extension = scene.extension().map_or(String::new(), |e| e.to_string_lossy().into_owned());
    let path = scene.with_file_name(format!("bench-{}.{extension}", std::process::id()));
    let told = |e| {
        format!(
            "{}: {e}; templates are filled in beside the original, which needs a folder that can be written",
            path.display()
        )
    };
    std::fs::write(&path, text).map_err(told)?;
    Ok(Scratch(path))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn external(text: &str) -> Result<External, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.toml");
        std::fs::write(&path, text).unwrap();
        External::read(&path)
    }

    const HEAD: &str = "name = 'x'\nscenes = 'any'\nimage = 'pfm'\ncovers = 'all'\n";

    fn request(scene: &BenchScene) -> Request<'_> {
        Request { scene, size: (2, 1), spp: 3, seed: 5, threads: 1 }
    }

    #[test]
    fn a_command_renders_and_tells_its_time() {
        let scene = BenchScene::of_file(Path::new("scenes/cornell.toml"));
        let folder = tempfile::tempdir().unwrap();
        let script = "printf 'PF\\n2 1\\n-1.0\\n' > $1\nhead -c 24 /dev/zero >> $1\necho progress\n\
                      echo '{\"render_s\": 0.5, \"load_s\": 0.25}'\n[ \"$2 $3\" = '3 5' ]\n";
        std::fs::write(folder.path().join("run.sh"), script).unwrap();
        let path = folder.path().join("x.toml");
        let command = "['sh', '{here}/run.sh', '{out}', '{spp}', '{seed}']";
        std::fs::write(&path, format!("{HEAD}time = 'printed'\ncommand = {command}\n")).unwrap();
        let shot = External::read(&path).unwrap().render(request(&scene), (0.0, 0.0)).unwrap();
        assert_eq!((shot.seconds, shot.load_s, shot.pixels), (0.5, Some(0.25), vec![[0.0; 3]; 2]));
    }

    #[test]
    fn faults_name_the_file_and_what_to_do() {
        let scene = BenchScene::of_file(Path::new("scenes/cornell.toml"));
        let fails = |command: &str| {
            let e = external(&format!("{HEAD}time = 'wall'\nmissing = 'install it'\ncommand = {command}\n")).unwrap();
            e.render(request(&scene), (0.0, 0.0)).unwrap_err()
        };
        let message = fails("['no-such-renderer']");
        assert!(message.contains("x.toml") && message.contains("install it"), "{message}");
        let message = fails("['sh', '-c', 'echo broken lens >&2; exit 3']");
        assert!(message.contains("x.toml") && message.contains("broken lens"), "{message}");
        let message = fails("['true']");
        assert!(message.contains("x.toml") && message.contains("picture.pfm"), "{message}");
        let message = fails("['sh', '{spq}']");
        assert!(message.contains("{spq}") && message.contains("max_depth"), "{message}");
        let message = fails("['sh', '{env:LIGHTFARM_BENCH_NOT_SET}']");
        assert!(message.contains("LIGHTFARM_BENCH_NOT_SET"), "{message}");
        let message = external(&format!("{HEAD}time = 'wall'\ncommand = ['x']\ntypo = 1\n")).unwrap_err();
        assert!(message.contains("x.toml") && message.contains("typo"), "{message}");
    }

    /// The files that are shipped can be read.
    #[test]
    fn shipped_files_are_sound() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("renderers");
        let files = std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().path());
        let tomls: Vec<PathBuf> = files.filter(|p| p.extension().is_some_and(|e| e == "toml")).collect();
        assert!(tomls.len() >= 6);
        for path in tomls {
            External::read(&path).unwrap();
        }
    }
}
