//! The cycle model against cycles that others measured on a real Cortex-M4, of code that is not ours: the elliptic curve
//! library P256-Cortex-M4, nearly all of it assembly, so that the compiler has little say. Its README (in the package
//! `p256-cortex-m4-sys`) gives what five operations took on an nRF52840 with its instruction cache on, built by GCC with
//! `-O2`. The library's time does not depend on its data.
//!
//! What this does not cover: misses of that chip's cache are in the published figures and not in the model, the STM32G4's
//! flash has its own accelerator, and interrupts are entered by neither.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::rc::Rc;
use tests::chip::wiring::Wiring;
use tests::emulator::Emulator;
use tests::image::Image;
use tests::pins::AtRest;
use tests::timing::MODEL_ERROR_PERCENT;

const COMPILER: &str = "arm-none-eabi-gcc";
const PACKAGE: &str = "p256-cortex-m4-sys";

/// Operation and thousands of cycles that its README gives; `p256.c` measures them in this order.
const PUBLISHED: [(&str, f64); 5] = [
    ("key generation", 327.0),
    ("sign", 375.0),
    ("verify", 976.0),
    ("shared secret", 906.0),
    ("point decompression", 48.0),
];

/// How far the program may run, core cycles: three times what all of it takes.
const PATIENCE: u64 = 15_000_000;

fn main() {
    let compiler = Command::new(COMPILER).arg("--version").output().is_ok();
    let sources = compiler.then(sources).flatten();
    given::run([given::Test::new(
        format!("{COMPILER} and the sources of {PACKAGE}"),
        sources,
        "the_model_is_as_far_off_published_cycles_as_it_says",
        the_model_is_as_far_off_published_cycles_as_it_says,
    )])
}

/// The library's sources, where cargo has put the package.
fn sources() -> Option<PathBuf> {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
    let output = Command::new(cargo)
        .args(["metadata", "--format-version", "1", "--offline"])
        .args(["--manifest-path", "Cargo.toml"])
        .output()
        .ok()?;
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).ok()?;
    let packages = metadata["packages"].as_array()?;
    let package = packages.iter().find(|package| package["name"] == PACKAGE)?;
    let folder = Path::new(package["manifest_path"].as_str()?).parent()?;
    Some(folder.join("P256-Cortex-M4"))
}

fn build(sources: &Path) -> PathBuf {
    let here = Path::new("tests/published_cycles");
    let elf = Path::new(env!("CARGO_TARGET_TMPDIR")).join("p256.elf");
    let Output { status, stderr, .. } = Command::new(COMPILER)
        .args([
            "-mcpu=cortex-m4",
            "-mthumb",
            "-mfpu=fpv4-sp-d16",
            "-mfloat-abi=hard",
            "-O2",
            "-nostartfiles",
        ])
        .arg("-I")
        .arg(sources)
        .arg("-T")
        .args([here.join("link.ld"), here.join("p256.c")])
        .args(["p256-cortex-m4.c", "p256-cortex-m4-asm-gcc.S"].map(|file| sources.join(file)))
        .arg("-o")
        .arg(&elf)
        .output()
        .expect("the compiler starts");
    let said = String::from_utf8_lossy(&stderr);
    assert!(
        status.success(),
        "{COMPILER} does not build the library:\n{said}"
    );
    elf
}

fn the_model_is_as_far_off_published_cycles_as_it_says(sources: &Path) {
    let image = Rc::new(Image::read(&build(sources)).expect("an ELF"));
    let machine = Rc::new(RefCell::new(AtRest));
    let mut chip = Emulator::new(&image, Wiring::Nucleo, machine).expect("a chip");
    let at = |name: &str, k: u32| image.symbol(name).expect("a variable of p256.c") + 4 * k;
    let (done, right, cycles) = (at("done", 0), at("right", 0), |k| at("cycles", k));
    let mut time = 0;
    while chip.word(done).expect("RAM") != 1 {
        assert!(
            time < PATIENCE,
            "the library has not ended after {PATIENCE} cycles"
        );
        time += PATIENCE / 100;
        chip.run_until(time).expect("the library runs");
    }
    assert_eq!(
        chip.word(right),
        Ok(1),
        "a signature, a secret or a point came out wrong"
    );

    let idle = chip.word(cycles(0)).expect("RAM");
    let mut off = Vec::new();
    for (k, (operation, published)) in PUBLISHED.into_iter().enumerate() {
        let counted = chip.word(cycles(k as u32 + 1)).expect("RAM") - idle;
        let percent = 100.0 * (1e3 * published / f64::from(counted) - 1.0);
        println!(
            "{operation:>20}: model {counted:>7}, published {published:>4.0} k, {percent:+.2} % of the model"
        );
        off.push(percent);
    }
    let [least, most] = [f64::min, f64::max].map(|pick| off.iter().copied().fold(off[0], pick));
    assert!(
        least >= 0.0,
        "the model is {:.2} % above what was published, and says that it never is",
        -least
    );
    assert!(
        most <= MODEL_ERROR_PERCENT && most > MODEL_ERROR_PERCENT - 1.0,
        "a real core took at most {most:.2} % more than the model, which says {MODEL_ERROR_PERCENT} %: state what it is, \
         rounded up to a whole percent"
    );
}
