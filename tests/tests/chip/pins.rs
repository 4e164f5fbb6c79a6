//! A board whose pins are wrong does not compile, and the compiler says which pin and why.

use std::fs;
use std::path::{Path, PathBuf};
use tests::bench::cargo_on_firmware;

/// A copy of the workspace's sources, to spoil. It lies in the workspace's target folder, so cargo finds `.cargo` above it. A second one
/// would double the flags, and all dependencies would be checked again.
struct Copied(PathBuf);

impl Copied {
    fn new() -> Self {
        let root = Path::new("..");
        let copy = Path::new(env!("CARGO_TARGET_TMPDIR")).join("wrong-pins");
        let _ = fs::remove_dir_all(&copy);
        fs::create_dir_all(&copy).unwrap();
        for part in [
            "Cargo.toml",
            "Cargo.lock",
            "memory.x",
            "firmware",
            "hal-sim",
            "tests",
            "xtask",
        ] {
            copy_sources(&root.join(part), &copy.join(part));
        }
        Self(copy)
    }

    /// Checks the firmware with `from` made `to` in the default board's module: what the compiler says, or nothing if it
    /// is content.
    fn check(&self, from: &str, to: &str) -> Option<String> {
        let board = self.0.join("firmware/src/board/nucleo_g474re.rs");
        let good = fs::read_to_string(&board).unwrap();
        assert_eq!(
            good.matches(from).count(),
            1,
            "`{from}` is in the board once"
        );
        fs::write(&board, good.replace(from, to)).unwrap();
        // Into the same folder as the firmware's own checks, whose dependencies it shares.
        let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("..");
        let output = cargo_on_firmware("check")
            .arg("--target-dir")
            .arg(target)
            .current_dir(&self.0)
            .output()
            .unwrap();
        fs::write(&board, good).unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        (!output.status.success()).then_some(said)
    }
}

fn copy_sources(from: &Path, to: &Path) {
    if from.is_dir() {
        if from.file_name().is_some_and(|name| name == "target") {
            return;
        }
        fs::create_dir_all(to).unwrap();
        for entry in fs::read_dir(from).unwrap() {
            let entry = entry.unwrap();
            copy_sources(&entry.path(), &to.join(entry.file_name()));
        }
    } else {
        fs::copy(from, to).unwrap();
    }
}

#[test]
fn a_pin_used_twice_or_in_a_wrong_function_does_not_compile() {
    let copied = Copied::new();
    let right = "b.pb3.into_alternate::<1>()";
    assert_eq!(copied.check(right, right), None, "the board as it is");
    for (from, to, says) in [
        // PA11 could count the scale, but is a low side already.
        (
            "b.pb6.into_alternate::<2>()",
            "a.pa11.into_alternate::<10>()",
            ["use of moved value", "a.pa11"],
        ),
        // PB14 could take the bus, but is a shunt's already.
        (
            "b.pb12.into_analog()",
            "b.pb14.into_analog()",
            ["use of moved value", "b.pb14"],
        ),
        // A function that the pin has, but not the encoder's.
        (
            right,
            "b.pb3.into_alternate::<6>()",
            ["is not satisfied", "Pin<'B', 3, Alternate<6>>"],
        ),
        // A pin that is no input of that ADC.
        (
            "c.pc1.into_analog()",
            "b.pb3.into_analog()",
            ["is not satisfied", "Pin<'B', 3>: Channel<Ad<"],
        ),
    ] {
        let said = copied
            .check(from, to)
            .unwrap_or_else(|| panic!("{to} compiles"));
        for word in says {
            assert!(
                said.contains(word),
                "{to}: `{word}` is not in what the compiler says:\n{said}"
            );
        }
    }
}
