//! The project's programs as a person starts them, at the emulated chip's probe.

#![allow(dead_code, reason = "each test uses a part of it")]

use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};
use std::sync::OnceLock;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, Instant};

/// `ddfeed`.
pub fn ddfeed() -> Command {
    Command::new(folder().join("ddfeed"))
}

/// What `cargo xtask flash | run | attach | bringup` starts.
pub fn board() -> Command {
    Command::new(folder().join("board"))
}

/// The folder of the programs. They are built as `cargo xtask test` builds them: other features would build every library again.
fn folder() -> &'static PathBuf {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    BUILT.get_or_init(|| {
        let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
        let built = Command::new(cargo)
            .args(["test", "--quiet", "--workspace", "--exclude", "firmware"])
            // The tests of these names are those of the two programs: cargo builds the programs for them.
            .args(["--features", "ddfeed/full", "--test", "probe", "--no-run"])
            .current_dir(xtask::tools::root().unwrap())
            .status()
            .unwrap();
        assert!(built.success(), "the programs do not build");
        xtask::tools::target_folder().unwrap().join("debug")
    })
}

/// What a program printed that succeeded.
#[track_caller]
pub fn printed(output: &Output) -> String {
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// A program that goes on until it is ended; it ends with the test.
pub struct Running {
    child: Child,
    lines: Receiver<String>,
    /// What it has printed and said so far.
    pub said: Vec<String>,
}

impl Running {
    /// Starts it.
    pub fn start(command: &mut Command) -> Self {
        let mut child = command
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let (to, lines) = channel();
        let error = to.clone();
        let (out, err) = (child.stdout.take().unwrap(), child.stderr.take().unwrap());
        let each = |lines: &mut dyn Iterator<Item = String>, to: &dyn Fn(String) -> bool| {
            lines.take_while(|line| to(line.clone())).for_each(drop);
        };
        thread::spawn(move || {
            let mut lines = BufReader::new(out).lines().map_while(Result::ok);
            each(&mut lines, &|line| to.send(line).is_ok());
        });
        thread::spawn(move || {
            let mut lines = BufReader::new(err).lines().map_while(Result::ok);
            each(&mut lines, &|line| error.send(line).is_ok());
        });
        Self {
            child,
            lines,
            said: Vec::new(),
        }
    }

    /// Waits for a line that has `part` in it, and gives it.
    #[track_caller]
    pub fn until(&mut self, part: &str, patience: Duration) -> String {
        let end = Instant::now() + patience;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            match self.lines.recv_timeout(left) {
                Ok(line) => {
                    self.said.push(line.clone());
                    if line.contains(part) {
                        return line;
                    }
                }
                Err(RecvTimeoutError::Timeout) => {
                    panic!(
                        "`{part}` was not said within {patience:?}: {:#?}",
                        self.said
                    )
                }
                Err(RecvTimeoutError::Disconnected) => {
                    panic!("it ended, and `{part}` was not said: {:#?}", self.said)
                }
            }
        }
    }

    /// Waits for its end: whether it succeeded.
    #[track_caller]
    pub fn ended(&mut self, patience: Duration) -> bool {
        let end = Instant::now() + patience;
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                self.said.extend(self.lines.try_iter());
                return status.success();
            }
            assert!(Instant::now() < end, "it goes on: {:#?}", self.said);
            thread::sleep(Duration::from_millis(10));
        }
    }

    /// Ends it as Ctrl-C does, by a signal that a shell's background jobs do not ignore.
    pub fn interrupt(&self) {
        let id = self.child.id().to_string();
        let sent = Command::new("kill").args(["-TERM", &id]).status();
        assert!(sent.unwrap().success());
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
