//! The folder that results go to.

use anyhow::{Context, Result, ensure};
use std::fs;
use std::path::{Path, PathBuf};

/// A folder that can be written to. A file in it is replaced only by a whole one.
pub struct Folder(PathBuf);

impl Folder {
    /// Makes the folder if it is not there, and proves that it can be written before any work is done.
    pub fn open(path: &Path) -> Result<Self> {
        let say = || {
            format!(
                "the output folder {} cannot be written: name another, or check its permissions and that no file stands \
                 in its way",
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
        // The ending stays: it says how the file is packed. Another program may be writing a file of the same name.
        let partial = self.path(&format!("partial-{}-{name}", std::process::id()));
        let written = write(&partial).and_then(|()| Ok(fs::rename(&partial, self.path(name))?));
        if written.is_err() {
            // It may not be there; the reported error is the first one.
            let _ = fs::remove_file(&partial);
        }
        written.with_context(|| format!("{} was not written", self.path(name).display()))
    }

    /// Writes a text.
    pub fn put_text(&self, name: &str, text: &str) -> Result<()> {
        self.put(name, |path| Ok(fs::write(path, text)?))
    }
}

/// Writes a file that is not there yet.
///
/// # Errors
/// There is one of that name, or it cannot be written.
pub fn put_new(file: &Path, text: &str) -> Result<()> {
    ensure!(
        !file.exists(),
        "{} is there already: name another file, or remove it",
        file.display()
    );
    let name = file
        .file_name()
        .and_then(|name| name.to_str())
        .with_context(|| format!("{} is no name of a file", file.display()))?;
    let folder = match file.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    ensure!(
        folder.is_dir(),
        "{} cannot be written: there is no folder {}",
        file.display(),
        folder.display()
    );
    Folder::open(folder)?.put_text(name, text)
}

/// Refuses to write `names` into the folder `out` where one of them is one of `inputs`: by its path, through links, or by
/// letters of the other case.
///
/// # Errors
/// A sentence that names the file.
pub fn refuse_inputs(out: &Path, names: &[&str], inputs: &[&Path]) -> Result<()> {
    // The folder may not be there yet: what is there of its path says where it will be.
    let mut base = std::path::absolute(out)?;
    let mut below = Vec::new();
    while base.canonicalize().is_err() {
        let Some(name) = base.file_name() else { break };
        below.push(name.to_owned());
        base.pop();
    }
    let mut folder = base.canonicalize().unwrap_or(base);
    folder.extend(below.iter().rev());
    let spelled = |path: &Path| path.to_string_lossy().to_lowercase();
    for input in inputs {
        let whole = input.canonicalize();
        let asked = std::path::absolute(input)?;
        for name in names {
            let output = folder.join(name);
            let same_path = whole.iter().chain([&asked]).any(|input| {
                spelled(input) == spelled(&output)
                    || output
                        .canonicalize()
                        .is_ok_and(|output| spelled(&output) == spelled(input))
            });
            if same_path || same_file(input, &output) {
                anyhow::bail!(
                    "{} would be written over: it is read, and {} would be written; name another folder with --out",
                    input.display(),
                    output.display()
                );
            }
        }
    }
    Ok(())
}

/// Whether two paths are one file, as two hard links are.
#[cfg(unix)]
fn same_file(a: &Path, b: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    match (fs::metadata(a), fs::metadata(b)) {
        (Ok(a), Ok(b)) => (a.dev(), a.ino()) == (b.dev(), b.ino()),
        _ => false,
    }
}

/// Whether two paths are one file; where the system does not tell, their names have to.
#[cfg(not(unix))]
fn same_file(_: &Path, _: &Path) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_read_is_not_written_over() {
        let folder = std::env::temp_dir().join(format!("ddfeed-inputs-{}", std::process::id()));
        let out = folder.join("out");
        fs::create_dir_all(&out).unwrap();
        let put = |path: &Path| fs::write(path, "a").unwrap();
        let refused = |out: &Path, input: &Path| {
            refuse_inputs(out, &["model.toml", "report.json"], &[input]).is_err()
        };
        let model = out.join("model.toml");
        put(&model);
        assert!(refused(&out, &model));
        assert!(refused(&folder.join("out/../out"), &model));
        assert!(
            refused(&out, &out.join("MODEL.toml")),
            "on a system that knows no case it is the same"
        );
        let other = folder.join("model.toml");
        put(&other);
        assert!(!refused(&out, &other));
        assert!(!refused(&folder.join("not/there/yet"), &other));
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(&out, folder.join("link")).unwrap();
            assert!(refused(&folder.join("link"), &model));
            // An output that is a link to an input.
            let fit = folder.join("fit.csv");
            put(&fit);
            std::os::unix::fs::symlink(&fit, out.join("report.json")).unwrap();
            assert!(refused(&out, &fit));
            fs::remove_file(out.join("report.json")).unwrap();
            fs::hard_link(&fit, out.join("report.json")).unwrap();
            assert!(refused(&out, &fit));
        }
        fs::remove_dir_all(&folder).unwrap();
    }
}
