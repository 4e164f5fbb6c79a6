//! The folder that results go to.

use anyhow::{Context, Result};
use std::fs;
use std::path::{Path, PathBuf};

/// A folder that can be written to. A file in it is replaced only by a whole one.
pub struct Folder(PathBuf);

impl Folder {
    /// Makes the folder if it is not there, and proves that it can be written before any work is done.
    pub fn open(path: &Path) -> Result<Self> {
        let say = || {
            format!(
                "the output folder {} cannot be written: name another with --out, or check its permissions and that \
                 no file stands in its way",
                path.display()
            )
        };
        fs::create_dir_all(path).with_context(say)?;
        let probe = path.join(".write-probe");
        fs::write(&probe, []).with_context(say)?;
        fs::remove_file(&probe).with_context(say)?;
        Ok(Self(path.to_path_buf()))
    }

    /// Where `name` will be.
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Lets `write` make the file under another name, and moves it to `name` once it is whole.
    pub fn put(&self, name: &str, write: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
        // The ending stays: it says how the file is packed.
        let partial = self.path(&format!("partial-{name}"));
        let written = write(&partial).and_then(|()| Ok(fs::rename(&partial, self.path(name))?));
        if written.is_err() {
            // It may not be there; the error that is told is the first one.
            let _ = fs::remove_file(&partial);
        }
        written.with_context(|| format!("{} was not written", self.path(name).display()))
    }

    /// Writes a text.
    pub fn put_text(&self, name: &str, text: &str) -> Result<()> {
        self.put(name, |path| Ok(fs::write(path, text)?))
    }
}
