//! The browser page as one HTML file: WebAssembly from the crate `scope`, the rest from `hal-sim/scope/web` by Node.
#![forbid(unsafe_code)]

use anyhow::{Context, Result, ensure};
use serde_json::{Map, Value};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use wasm_bindgen_cli_support::Bindgen;
use xtask::firmware::BROWSER;

/// Where the page's sources stand in a checkout.
const SOURCES: &str = "hal-sim/scope/web";
/// What a build of the page reads of them. `node_modules` stays out of the checkout.
const COPIED: [&str; 9] = [
    "package.json",
    "package-lock.json",
    "tsconfig.json",
    "build.mjs",
    "browser.mjs",
    "served.mjs",
    "measure",
    "src",
    "test",
];

/// A page that is being built.
#[derive(Debug)]
pub struct Page {
    /// A copy of the page's sources, with its libraries.
    pub folder: PathBuf,
    /// JavaScript and WebAssembly of the crate `scope`.
    pub wasm: PathBuf,
}

impl Page {
    /// Builds the WebAssembly of `checkout` and installs the page's libraries, in folders under `target`.
    /// `environment` and `words` go to cargo.
    ///
    /// # Errors
    /// Cargo, wasm-bindgen or npm fails, or Node is missing.
    pub fn prepare(
        checkout: &Path,
        target: &Path,
        words: &[&str],
        environment: &[(&str, String)],
    ) -> Result<Self> {
        let place = target.join("scope-page");
        let (folder, wasm) = (place.join("web"), place.join("wasm"));
        let build = [
            "build",
            "--locked",
            "--package",
            "scope",
            "--lib",
            "--profile",
            "web",
            "--target",
            BROWSER,
        ];
        let mut cargo = Command::new("cargo");
        cargo.args(build).args(words).current_dir(checkout);
        cargo.env("CARGO_TARGET_DIR", target);
        cargo.envs(environment.iter().map(|(name, value)| (*name, value)));
        run(&mut cargo, "cargo")?;
        let built = target.join(BROWSER).join("web/scope.wasm");
        Bindgen::new()
            .input_path(&built)
            .web(true)?
            .typescript(true)
            .remove_name_section(true)
            .remove_producers_section(true)
            .generate(&wasm)
            .with_context(|| format!("wasm-bindgen cannot read {}", built.display()))?;
        fs::create_dir_all(&folder)?;
        for name in COPIED {
            copy(&checkout.join(SOURCES).join(name), &folder.join(name))?;
        }
        let mut npm = Command::new("npm");
        npm.args(["ci", "--no-audit", "--no-fund", "--loglevel", "error"]);
        run(npm.current_dir(&folder), "npm")?;
        Ok(Self { folder, wasm })
    }

    /// Checks the types of the page's TypeScript.
    ///
    /// # Errors
    /// A type is wrong.
    pub fn check(&self) -> Result<()> {
        let mut npm = Command::new("npm");
        run(npm.args(["run", "check"]).current_dir(&self.folder), "npm")
    }

    /// Writes the page into `out`.
    ///
    /// # Errors
    /// The bundler fails.
    pub fn bundle(&self, out: &Path) -> Result<()> {
        if let Some(folder) = out.parent() {
            fs::create_dir_all(folder)?;
        }
        let mut node = Command::new("node");
        node.arg("build.mjs").arg(&self.wasm).arg(out);
        run(node.current_dir(&self.folder), "node")
    }

    /// Runs the page's tests in Chromium on the page `out`. Those of a served drive run
    /// the program of the variable `DDFEED`, which has all features, and are skipped without it.
    ///
    /// # Errors
    /// A test fails.
    pub fn test(&self, out: &Path) -> Result<()> {
        let mut npm = Command::new("npm");
        npm.args(["test"]).env("SCOPE_PAGE", out);
        run(npm.current_dir(&self.folder), "npm")
    }

    /// Measures the page `out` for so many seconds, and the WebAssembly against the native drive. Builds `ddfeed` for it, which
    /// serves the drive whose page is killed.
    ///
    /// # Errors
    /// A measurement fails.
    pub fn measure(
        &self,
        checkout: &Path,
        target: &Path,
        out: &Path,
        seconds: u32,
    ) -> Result<Map<String, Value>> {
        let native = self.folder.with_file_name("ten-seconds.txt");
        let mut cargo = Command::new("cargo");
        cargo.args(["run", "--quiet", "--locked", "--release"]);
        cargo.args(["--package", "scope", "--example", "ten_seconds"]);
        fs::write(&native, said(cargo.current_dir(checkout), "cargo")?)?;
        let program = program(checkout, target)?;
        let mut equal = Command::new("node");
        equal.arg("measure/equal.mjs").arg(&self.wasm).arg(&native);
        let mut page = Command::new("node");
        page.args(["measure/page.mjs", &seconds.to_string()]);
        page.env("SCOPE_PAGE", out).env("DDFEED", program);
        let mut all = Map::new();
        for command in [&mut equal, &mut page] {
            let figures = said(command.current_dir(&self.folder), "node")?;
            all.extend(serde_json::from_str::<Map<String, Value>>(&figures)?);
        }
        let page_mb = fs::metadata(out)?.len() as f64 / 1e6;
        all.insert("page_mb".into(), page_mb.into());
        Ok(all)
    }
}

/// Builds `ddfeed` with all features.
fn program(checkout: &Path, target: &Path) -> Result<PathBuf> {
    let mut cargo = Command::new("cargo");
    cargo.args(["build", "--quiet", "--locked", "--profile", "quick"]);
    cargo.args(["--package", "ddfeed", "--features", "full"]);
    cargo.env("CARGO_TARGET_DIR", target);
    run(cargo.current_dir(checkout), "cargo")?;
    Ok(target.join("quick/ddfeed"))
}

/// The standard output of a program.
fn said(command: &mut Command, name: &str) -> Result<String> {
    command.stderr(Stdio::inherit());
    let output = command.output().with_context(|| not_started(name))?;
    ensure!(
        output.status.success(),
        "`{command:?}` failed ({})",
        output.status
    );
    Ok(String::from_utf8(output.stdout)?)
}

fn not_started(name: &str) -> String {
    format!("{name} does not start: the page takes cargo, and Node 20 or newer with npm")
}

fn run(command: &mut Command, name: &str) -> Result<()> {
    let status = command.status().with_context(|| not_started(name))?;
    ensure!(status.success(), "`{command:?}` failed ({status})");
    Ok(())
}

/// Copies a file or a folder; what the target folder has beyond is removed.
fn copy(from: &Path, to: &Path) -> Result<()> {
    if !from.is_dir() {
        fs::copy(from, to).with_context(|| format!("cannot copy {}", from.display()))?;
        return Ok(());
    }
    if to.exists() {
        fs::remove_dir_all(to)?;
    }
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        copy(&entry.path(), &to.join(entry.file_name()))?;
    }
    Ok(())
}
