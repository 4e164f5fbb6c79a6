//! What the emulator's build needs and a new machine may lack: cmake and libclang, as wheels in the target folder.

use anyhow::{Context, Result, ensure};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Where the wheels go, from the project's root.
const FOLDER: &str = "target/emulator-tools";

/// Environment of a command that builds the emulator.
pub struct EmulatorTools {
    variables: Vec<(&'static str, String)>,
}

impl EmulatorTools {
    /// Installs the wheels if they are not there.
    pub fn install(root: &Path) -> Result<Self> {
        let folder = root.join(FOLDER);
        let (cmake, libclang) = (folder.join("cmake/data/bin"), folder.join("clang/native"));
        if !cmake.join("cmake").exists() || !libclang.exists() {
            println!("> python3 -m pip install --target {FOLDER} cmake libclang");
            let pip = [
                "-m",
                "pip",
                "install",
                "--quiet",
                "--disable-pip-version-check",
                "--upgrade",
                "--target",
            ];
            let status = Command::new("python3")
                .args(pip)
                .arg(&folder)
                .args(["cmake", "libclang"])
                .status()
                .context("python3 could not be started: the emulator is built with the wheels `cmake` and `libclang`, so install Python 3 with pip")?;
            ensure!(
                status.success(),
                "pip could not install the wheels `cmake` and `libclang` into {}: see its message above",
                folder.display()
            );
        }
        let path = std::env::var("PATH").unwrap_or_default();
        Ok(Self {
            variables: vec![
                ("PATH", format!("{}:{path}", cmake.display())),
                ("LIBCLANG_PATH", libclang.display().to_string()),
                // The wheel brings the library, and none of the compiler's own headers.
                (
                    "BINDGEN_EXTRA_CLANG_ARGS",
                    format!("-I{}", compiler_headers()?.display()),
                ),
            ],
        })
    }

    /// Gives a command what it needs.
    pub fn give<'a>(&self, command: &'a mut Command) -> &'a mut Command {
        command.envs(self.variables.iter().map(|(name, value)| (name, value)))
    }
}

/// The folder of the C compiler's own headers (`stddef.h`).
fn compiler_headers() -> Result<PathBuf> {
    let output = Command::new("cc")
        .arg("-print-file-name=include")
        .output()
        .context(
            "cc could not be started: the emulator is built from C, so install a C compiler",
        )?;
    Ok(PathBuf::from(
        String::from_utf8_lossy(&output.stdout).trim(),
    ))
}
