//! The web server: the page, and `/line` as a WebSocket.

use super::ScopeOptions;
use super::access::Access;
use super::relay;
use crate::drive::connect::DriveLine;
use crate::interrupt::ctrl_c;
use anyhow::{Context, Result};
use axum::Router;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{Query, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{Html, IntoResponse, Response};
use axum::routing::get;
use futures_util::{SinkExt, StreamExt};
use std::collections::HashMap;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex, mpsc};
use std::time::Duration;
use tokio::net::TcpListener;

/// Longest message of a page, bytes: many times the longest frame.
const MESSAGE_MAX: usize = 64 * 1024;
/// Pieces of the drive's bytes that wait for a page.
const WAITING: usize = 256;
/// How often Ctrl-C is looked for.
const LOOK: Duration = Duration::from_millis(50);

/// What all requests share.
struct Served {
    page: String,
    access: Access,
    line: DriveLine,
    /// A serial port or a probe has one page.
    taken: Mutex<bool>,
}

/// Serves until Ctrl-C.
pub fn run(options: &ScopeOptions, page: String) -> Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    runtime.block_on(async {
        let listener = TcpListener::bind(options.listen).await.with_context(|| {
            format!(
                "{} cannot be listened at: is a page served there? Give another with --listen",
                options.listen
            )
        })?;
        let access = Access::new(listener.local_addr()?)?;
        println!("{}", access.url(options.line.is_none()));
        eprintln!("open it in a browser; Ctrl-C ends it");
        let served = Arc::new(Served {
            page,
            access,
            line: DriveLine::of(options.line.as_ref(), options.baud),
            taken: Mutex::new(false),
        });
        let router = Router::new()
            .route("/", get(html))
            .route("/line", get(line))
            .with_state(served);
        let stop = ctrl_c().context("Ctrl-C cannot be caught")?;
        tokio::select! {
            ended = axum::serve(listener, router).into_future() => ended?,
            () = stopped(&stop) => {}
        }
        Ok(())
    })
}

async fn stopped(stop: &AtomicBool) {
    while !stop.load(Relaxed) {
        tokio::time::sleep(LOOK).await;
    }
}

type Words = Query<HashMap<String, String>>;

impl Served {
    /// The answer to a request that may not be.
    fn refused(&self, headers: &HeaderMap, words: &Words) -> Option<Response> {
        let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
        let token = words.get("token").map(String::as_str);
        self.access
            .refusal(text(header::HOST), text(header::ORIGIN), token)
            .map(|sentence| (StatusCode::FORBIDDEN, sentence).into_response())
    }
}

async fn html(State(served): State<Arc<Served>>, words: Words, headers: HeaderMap) -> Response {
    if let Some(refused) = served.refused(&headers, &words) {
        return refused;
    }
    let guards = [
        // The page has a policy of its own; this one keeps others from framing it.
        ("content-security-policy", "frame-ancestors 'none'"),
        ("x-content-type-options", "nosniff"),
        ("referrer-policy", "no-referrer"),
        ("cache-control", "no-store"),
    ];
    (guards, Html(served.page.clone())).into_response()
}

async fn line(
    State(served): State<Arc<Served>>,
    words: Words,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    if let Some(refused) = served.refused(&headers, &words) {
        return refused;
    }
    if let Err(sentence) = served.take() {
        return (StatusCode::CONFLICT, sentence).into_response();
    }
    let opened = served.clone();
    let opened = tokio::task::spawn_blocking(move || opened.line.open()).await;
    let line = match opened {
        Ok(Ok(line)) => line,
        Ok(Err(error)) => {
            served.give_back();
            return (StatusCode::BAD_GATEWAY, format!("{error:#}")).into_response();
        }
        Err(_) => {
            served.give_back();
            return StatusCode::INTERNAL_SERVER_ERROR.into_response();
        }
    };
    upgrade
        .max_message_size(MESSAGE_MAX)
        .on_upgrade(async move |socket| {
            pass(socket, line).await;
            served.give_back();
        })
}

impl Served {
    /// Takes the line for a page, if it is not taken. A simulated drive has a line for each page.
    fn take(&self) -> Result<(), &'static str> {
        if self.line.is_shared() {
            return Ok(());
        }
        let mut taken = self.taken.lock().map_err(|_| "The server has failed.")?;
        if *taken {
            return Err("Another page is connected to the drive: close it first.");
        }
        *taken = true;
        Ok(())
    }

    fn give_back(&self) {
        if let Ok(mut taken) = self.taken.lock() {
            *taken = false;
        }
    }
}

/// Passes bytes between a page and the drive until one is gone. The drive then comes to rest without heartbeats.
async fn pass(socket: WebSocket, line: Box<dyn link::host::client::Line + Send>) {
    let (to_drive, from_page) = mpsc::channel();
    let (to_page, mut from_drive) = tokio::sync::mpsc::channel(WAITING);
    relay::start(line, from_page, to_page);
    let (mut sink, mut stream) = socket.split();
    // Apart from each other: a page that reads nothing can still send a stop.
    let sent = async {
        while let Some(Ok(message)) = stream.next().await {
            if let Message::Binary(bytes) = message
                && to_drive.send(bytes.to_vec()).is_err()
            {
                return;
            }
        }
    };
    let received = async {
        while let Some(bytes) = from_drive.recv().await {
            if sink.send(Message::Binary(bytes.into())).await.is_err() {
                return;
            }
        }
    };
    tokio::select! {
        () = sent => {}
        () = received => {}
    }
}
