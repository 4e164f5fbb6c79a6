//! What clients ask, on its way to the thread that has the drive.

use foxglove::Schema;
use foxglove::websocket::service::{Handler, Request, Responder, Service as Served, ServiceSchema};
use foxglove::websocket::{
    AnyClient, GetParametersResponder, Parameter, ParameterHandler, ServerListener,
    SetParametersResponder,
};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, Sender, channel};

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

/// The clients' end of the queue, and what goes past it.
pub struct Clients(Arc<Post>);

struct Post {
    asks: Sender<Asked>,
    stop: AtomicBool,
    /// A client is gone.
    leaving: AtomicBool,
}

impl Clients {
    /// Of nobody yet; and the end of the queue that is served.
    pub fn new() -> (Self, Receiver<Asked>) {
        let (asks, asked) = channel();
        let post = Post {
            asks,
            stop: AtomicBool::new(false),
            leaving: AtomicBool::new(false),
        };
        (Self(Arc::new(post)), asked)
    }

    /// A stop is asked for, or a client is gone. Neither is taken.
    pub fn stop_or_leaving(&self) -> bool {
        self.0.stop.load(Relaxed) || self.0.leaving.load(Relaxed)
    }

    /// Takes the stop that is asked for.
    pub fn take_stop(&self) -> bool {
        self.0.stop.swap(false, Relaxed)
    }

    /// Takes the news that a client is gone.
    pub fn take_leaving(&self) -> bool {
        self.0.leaving.swap(false, Relaxed)
    }

    /// Hands what clients ask of parameters to the queue.
    pub fn parameters(&self) -> Arc<dyn ParameterHandler> {
        Arc::new(Parameters(Arc::clone(&self.0)))
    }

    /// Notices a client that goes away.
    pub fn listener(&self) -> Arc<dyn ServerListener> {
        Arc::new(Leaving(Arc::clone(&self.0)))
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
            post: Arc::clone(&self.0),
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
        self.0.leaving.store(true, Relaxed);
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
