//! `cargo xtask release`: one archive with all that a user installs.
//!
//! | in the archive | from |
//! | --- | --- |
//! | `ddfeed` | the program with all features, for this computer |
//! | `firmware/*.elf` | each board at each PWM rate |
//! | `scope.html` | the browser page with the simulated drive, which `ddfeed scope` serves |
//! | `docs/` | the pages and the settings as HTML |
//! | `LICENSE`, `THIRD-PARTY.txt` | licences of the project and of each library that is linked |
//! | `sbom.json` | the same libraries, as CycloneDX 1.5 |
//! | `SHA256SUMS` | each file of the archive |
//!
//! Two runs of one commit give equal bytes: no file holds a path of this computer or a time of the build.
#![forbid(unsafe_code)]

mod archive;
mod book;
mod checkout;
mod compile;
mod licences;
mod packages;
mod sbom;
mod trial;
mod version;

use anyhow::{Context, Result};
use checkout::Checkout;
use clap::Parser;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use xtask::tools::{root, target_folder};

/// Build a release of what is committed, and try it.
#[derive(Parser)]
#[command(name = "cargo xtask release", bin_name = "cargo xtask release")]
struct Options {
    /// Folder for the archive.
    #[arg(long, value_name = "DIR", default_value = "out/release")]
    out: PathBuf,
    /// Build a version that the changelog does not have. The archive's name then has the commit.
    #[arg(long)]
    snapshot: bool,
}

fn run(options: &Options) -> Result<()> {
    let root = root()?;
    let commit = checkout::commit(&root)?;
    let version = env!("CARGO_PKG_VERSION");
    let changelog =
        fs::read_to_string(root.join("CHANGELOG.md")).context("cannot read CHANGELOG.md")?;
    let version = if options.snapshot {
        format!("{version}-{}", commit.short())
    } else {
        version::released(&changelog, version)?;
        version.to_owned()
    };
    let target = target_folder()?.join("release-build");
    let checkout = Checkout::export(&root, &commit)?;
    let name = archive_name(&version, &compile::host()?);
    let files = target.join(&name);
    collect(&checkout, &target, &files)?;
    fs::create_dir_all(&options.out)
        .with_context(|| format!("cannot make the folder {}", options.out.display()))?;
    let archive = options.out.join(format!("{name}.tar.gz"));
    archive::write(&files, &name, commit.time_s, &archive)?;
    trial::run(&archive, &name)?;
    println!("{}", archive.display());
    Ok(())
}

/// The archive without its ending, and the folder in it. `cargo binstall` looks for the same: see the metadata of `ddfeed`.
fn archive_name(version: &str, host: &str) -> String {
    format!("ddfeed-{version}-{host}")
}

/// Puts all files of the archive into a new folder.
fn collect(checkout: &Checkout, target: &Path, files: &Path) -> Result<()> {
    if files.exists() {
        fs::remove_dir_all(files).with_context(|| format!("cannot empty {}", files.display()))?;
    }
    fs::create_dir_all(files.join("firmware"))?;
    let program = compile::program(checkout, target)?;
    fs::copy(&program, files.join("ddfeed"))?;
    for firmware in compile::FIRMWARES {
        let elf = compile::firmware(checkout, target, firmware)?;
        fs::copy(elf, files.join("firmware").join(firmware.file))?;
    }
    compile::page(checkout, target)?.bundle(&files.join("scope.html"))?;
    let settings = compile::output(&program, &["settings"])?;
    book::write(checkout.folder.path(), &settings, &files.join("docs"))?;
    for text in ["README.md", "CHANGELOG.md", "LICENSE"] {
        fs::copy(checkout.folder.path().join(text), files.join(text))
            .with_context(|| format!("the checkout has no {text}"))?;
    }
    let packages = packages::linked(checkout.folder.path())?;
    fs::write(files.join("THIRD-PARTY.txt"), licences::texts(&packages)?)?;
    fs::write(files.join("sbom.json"), sbom::json(&packages)?)?;
    archive::write_sums(files)
}

fn main() -> ExitCode {
    match run(&Options::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cargo_metadata::MetadataCommand;
    use given::pages::commands;

    #[test]
    fn binstall_looks_for_the_archive() {
        let mut metadata = MetadataCommand::new();
        let workspace = metadata.no_deps().exec().unwrap();
        let mut packages = workspace.packages.iter();
        let program = packages.find(|package| package.name == "ddfeed").unwrap();
        let binstall = &program.metadata["binstall"];
        let filled = |key: &str| {
            let template = binstall[key].as_str().unwrap();
            let values = [
                ("{ name }", "ddfeed"),
                ("{ bin }", "ddfeed"),
                ("{ version }", "1.2.3"),
                ("{ target }", "riscv64-linux"),
                ("{ binary-ext }", ""),
            ];
            let fill = |text: String, (key, value): (&str, &str)| text.replace(key, value);
            values.into_iter().fold(template.to_owned(), fill)
        };
        let name = archive_name("1.2.3", "riscv64-linux");
        let url = filled("pkg-url");
        assert!(url.ends_with(&format!("/v1.2.3/{name}.tar.gz")), "{url}");
        assert_eq!(filled("bin-dir"), format!("{name}/ddfeed"));
        assert!(
            program
                .targets
                .iter()
                .any(|target| target.is_bin() && target.name == "ddfeed")
        );
    }

    #[test]
    fn commands_of_the_pages_are_read() {
        let commands = commands("cargo xtask release");
        assert!(!commands.is_empty());
        for command in commands {
            let read = Options::try_parse_from(&command.words[2..]);
            if let Err(error) = read
                && error.use_stderr()
            {
                panic!("{}: {error}", command.place);
            }
        }
    }
}
