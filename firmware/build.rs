//! Puts `memory.x` where the linker finds it. The firmware is linked again when it changes.

use std::path::PathBuf;

fn main() -> std::io::Result<()> {
    // Cargo runs this in the package's folder, and names its output folder.
    let out = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets it"));
    std::fs::copy("../memory.x", out.join("memory.x"))?;
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rerun-if-changed=../memory.x");
    Ok(())
}
