//! What clients ask, on its way to the thread that has the drive.

use foxglove::Schema;
use foxglove::websocket::service::{Handler, Request, Responder, Service as Served, ServiceSchema};
use foxglove::websocket::{
    AnyClient, GetParametersResponder, Parameter, ParameterHandler, ServerListener,
    SetParametersResponder,
};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};

/// A service of the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Service {
    /// Come to rest.
    Stop,
    /// Let it be moved; align it first, where it is not.
    Arm,
    /// Find the table's zero.
    Home,
}

impl Service {
    const fn name(self) -> &'static str {
        match self {
            Self::Stop => "stop",
            Self::Arm => "arm",
            Self::Home => "home",
        }
    }
}

/// What a client asks.
#[derive(Debug)]
pub enum Asked {
    /// The settings of these names; of none: all.
    Get(Vec<String>, GetParametersResponder),
    /// Sets settings.
    Set(Vec<Parameter>, SetParametersResponder),
    /// Calls a service.
    Service(Service, Responder),
}

/// The queue of all clients, and their stop, which goes past it.
pub struct Clients {
    asked: Mutex<Receiver<Asked>>,
    post: Arc<Post>,
}

/// The clients' end.
struct Post {
    asks: Sender<Asked>,
    stop: AtomicBool,
}

impl Clients {
    /// Of nobody yet.
    pub fn new() -> Self {
        let (asks, asked) = channel();
        Self {
            asked: Mutex::new(asked),
            post: Arc::new(Post {
                asks,
                stop: AtomicBool::new(false),
            }),
        }
    }

    /// What was asked first.
    pub fn next(&self) -> Option<Asked> {
        let asked = self.asked.lock().unwrap_or_else(PoisonError::into_inner);
        asked.try_recv().ok()
    }

    /// Whether a stop is asked for. It is answered by [`Self::take_stop`].
    pub fn stop_is_asked(&self) -> bool {
        self.post.stop.load(Relaxed)
    }

    /// Takes the stop that is asked for.
    pub fn take_stop(&self) -> bool {
        self.post.stop.swap(false, Relaxed)
    }

    /// Hands what clients ask of parameters to the queue.
    pub fn parameters(&self) -> Arc<dyn ParameterHandler> {
        Arc::new(Parameters(Arc::clone(&self.post)))
    }

    /// A client that goes away stops the drive.
    pub fn listener(&self) -> Arc<dyn ServerListener> {
        Arc::new(Leaving(Arc::clone(&self.post)))
    }

    /// A service whose calls go to the queue.
    pub fn service(&self, service: Service) -> Served {
        let none = Schema::new("nothing", "jsonschema", br#"{"type":"object"}"#);
        let done = Schema::new(
            "done",
            "jsonschema",
            br#"{"type":"object","properties":{"done":{"type":"string"}}}"#,
        );
        let schema = ServiceSchema::new(service.name())
            .with_request("json", none)
            .with_response("json", done);
        Served::builder(service.name(), schema).handler(Call {
            service,
            post: Arc::clone(&self.post),
        })
    }
}

struct Parameters(Arc<Post>);

impl ParameterHandler for Parameters {
    fn get(
        &self,
        _: AnyClient,
        names: Vec<String>,
        _: Option<String>,
        responder: GetParametersResponder,
    ) {
        self.0.put(Asked::Get(names, responder));
    }

    fn set(
        &self,
        _: AnyClient,
        parameters: Vec<Parameter>,
        _: Option<String>,
        responder: SetParametersResponder,
    ) {
        self.0.put(Asked::Set(parameters, responder));
    }
}

struct Leaving(Arc<Post>);

impl ServerListener for Leaving {
    fn on_client_disconnect(&self) {
        self.0.stop.store(true, Relaxed);
    }
}

struct Call {
    service: Service,
    post: Arc<Post>,
}

impl Handler for Call {
    fn call(&self, _: Request, responder: Responder) {
        if self.service == Service::Stop {
            self.post.stop.store(true, Relaxed);
        }
        self.post.put(Asked::Service(self.service, responder));
    }
}

impl Post {
    fn put(&self, asked: Asked) {
        // The thread is gone with the program only; a responder that is dropped answers with an error.
        let _ = self.asks.send(asked);
    }
}
