//! The archive and its checksums: the same bytes for the same files.

use anyhow::{Context, Result};
use flate2::{Compression, GzBuilder};
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use tar::{Builder, Header};

/// The list of checksums, which `sha256sum --check` reads.
const SUMS: &str = "SHA256SUMS";

/// Writes the checksum of each file below `folder` into the folder.
///
/// # Errors
/// A file cannot be read or written.
pub fn write_sums(folder: &Path) -> Result<()> {
    let mut sums = String::new();
    for file in files(folder)? {
        writeln!(sums, "{}  {}", sum(&folder.join(&file))?, slashed(&file))?;
    }
    fs::write(folder.join(SUMS), sums).context("cannot write the checksums")
}

/// Packs `folder` as `name` into `archive`, with `time_s` as the time of each file, and writes its checksum beside it.
///
/// # Errors
/// A file cannot be read or written.
pub fn write(folder: &Path, name: &str, time_s: u64, archive: &Path) -> Result<()> {
    let file =
        File::create(archive).with_context(|| format!("cannot write {}", archive.display()))?;
    // Without a time and a name of its own.
    let packed = GzBuilder::new().write(file, Compression::best());
    let mut tar = Builder::new(packed);
    for file in files(folder)? {
        let bytes = fs::read(folder.join(&file))?;
        let mut header = Header::new_gnu();
        header.set_size(bytes.len() as u64);
        header.set_mtime(time_s);
        header.set_mode(if file == Path::new("ddfeed") {
            0o755
        } else {
            0o644
        });
        tar.append_data(&mut header, Path::new(name).join(&file), &bytes[..])?;
    }
    tar.into_inner()?.finish()?;
    let file = archive.file_name().unwrap_or_default().to_string_lossy();
    let line = format!("{}  {file}\n", sum(archive)?);
    fs::write(archive.with_file_name(format!("{file}.sha256")), line)
        .context("cannot write the archive's checksum")
}

/// All files below `folder`, relative and sorted.
fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    let mut folders = vec![PathBuf::new()];
    while let Some(relative) = folders.pop() {
        for entry in fs::read_dir(folder.join(&relative))? {
            let entry = entry?;
            let path = relative.join(entry.file_name());
            if entry.file_type()?.is_dir() {
                folders.push(path);
            } else {
                found.push(path);
            }
        }
    }
    found.sort();
    Ok(found)
}

fn slashed(path: &Path) -> String {
    let parts: Vec<_> = path.iter().map(|part| part.to_string_lossy()).collect();
    parts.join("/")
}

fn sum(path: &Path) -> Result<String> {
    let bytes = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    let mut hex = String::new();
    for byte in Sha256::digest(&bytes) {
        write!(hex, "{byte:02x}")?;
    }
    Ok(hex)
}

#[cfg(test)]
mod tests {
    use super::{files, write, write_sums};
    use std::fs;

    #[test]
    fn the_same_files_give_the_same_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let bytes = ["one", "two"].map(|run| {
            let here = folder.path().join(run);
            fs::create_dir_all(here.join("docs")).unwrap();
            for name in ["ddfeed", "docs/index.html", "LICENSE"] {
                fs::write(here.join(name), name).unwrap();
            }
            write_sums(&here).unwrap();
            assert_eq!(files(&here).unwrap().len(), 4);
            let archive = folder.path().join(format!("{run}.tar.gz"));
            write(&here, "ddfeed-0", 1_000_000, &archive).unwrap();
            fs::read(archive).unwrap()
        });
        assert_eq!(bytes[0], bytes[1]);
    }

    #[test]
    fn the_sums_are_those_of_sha256sum() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("abc"), "abc").unwrap();
        write_sums(folder.path()).unwrap();
        let sums = fs::read_to_string(folder.path().join("SHA256SUMS")).unwrap();
        // FIPS 180-4, example B.1.
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad  abc\n";
        assert_eq!(sums, expected);
    }
}
