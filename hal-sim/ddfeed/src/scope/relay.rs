//! Bytes between a page and a drive's line, in a thread of their own.

use link::host::client::Line;
use std::sync::mpsc::{Receiver, TryRecvError};
use std::thread;
use std::time::Duration;
use tokio::sync::mpsc::Sender;
use tokio::sync::mpsc::error::TrySendError;

/// How long the drive's bytes are waited for before the page's are sent.
const WAIT: Duration = Duration::from_millis(2);

/// Passes bytes on until the page or the drive is gone. A page that stalls loses telemetry: its own bytes, as a stop, still go.
pub fn start(
    mut line: Box<dyn Line + Send>,
    from_page: Receiver<Vec<u8>>,
    to_page: Sender<Vec<u8>>,
) {
    thread::spawn(move || {
        let mut bytes = [0; 4096];
        loop {
            loop {
                match from_page.try_recv() {
                    Ok(sent) if line.send(&sent).is_err() => return,
                    Ok(_) => {}
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => return,
                }
            }
            let Ok(count) = line.receive(&mut bytes, WAIT) else {
                return;
            };
            if count > 0
                && let Err(TrySendError::Closed(_)) = to_page.try_send(bytes[..count].to_vec())
            {
                return;
            }
        }
    });
}
