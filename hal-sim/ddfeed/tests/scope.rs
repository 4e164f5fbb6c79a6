//! `ddfeed scope`: the page, who may open it, and the line to a drive as a WebSocket.

mod served;

use link::codes::{Fault, State};
use link::host::session::Session;
use link::message::{Command, DriveFrame, Reply, Status};
use served::{Served, ddfeed};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use tungstenite::{ClientRequestBuilder, Error, Message, WebSocket};

const PAGE: &str = "<!doctype html><title>the page</title>";
/// Longest that an answer may take.
const PATIENCE: Duration = Duration::from_secs(5);

struct Scope {
    child: Child,
    address: String,
    _folder: tempfile::TempDir,
}

impl Scope {
    fn new(arguments: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let page = folder.path().join("scope.html");
        std::fs::write(&page, PAGE).unwrap();
        let mut child = ddfeed()
            .args(["scope", "--listen", "127.0.0.1:0", "--page"])
            .arg(page)
            .args(arguments)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        let mut said = BufReader::new(child.stdout.take().unwrap());
        said.read_line(&mut line).unwrap();
        let address = line.trim().strip_prefix("http://").unwrap();
        Self {
            address: address.split('/').next().unwrap().to_owned(),
            child,
            _folder: folder,
        }
    }

    /// An HTTP request, and the whole answer.
    fn get(&self, path: &str, host: &str) -> String {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        write!(
            stream,
            "GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n"
        )
        .unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }

    fn line(&self, origin: &str) -> Result<WebSocket<TcpStream>, Error> {
        let request = format!("ws://{}/line", self.address).parse().unwrap();
        let request = ClientRequestBuilder::new(request).with_header("Origin", origin);
        let stream = TcpStream::connect(&self.address).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_millis(20)))
            .unwrap();
        stream.set_nodelay(true).unwrap();
        tungstenite::client(request, stream)
            .map(|(socket, _)| socket)
            .map_err(|error| match error {
                tungstenite::HandshakeError::Failure(error) => error,
                other => panic!("{other}"),
            })
    }
}

impl Drop for Scope {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A page's session over its WebSocket.
struct Page {
    socket: WebSocket<TcpStream>,
    session: Session,
}

impl Page {
    fn open(scope: &Scope) -> Self {
        let socket = scope.line(&format!("http://{}", scope.address)).unwrap();
        let mut page = Self {
            socket,
            session: Session::new(),
        };
        assert!(matches!(page.ask(Command::Hello), Reply::Hello { .. }));
        page
    }

    fn send(&mut self, command: Command) {
        let bytes = self.session.request(command).unwrap();
        self.socket.send(Message::Binary(bytes.into())).unwrap();
    }

    fn ask(&mut self, command: Command) -> Reply {
        self.send(command);
        let (asked, until) = (self.session.sequence(), Instant::now() + PATIENCE);
        while Instant::now() < until {
            let bytes = match self.socket.read() {
                Ok(Message::Binary(bytes)) => bytes,
                Ok(_) | Err(Error::Io(_)) => continue,
                Err(error) => panic!("{error}"),
            };
            for &byte in bytes.iter() {
                if let Some(DriveFrame::Reply(sequence, reply)) = self.session.take(byte)
                    && sequence == asked
                {
                    return reply;
                }
            }
        }
        panic!("no answer to {command:?}");
    }

    fn status(&mut self) -> Status {
        match self.ask(Command::Status) {
            Reply::Status(status) => status,
            other => panic!("{other:?}"),
        }
    }

    fn state(&mut self) -> Option<State> {
        let status = self.status();
        State::of_words(status.state, status.fault)
    }

    /// Heartbeats for a while.
    fn beat(&mut self, time: Duration) {
        let until = Instant::now() + time;
        while Instant::now() < until {
            assert_eq!(self.ask(Command::Heartbeat), Reply::Done);
            sleep(Duration::from_millis(20));
        }
    }

    /// Arms and runs at 2.5 mm/s.
    fn run(&mut self) {
        assert_eq!(self.ask(Command::Arm), Reply::Done);
        let velocity = (2.5e-3 * f64::from(1 << 28)) as i32;
        let run = Command::Run {
            velocity,
            base: Some(0),
        };
        assert_eq!(self.ask(run), Reply::Done);
        self.beat(Duration::from_millis(500));
        assert_eq!(self.state(), Some(State::Running));
    }
}

#[test]
fn the_page_is_served_to_its_own_host_alone() {
    let scope = Scope::new(&[]);
    let page = scope.get("/", &scope.address);
    assert!(
        page.contains(PAGE) && page.contains("frame-ancestors 'none'"),
        "{page}"
    );
    for host in ["evil.example", "127.0.0.1:1"] {
        let refused = scope.get("/", host);
        assert!(refused.starts_with("HTTP/1.1 403"), "{refused}");
        assert!(!refused.contains(PAGE));
    }
    assert!(
        scope
            .get("/other", &scope.address)
            .starts_with("HTTP/1.1 404")
    );
    // Without a drive there is no line.
    let own = format!("http://{}", scope.address);
    assert!(matches!(scope.line(&own), Err(Error::Http(_))));
}

#[test]
fn a_foreign_page_gets_no_line() {
    let drive = Served::new(&[]);
    let scope = Scope::new(&drive.line());
    for origin in ["http://evil.example", "null", "https://localhost"] {
        match scope.line(origin) {
            Err(Error::Http(answer)) => assert_eq!(answer.status(), 403, "{origin}"),
            other => panic!("{origin}: {other:?}"),
        }
    }
}

#[test]
fn one_page_commands_another_watches_and_may_stop() {
    let drive = Served::new(&[]);
    let scope = Scope::new(&drive.line());
    let (mut first, mut second) = (Page::open(&scope), Page::open(&scope));
    first.run();
    let run = Command::Run {
        velocity: 0,
        base: None,
    };
    assert!(matches!(second.ask(run), Reply::Refused(_)));
    assert_eq!(second.state(), Some(State::Running));
    assert_eq!(second.ask(Command::Stop), Reply::Done);
    sleep(Duration::from_secs(1));
    assert_eq!(first.state(), Some(State::Ready));
}

/// Travel until rest, of a page that is killed at 2.5 mm/s with the default heartbeat of 0.5 s: 1.25 mm, and the way of the stop.
#[test]
fn a_page_that_is_killed_leaves_the_drive_at_rest() {
    let drive = Served::new(&[]);
    let scope = Scope::new(&drive.line());
    let mut watcher = Page::open(&scope);
    let mut page = Page::open(&scope);
    page.run();
    let before = watcher.status().scale;
    drop(page);
    sleep(Duration::from_secs(2));
    assert_eq!(watcher.state(), Some(State::Fault(Fault::CommandLost)));
    let rested = watcher.status().scale;
    sleep(Duration::from_millis(500));
    assert_eq!(watcher.status().motors[0].speed, 0);
    // The default scale counts 10 nm.
    let travel_mm = f64::from(rested - before) * 1e-5;
    println!("travel of a killed page: {travel_mm:.3} mm");
    assert!((0.5..1.6).contains(&travel_mm), "{travel_mm} mm");
}
