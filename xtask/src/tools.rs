//! Tools from PyPI and Debian that the checks need and this machine may lack.
//!
//! | for | tool | from |
//! | --- | --- | --- |
//! | the emulator | its engine as a library, libclang, pkg-config | PyPI |
//! | the test of the cycle model | a C compiler for the chip | Debian |
//! | the test of MCAP files | a reader in Python | PyPI |
//! | the browser page | Node and Chromium | Debian |

use anyhow::{Context, Result, ensure};
use std::env;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// The emulator's engine as a static library, of the release before that of the crate: PyPI has no newer one. Its build from source takes
/// three minutes.
const ENGINE_VERSION: &str = "2.1.4";
/// The packages that read what `record --mcap` writes.
const MCAP_READER: [&str; 2] = ["mcap", "mcap-ros2-support"];

/// Variables for a cargo that builds the emulator. The first time this installs packages of PyPI into the target folder.
///
/// # Errors
/// Python is missing, or the packages cannot be fetched.
pub fn emulator_environment(target: &Path) -> Result<Vec<(&'static str, OsString)>> {
    let tools = target.join("tools");
    let bin = tools.join("bin");
    let description = tools.join("unicorn.pc");
    if !description.exists() {
        let engine = format!("unicorn=={ENGINE_VERSION}");
        install(&[&engine, "libclang", "pkgconf"], &tools)?;
        let folder = python_folder(&bin, "unicorn")?.join("lib");
        let text = format!(
            "Name: unicorn\nDescription: CPU emulator\nVersion: {ENGINE_VERSION}\nLibs: -L{} -lunicorn\n",
            folder.display()
        );
        fs::write(&description, text)
            .with_context(|| format!("cannot write {}", description.display()))?;
    }
    let old = env::var_os("PATH").unwrap_or_default();
    let path = env::join_paths([bin.clone()].into_iter().chain(env::split_paths(&old)))?;
    let mut variables = vec![
        ("PATH", path),
        ("PKG_CONFIG_PATH", tools.into_os_string()),
        (
            "LIBCLANG_PATH",
            python_folder(&bin, "clang")?.join("native").into(),
        ),
    ];
    // The wheel has no headers of the compiler's own (stdbool.h and the like); the C compiler has.
    if let Ok(include) = output("cc", &["-print-file-name=include"]) {
        variables.push((
            "BINDGEN_EXTRA_CLANG_ARGS",
            format!("-I{}", line(&include)).into(),
        ));
    }
    Ok(variables)
}

/// Where a Python environment has a package.
fn python_folder(bin: &Path, package: &str) -> Result<PathBuf> {
    let find = format!(
        "import importlib.util as u; print(u.find_spec('{package}').submodule_search_locations[0])"
    );
    let found = output(&bin.join("python").to_string_lossy(), &["-c", &find])?;
    Ok(line(&found).into())
}

/// Installs the Python reader of MCAP files into the target folder, if it is missing. One test needs it, and is ignored by name
/// without it: so nothing fails here.
pub fn mcap_reader(target: &Path) {
    let folder = target.join("mcap-reader");
    let python = folder.join("bin/python");
    if output(&python.to_string_lossy(), &["-c", "import mcap_ros2"]).is_ok() {
        return;
    }
    if let Err(error) = install(&MCAP_READER, &folder) {
        println!("not installed, so the test of MCAP files in Python is ignored: {error:#}");
    }
}

/// Installs packages into a Python environment of their own.
fn install(packages: &[&str], folder: &Path) -> Result<()> {
    println!(
        "> installing {} into {}",
        packages.join(", "),
        folder.display()
    );
    output("python3", &["-m", "venv", &folder.to_string_lossy()])?;
    let python = folder.join("bin/python");
    let pip = ["-m", "pip", "install", "--quiet"];
    output(&python.to_string_lossy(), &[&pip[..], packages].concat())?;
    Ok(())
}

/// Installs Node and Chromium, if they are missing and this is root on a Debian. `false` if one is missing then: the browser page is not
/// built and tested.
pub fn browser_tools() -> bool {
    let needed = [("node", "nodejs"), ("npm", "npm"), ("chromium", "chromium")];
    let missing = needed.into_iter().filter(|(program, _)| !runs(program));
    let packages: Vec<&str> = missing.map(|(_, package)| package).collect();
    if packages.is_empty() {
        return true;
    }
    match debian(&packages) {
        Ok(()) => true,
        Err(error) => {
            println!("not installed, so the browser page is not tested: {error:#}");
            false
        }
    }
}

/// Installs packages of Debian.
fn debian(packages: &[&str]) -> Result<()> {
    println!("> installing {}", packages.join(", "));
    let install = ["install", "--quiet", "--yes", "--no-install-recommends"];
    output("apt-get", &["update", "--quiet"])?;
    output("apt-get", &[&install[..], packages].concat())?;
    Ok(())
}

/// Installs a C compiler for the chip, if it is missing and this is root on a Debian. One test needs it, and is ignored by
/// name without it: so nothing fails here.
pub fn cross_compiler() {
    const PACKAGES: [&str; 2] = ["gcc-arm-none-eabi", "libnewlib-arm-none-eabi"];
    if runs("arm-none-eabi-gcc") {
        return;
    }
    if let Err(error) = debian(&PACKAGES) {
        println!("not installed, so the test of the cycle model is ignored: {error:#}");
    }
}

/// The folder that cargo builds into.
///
/// # Errors
/// The workspace is not found.
pub fn target_folder() -> Result<PathBuf> {
    match env::var_os("CARGO_TARGET_DIR") {
        Some(folder) => Ok(std::path::absolute(folder)?),
        None => Ok(root()?.join("target")),
    }
}

/// The workspace's root: above the package that cargo runs, or else above the current folder.
///
/// # Errors
/// Neither lies in this workspace.
pub fn root() -> Result<PathBuf> {
    let start = match env::var_os("CARGO_MANIFEST_DIR") {
        Some(package) => PathBuf::from(package),
        None => env::current_dir()?,
    };
    let root = start
        .ancestors()
        .find(|folder| folder.join("xtask/src/tools.rs").is_file());
    root.map(Path::to_path_buf).with_context(|| {
        format!(
            "{} is not in a clone of this project: run the command in the clone's folder",
            start.display()
        )
    })
}

fn runs(program: &str) -> bool {
    Command::new(program)
        .arg("--version")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

fn output(program: &str, arguments: &[&str]) -> Result<Output> {
    let line = format!("{program} {}", arguments.join(" "));
    let output = Command::new(program)
        .args(arguments)
        .output()
        .with_context(|| format!("`{line}` could not be started: is {program} installed?"))?;
    let message = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "`{line}` failed: {message}");
    Ok(output)
}

fn line(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).trim().to_owned()
}
