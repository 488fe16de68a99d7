//! Files that are there completely or not at all, also after a crash.

use std::fs::File;
use std::io;
use std::path::Path;

/// Makes a folder's entries durable.
pub fn sync_folder(folder: &Path) -> io::Result<()> {
    File::open(folder)?.sync_all()
}

/// Writes beside the file, makes it durable, then takes its place. Returns what `write` does, which should write in large pieces.
pub fn write_durably<T>(path: &Path, write: impl FnOnce(&mut File) -> io::Result<T>) -> io::Result<T> {
    let beside = path.with_added_extension("new");
    let written = File::create(&beside).and_then(|mut f| {
        let told = write(&mut f)?;
        f.sync_all()?;
        Ok(told)
    });
    let told = written.inspect_err(|_| {
        let _ = std::fs::remove_file(&beside);
    })?;
    move_durably(&beside, path)?;
    Ok(told)
}

/// Renames a file whose content is durable.
pub fn move_durably(from: &Path, to: &Path) -> io::Result<()> {
    std::fs::rename(from, to)?;
    to.parent().map_or(Ok(()), sync_folder)
}
