//! The page *Debug it*, as it says: its commands in their order, and in gdb where there is one.

#[path = "../probe/program.rs"]
mod program;

use given::Test;
use program::{Running, board, ddfeed};
use std::net::TcpListener;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

const PAGE: &str = include_str!("../../../docs/debug.md");
/// How long a command of the page may take: an alignment, with the chip's time slower than real.
const PATIENCE: Duration = Duration::from_secs(90);

/// A command, what is typed into it, and the words of each line that it is to print.
struct Asked {
    words: Vec<&'static str>,
    typed: Vec<&'static str>,
    lines: Vec<&'static str>,
}

/// The page's commands.
fn asked() -> Vec<Asked> {
    let mut all: Vec<Asked> = Vec::new();
    for block in PAGE.split("```text\n").skip(1) {
        let block = block.split("```").next().unwrap_or_default();
        for line in block.lines() {
            if let Some(command) = line.strip_prefix("$ ") {
                all.push(Asked {
                    words: command.split(' ').collect(),
                    typed: Vec::new(),
                    lines: Vec::new(),
                });
                continue;
            }
            let asked = all.last_mut().expect("a command comes first");
            match line.strip_prefix("(gdb) ") {
                Some(typed) => asked.typed.push(typed),
                None => asked.lines.push(line),
            }
        }
    }
    all
}

/// The served chip, and what the page's addresses and files are here.
struct Served {
    _emulate: Running,
    here: Vec<(&'static str, String)>,
}

impl Served {
    fn start(asked: &Asked) -> Self {
        let mut emulate = Command::new(env!("CARGO_BIN_EXE_emulate"));
        emulate.args(&asked.words[3..]);
        emulate.args(["--probe", "127.0.0.1:0", "--link", "127.0.0.1:0"]);
        let mut emulate = Running::start(&mut emulate);
        let mut word = |line: &str, place: usize| {
            let line = emulate.until(line, PATIENCE);
            line.split_whitespace().nth(place).unwrap().to_owned()
        };
        let gdb = TcpListener::bind("127.0.0.1:0").unwrap();
        let elf = word("The firmware is ", 3);
        let (probe, link) = (word("xtask attach", 4), word("drive --sim", 4));
        Self {
            _emulate: emulate,
            here: vec![
                ("target/thumbv7em-none-eabihf/firmware/firmware", elf),
                ("127.0.0.1:2331", probe),
                ("127.0.0.1:2332", link),
                (":1337", gdb.local_addr().unwrap().to_string()),
            ],
        }
    }

    fn here(&self, words: &str) -> String {
        self.here
            .iter()
            .fold(words.to_owned(), |words, (page, here)| {
                words.replace(page, here)
            })
    }

    /// A command of the page, as it is here.
    fn command(&self, asked: &Asked) -> Command {
        let (mut command, rest) = match asked.words[..] {
            ["cargo", "xtask", ref rest @ ..] => (board(), rest),
            ["cargo", "ddfeed" | "ddfeed-full", ref rest @ ..] => (ddfeed(), rest),
            [program, ref rest @ ..] => (Command::new(program), rest),
            [] => panic!("a command has words"),
        };
        command.args(rest.iter().map(|word| self.here(word)));
        command.current_dir(xtask::tools::root().unwrap());
        command
    }
}

/// It prints each of the page's lines.
fn prints(running: &mut Running, asked: &Asked) {
    for line in &asked.lines {
        for word in line.split(' ') {
            if !running.said.iter().any(|said| said.contains(word)) {
                running.until(word, PATIENCE);
            }
        }
    }
}

fn the_commands_do_what_the_page_says(_: &Path) {
    let asked = asked();
    let served = Served::start(&asked[0]);
    let own = asked[1..].iter().filter(|asked| asked.words[0] == "cargo");
    let mut count = 0;
    for asked in own {
        prints(&mut Running::start(&mut served.command(asked)), asked);
        count += 1;
    }
    assert!(count >= 3, "the page has {count} commands");
}

fn the_gdb_session_does_what_the_page_says(_: &Path) {
    let asked = asked();
    let served = Served::start(&asked[0]);
    let of = |program: &str| {
        let found = asked.iter().find(|asked| asked.words[0] == program);
        found.unwrap_or_else(|| panic!("the page has no {program}"))
    };
    let mut server = served.command(of("probe-rs"));
    server
        .arg("--gdb-connection-string")
        .arg(served.here(":1337"));
    let mut server = Running::start(&mut server);
    server.until("Firing up GDB stub", PATIENCE);
    let session = of("gdb-multiarch");
    let mut gdb = served.command(session);
    gdb.args(["-nx", "-batch"]);
    for typed in &session.typed {
        gdb.arg("-ex").arg(served.here(typed));
    }
    let mut gdb = Running::start(&mut gdb);
    prints(&mut gdb, session);
    assert!(gdb.ended(PATIENCE), "{:#?}", gdb.said);
}

/// Both are on the PATH.
fn there(programs: &[&str]) -> bool {
    programs.iter().all(|program| {
        let said = Command::new(program).arg("--version").output();
        said.is_ok_and(|said| said.status.success())
    })
}

fn main() {
    let root = xtask::tools::root().ok();
    let gdb = root
        .clone()
        .filter(|_| there(&["probe-rs", "gdb-multiarch"]));
    given::run([
        Test::new(
            "the workspace".into(),
            root,
            "the_commands_do_what_the_page_says",
            the_commands_do_what_the_page_says,
        ),
        Test::new(
            "probe-rs and gdb-multiarch".into(),
            gdb,
            "the_gdb_session_does_what_the_page_says",
            the_gdb_session_does_what_the_page_says,
        ),
    ])
}
