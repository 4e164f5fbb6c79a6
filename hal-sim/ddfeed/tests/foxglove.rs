//! `ddfeed scope --foxglove`, as a client of the protocol sees it:
//! <https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md>.

mod served;

use plant::recording::{COLUMNS, Recording};
use serde_json::{Value, json};
use served::{Served, ddfeed};
use std::f64::consts::TAU;
use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::process::{Child, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use tungstenite::{ClientRequestBuilder, Error, Message, WebSocket};

/// Longest that an answer may take.
const PATIENCE: Duration = Duration::from_secs(30);
/// Opcodes of the protocol: a message's data, a call's request and its response.
const DATA: u8 = 1;
const REQUEST: u8 = 2;
const RESPONSE: u8 = 3;
/// Number of the tests' subscription.
const SUBSCRIPTION: u32 = 3;

struct Bridge {
    child: Child,
    address: String,
}

impl Bridge {
    fn new(served: &Served, arguments: &[&str]) -> Self {
        let mut child = ddfeed()
            .arg("scope")
            .args(served.line())
            .arg("--foxglove=127.0.0.1:0")
            .args(arguments)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap())
            .read_line(&mut line)
            .unwrap();
        let address = line.trim().strip_prefix("ws://").unwrap().to_owned();
        Self { child, address }
    }

    fn client(&self) -> Client {
        let request = format!("ws://{}", self.address).parse().unwrap();
        let request = ClientRequestBuilder::new(request).with_sub_protocol("foxglove.sdk.v1");
        let stream = TcpStream::connect(&self.address).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_millis(20)))
            .unwrap();
        let (socket, _) = tungstenite::client(request, stream).unwrap();
        Client {
            socket,
            services: Vec::new(),
        }
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }
}

struct Client {
    socket: WebSocket<TcpStream>,
    /// Names and numbers of the services.
    services: Vec<(String, u32)>,
}

impl Client {
    /// The first message that `wanted` takes; what comes before it is dropped.
    fn until<T>(&mut self, mut wanted: impl FnMut(&Message) -> Option<T>) -> T {
        let end = Instant::now() + PATIENCE;
        while Instant::now() < end {
            let message = match self.socket.read() {
                Ok(message) => message,
                Err(Error::Io(_)) => continue,
                Err(other) => panic!("{other}"),
            };
            if let Some(advertised) = object(&message)
                && advertised["op"] == "advertiseServices"
            {
                for service in advertised["services"].as_array().unwrap() {
                    let name = service["name"].as_str().unwrap().to_owned();
                    let number = service["id"].as_u64().unwrap();
                    self.services.push((name, number.try_into().unwrap()));
                }
            }
            if let Some(found) = wanted(&message) {
                return found;
            }
        }
        panic!("no such message within {PATIENCE:?}");
    }

    /// The first object with this operation.
    fn object(&mut self, operation: &str) -> Value {
        self.until(|message| object(message).filter(|object| object["op"] == operation))
    }

    fn say(&mut self, object: &Value) {
        self.socket.send(Message::text(object.to_string())).unwrap();
    }

    /// The number of a service; `None`: there is none of that name.
    fn service(&self, name: &str) -> Option<u32> {
        let found = self.services.iter().find(|(known, _)| known == name);
        found.map(|(_, number)| *number)
    }

    /// Calls a service, and gives its answer or its error.
    fn call(&mut self, name: &str) -> Result<Value, String> {
        let number = self.service(name).unwrap();
        let mut request = vec![REQUEST];
        for word in [number, 7, 4] {
            request.extend(u32::to_le_bytes(word));
        }
        request.extend(b"json{}");
        self.socket.send(Message::binary(request)).unwrap();
        self.until(|message| match message {
            Message::Binary(bytes) if bytes[0] == RESPONSE => {
                Some(Ok(serde_json::from_slice(&bytes[13 + 4..]).unwrap()))
            }
            _ => object(message)
                .filter(|object| object["op"] == "serviceCallFailure")
                .map(|object| Err(object["message"].to_string())),
        })
    }

    /// Sets a setting; what is answered is for the test to wait for.
    fn set(&mut self, name: &str, value: f64) {
        let asked = json!({ "name": name, "value": value });
        self.say(&json!({ "op": "setParameters", "parameters": [asked], "id": "set" }));
    }

    /// Subscribes to the telemetry.
    fn subscribe(&mut self) -> Value {
        let advertised = self.object("advertise");
        let channel = advertised["channels"][0].clone();
        let subscription = json!({ "id": SUBSCRIPTION, "channelId": channel["id"] });
        self.say(&json!({ "op": "subscribe", "subscriptions": [subscription] }));
        channel
    }

    /// The columns of the next row.
    fn row(&mut self) -> [f64; COLUMNS.len()] {
        self.until(|message| match message {
            Message::Binary(bytes) if bytes[0] == DATA => {
                assert_eq!(bytes[1..5], SUBSCRIPTION.to_le_bytes());
                // Opcode, subscription, time, encapsulation, stamp, an empty text with its padding.
                let (columns, rest) = bytes[13 + 4 + 8 + 8..].as_chunks();
                assert!(rest.is_empty() && columns.len() == COLUMNS.len());
                Some(std::array::from_fn(|column| {
                    f64::from_le_bytes(columns[column])
                }))
            }
            _ => None,
        })
    }

    fn parameter(&mut self, name: &str) -> Value {
        self.say(&json!({ "op": "getParameters", "parameterNames": [name], "id": "one" }));
        self.object("parameterValues")["parameters"][0]["value"].clone()
    }
}

