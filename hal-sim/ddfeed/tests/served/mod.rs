//! `serve` as a person runs it, and the commands of `drive` to it.

#![allow(dead_code, reason = "each test uses a part of it")]

use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// The program.
pub fn ddfeed() -> Command {
    Command::new(env!("CARGO_BIN_EXE_ddfeed"))
}

/// A served drive; it ends with the test.
pub struct Served {
    child: Child,
    pub address: String,
    pub terminal: Option<String>,
}

impl Served {
    pub fn new(arguments: &[&str]) -> Self {
        let mut child = ddfeed()
            .args(["serve", "--listen", "127.0.0.1:0"])
            .args(arguments)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let mut word_after = |mark: &str| {
            let line = lines.next().unwrap().unwrap();
            let (_, rest) = line.split_once(mark).unwrap_or_else(|| panic!("{line}"));
            rest.split_whitespace().next().unwrap().to_owned()
        };
        let address = word_after("--sim ");
        let terminal = arguments
            .contains(&"--pty")
            .then(|| word_after("--serial "));
        let served = Self {
            child,
            address,
            terminal,
        };
        served.until(match arguments.contains(&"--cold") {
            true => "unaligned",
            false => "ready",
        });
        served
    }

    pub fn line(&self) -> [&str; 2] {
        match &self.terminal {
            Some(terminal) => ["--serial", terminal],
            None => ["--sim", &self.address],
        }
    }

    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = ddfeed();
        command.arg("drive").args(self.line()).args(arguments);
        command
    }

    pub fn drive(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// Expects success, and gives what was printed.
    #[track_caller]
    pub fn printed(&self, arguments: &[&str]) -> String {
        let output = self.drive(arguments);
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{arguments:?}: {said}");
        String::from_utf8(output.stdout).unwrap()
    }

    /// Expects this code, and gives the sentence.
    #[track_caller]
    pub fn fails(&self, code: i32, arguments: &[&str]) -> String {
        let output = self.drive(arguments);
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {said}");
        assert!(!said.contains("panicked"), "{said}");
        said
    }

    #[track_caller]
    pub fn status(&self) -> Value {
        serde_json::from_str(&self.printed(&["status", "--json"])).unwrap()
    }

    #[track_caller]
    pub fn until(&self, state: &str) {
        let until = Instant::now() + Duration::from_secs(20);
        loop {
            let now = self.status();
            if now["state"] == state {
                return;
            }
            assert!(Instant::now() < until, "expected {state}: {now}");
            sleep(Duration::from_millis(50));
        }
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
