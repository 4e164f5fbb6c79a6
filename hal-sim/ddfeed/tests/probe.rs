//! The commands that need a probe, where there is none: a sentence, in time, and no success.

use std::process::Command;
use std::time::{Duration, Instant};

/// A probe that is on this machine all the same is not this one.
const PROBE: &str = "--probe=no such probe";

#[test]
fn without_the_probe_each_command_says_so_within_five_seconds() {
    let out = tempfile::tempdir().unwrap();
    let folder = out.path().display().to_string();
    for arguments in [
        vec!["record", PROBE, "--duration", "1", &folder],
        vec!["drive", PROBE, "status"],
    ] {
        let start = Instant::now();
        let output = Command::new(env!("CARGO_BIN_EXE_ddfeed"))
            .args(&arguments)
            .output()
            .unwrap();
        let (took, said) = (start.elapsed(), String::from_utf8(output.stderr).unwrap());
        assert!(!output.status.success(), "{arguments:?}");
        assert!(took < Duration::from_secs(5), "{arguments:?}: {took:?}");
        assert!(
            said.starts_with("error: no debug probe found")
                || said.starts_with("error: none of the debug probes has"),
            "{arguments:?} said:\n{said}"
        );
    }
    let left = std::fs::read_dir(out.path()).unwrap().count();
    assert_eq!(left, 0, "nothing is written before there is a probe");
}