fn object(message: &Message) -> Option<Value> {
    match message {
        Message::Text(text) => serde_json::from_str(text).ok(),
        _ => None,
    }
}

#[test]
fn a_client_sees_the_telemetry_and_the_settings_and_changes_nothing() {
    let served = Served::new(&[]);
    let bridge = Bridge::new(&served, &[]);
    let mut client = bridge.client();
    let channel = client.subscribe();
    assert_eq!(channel["topic"], "/drive");
    assert_eq!(channel["encoding"], "cdr");
    assert_eq!(channel["schemaEncoding"], "ros2msg");
    let schema = channel["schema"].as_str().unwrap();
    assert!(COLUMNS.iter().all(|name| schema.contains(name)), "{schema}");

    let times: Vec<f64> = (0..200).map(|_| client.row()[0]).collect();
    let steps = times.windows(2).map(|pair| pair[1] - pair[0]);
    assert!(
        steps.clone().all(|step| (step - 1e-3).abs() < 1e-6),
        "rows are not 1 ms apart: {:?}",
        steps.collect::<Vec<_>>()
    );

    assert_eq!(client.parameter("feed.lead_mm"), 5.0);
    let cutoff = client.parameter("tuning.speed_rad_s");
    client.set("tuning.speed_rad_s", 50.0);
    let status = client.object("status");
    let said = status["message"].as_str().unwrap();
    assert!(said.contains("--foxglove-commands"), "{said}");
    assert_eq!(client.parameter("tuning.speed_rad_s"), cutoff);
    assert!(client.service("stop").is_some());
    assert_eq!(client.service("arm"), None);
}

#[test]
fn a_client_that_may_command_arms_sets_and_stops() {
    let served = Served::new(&[]);
    let bridge = Bridge::new(&served, &["--foxglove-commands"]);
    let mut client = bridge.client();
    client.object("advertise");
    assert_eq!(client.parameter("feed.lead_mm"), 5.0);
    assert_eq!(client.call("arm").unwrap()["done"], "armed");
    assert_eq!(served.status()["armed"], true);

    client.set("tuning.speed_rad_s", 50.0);
    client.object("parameterValues");
    assert_eq!(client.parameter("tuning.speed_rad_s"), 50.0);
    client.set("feed.lead_mm", 10.0);
    let status = client.object("status");
    let said = status["message"].as_str().unwrap();
    assert!(said.contains("restarts"), "{said}");
    assert_eq!(client.parameter("feed.lead_mm"), 5.0);

    assert_eq!(
        client.call("home").unwrap()["done"].as_str().unwrap()[..6],
        *"homing"
    );
    served.until("running");
    assert_eq!(client.call("stop").unwrap()["done"], "comes to rest");
    served.until("ready");
    assert_eq!(served.status()["armed"], false);
}

/// A drive that homes for a client comes to rest when that client is gone.
#[test]
fn a_client_that_is_gone_leaves_the_drive_at_rest() {
    let served = Served::new(&[]);
    let bridge = Bridge::new(&served, &["--foxglove-commands"]);
    let mut client = bridge.client();
    client.object("advertise");
    client.parameter("feed.lead_mm");
    client.call("arm").unwrap();
    client.call("home").unwrap();
    served.until("running");
    drop(client);
    served.until("ready");
    assert_eq!(served.status()["table"]["homed"], false);
}

/// Who only looks leaves the motion of another session alone.
#[test]
fn a_viewer_that_is_gone_stops_nobody_else() {
    let served = Served::new(&[]);
    let bridge = Bridge::new(&served, &[]);
    let jog = ["jog", "--arm", "--table-speed", "2.5", "--duration", "4"];
    let mut jogging = served.command(&jog).stdout(Stdio::null()).spawn().unwrap();
    served.until("running");
    let mut client = bridge.client();
    client.object("advertise");
    drop(client);
    sleep(Duration::from_secs(1));
    assert_eq!(served.status()["state"], "running");
    assert!(jogging.wait().unwrap().success());
}

/// An alignment says how each encoder lies to its rotor. Rows after it have the rotors' angles, as a recording that begins then.
#[test]
fn rows_after_an_alignment_have_the_rotors_angles() {
    let served = Served::new(&["--cold", "--board", "nucleo"]);
    let bridge = Bridge::new(&served, &["--foxglove-commands"]);
    let mut client = bridge.client();
    client.subscribe();
    client.parameter("feed.lead_mm");
    assert_eq!(client.call("arm").unwrap()["done"], "armed");
    // What came while it aligned is published first.
    let end = Instant::now() + Duration::from_secs(1);
    let mut row = client.row();
    while Instant::now() < end {
        row = client.row();
    }

    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display().to_string();
    served.printed(&["record", &out, "--rate", "1000", "--duration", "0.2"]);
    let recording = Recording::load(&folder.path().join("record.csv.gz")).unwrap();
    let recorded = recording.samples().next().unwrap();
    for name in ["screw_angle_rad", "nut_angle_rad"] {
        let column = COLUMNS.iter().position(|known| *known == name).unwrap();
        let apart = (row[column] - recorded.column(column)) / TAU;
        assert!(
            (apart - apart.round()).abs() < 1e-3,
            "{name} is {} rad, recorded {} rad",
            row[column],
            recorded.column(column)
        );
    }
}

#[test]
fn an_address_that_others_reach_is_refused() {
    let served = Served::new(&[]);
    let output = ddfeed()
        .arg("scope")
        .args(served.line())
        .arg("--foxglove=0.0.0.0:0")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("only addresses of this computer"), "{said}");
    assert!(!output.status.success());
}
