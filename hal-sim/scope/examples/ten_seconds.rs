//! Ten seconds of the default drive: prints each byte that it sent, in hexadecimal, a line for each 20 ms.
//!
//! The page's tests run the same in WebAssembly and compare the lines.

use scope::client::Client;
use scope::simulated::Simulated;

/// When each request is made, ms.
const REQUESTS: [(u32, &str); 5] = [
    (0, r#"{"command":"hello"}"#),
    (400, r#"{"command":"arm"}"#),
    (420, r#"{"command":"record","divider":1}"#),
    (
        440,
        r#"{"command":"run","velocity_mm_s":2.5,"common_speed_rpm":500}"#,
    ),
    (8000, r#"{"command":"stop"}"#),
];

fn main() -> anyhow::Result<()> {
    let mut drive = Simulated::new("mains", false, "")?;
    let (line, mut client) = (drive.open(), Client::new());
    for ms in (0..10_000).step_by(20) {
        let request = REQUESTS.iter().find(|(at, _)| *at == ms);
        let request = request.map_or(r#"{"command":"heartbeat"}"#, |(_, request)| request);
        drive.receive(line, &client.request(request)?);
        drive.advance(20);
        let bytes = drive.outgoing(line);
        client.push(&bytes);
        let text: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        println!("{text}");
    }
    Ok(())
}
