//! Writing result files: checked beforehand, whole or not at all, and never lost for want of a place.

use crate::exit::Failure;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Writes a file whole: to a name beside it first, then renamed. Devices and pipes are written directly.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    if fs::metadata(path).is_ok_and(|m| !m.is_file()) {
        return OpenOptions::new().write(true).open(path)?.write_all(bytes);
    }
    let part = beside(path);
    let written = File::create(&part)
        .and_then(|mut f| f.write_all(bytes).and_then(|()| f.sync_all()))
        .and_then(|()| fs::rename(&part, path));
    written.inspect_err(|_| drop(fs::remove_file(&part)))
}

/// Writes a file that took long to make; where that fails, to the folder for temporary files. Returns where it is, and why not at
/// `path`.
pub fn keep(path: &Path, bytes: &[u8]) -> Result<(PathBuf, Option<Failure>), Failure> {
    let Err(e) = write(path, bytes) else { return Ok((path.to_path_buf(), None)) };
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let refuge = std::env::temp_dir().join(format!("lightfarm-{}-{name}", std::process::id()));
    match write(&refuge, bytes) {
        Ok(()) => {
            let message =
                format!("error: {} can't be written: {e}; saved as {} instead", path.display(), refuge.display());
            Ok((refuge, Some(Failure::Machine(message))))
        }
        Err(second) => Err(Failure::Machine(format!(
            "error: {} can't be written: {e}; nor can {}: {second}",
            path.display(),
            refuge.display()
        ))),
    }
}

/// The name under which `path` is written before it is complete.
fn beside(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or(path.as_os_str()).to_os_string();
    name.push(format!(".{}.part", std::process::id()));
    path.with_file_name(name)
}

/// Checks that `path` can be written, without changing what is there.
pub fn check(path: &Path) -> Result<(), Failure> {
    let tried = match fs::metadata(path) {
        Ok(m) if m.is_dir() => Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder")),
        // A rename only asks the folder; but a file that is write-protected is meant to stay.
        Ok(m) if m.is_file() => OpenOptions::new().append(true).open(path).and_then(|_| probe(path)),
        Ok(_) => OpenOptions::new().write(true).open(path).map(drop),
        Err(_) => probe(path),
    };
    tried.map_err(|e| failure(path, &e))
}

fn probe(path: &Path) -> io::Result<()> {
    let part = beside(path);
    File::create(&part)?;
    fs::remove_file(&part)
}

/// A file that can't be written.
pub fn failure(path: &Path, e: &io::Error) -> Failure {
    Failure::Machine(format!("error: {} can't be written: {e}", path.display()))
}
