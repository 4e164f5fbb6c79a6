//! The functions and classes that JavaScript calls. Objects pass as JSON text. Errors are sentences.

use crate::burst;
use crate::client::Client;
use crate::loops::{self, Rates};
use crate::simulated::Simulated;
use crate::{analysis, identification, schema, signals};
use hal_sim::vrf;
use serde_json::{Value, json};
use wasm_bindgen::prelude::{JsError, wasm_bindgen};

fn thrown(error: &anyhow::Error) -> JsError {
    JsError::new(&format!("{error:#}"))
}

/// See [`Simulated`].
#[wasm_bindgen]
#[derive(Debug)]
pub struct SimulatedDrive(Simulated);

#[wasm_bindgen]
impl SimulatedDrive {
    /// See [`Simulated::new`].
    ///
    /// # Errors
    /// As [`Simulated::new`].
    #[wasm_bindgen(constructor)]
    pub fn new(board: &str, cold: bool, effects: &str) -> Result<Self, JsError> {
        Simulated::new(board, cold, effects)
            .map(Self)
            .map_err(|error| thrown(&error))
    }

    /// See [`Simulated::open`].
    pub fn open(&mut self) -> u32 {
        self.0.open()
    }

    /// See [`Simulated::close`].
    pub fn close(&mut self, line: u32) {
        self.0.close(line);
    }

    /// See [`Simulated::receive`].
    pub fn receive(&mut self, line: u32, bytes: &[u8]) {
        self.0.receive(line, bytes);
    }

    /// See [`Simulated::outgoing`].
    pub fn outgoing(&mut self, line: u32) -> Vec<u8> {
        self.0.outgoing(line)
    }

    /// See [`Simulated::advance`].
    pub fn advance(&mut self, ms: u32) {
        self.0.advance(ms);
    }

    /// See [`Simulated::ms`].
    #[must_use]
    pub fn ms(&self) -> f64 {
        self.0.ms() as f64
    }

    /// See [`Simulated::declared`].
    #[must_use]
    pub fn declared(&self) -> String {
        self.0.declared()
    }

    /// See [`Simulated::machine`].
    #[must_use]
    pub fn machine(&self) -> String {
        self.0.machine().to_string()
    }
}

/// See [`Client`].
#[wasm_bindgen]
#[derive(Debug, Default)]
pub struct Session(Client);

#[wasm_bindgen]
impl Session {
    /// See [`Client::new`].
    #[wasm_bindgen(constructor)]
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// See [`Client::request`].
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn request(&mut self, command: &str) -> Result<Vec<u8>, JsError> {
        self.0.request(command).map_err(|error| thrown(&error))
    }

    /// See [`Client::sequence`].
    #[must_use]
    pub fn sequence(&self) -> u32 {
        self.0.sequence()
    }

    /// See [`Client::push`].
    pub fn push(&mut self, bytes: &[u8]) -> String {
        Value::from(self.0.push(bytes)).to_string()
    }

    /// See [`Client::rows`].
    pub fn rows(&mut self) -> Vec<f64> {
        self.0.rows()
    }

    /// See [`Client::burst_rows`].
    #[must_use]
    pub fn burst_rows(&self) -> Vec<f64> {
        self.0.burst_rows()
    }

    /// See [`Client::commission`].
    ///
    /// # Errors
    /// As [`Client::commission`].
    pub fn commission(&mut self, wanted: &str) -> Result<(), JsError> {
        self.0.commission(wanted).map_err(|error| thrown(&error))
    }

    /// See [`Client::poll_commissioning`].
    ///
    /// # Errors
    /// As [`Client::poll_commissioning`].
    pub fn poll_commissioning(&mut self, ms: f64) -> Result<Vec<u8>, JsError> {
        self.0
            .poll_commissioning(ms)
            .map_err(|error| thrown(&error))
    }

    /// See [`Client::commissions`].
    #[must_use]
    pub fn commissions(&self) -> bool {
        self.0.commissions()
    }

    /// See [`Client::stop_commissioning`].
    pub fn stop_commissioning(&mut self) {
        self.0.stop_commissioning();
    }

    /// See [`Client::commissioning`].
    #[must_use]
    pub fn commissioning(&self) -> String {
        self.0.commissioning().to_string()
    }

    /// See [`Client::begin_recording`].
    pub fn begin_recording(&mut self) {
        self.0.begin_recording();
    }

    /// See [`Client::take_recording`].
    pub fn take_recording(&mut self) -> Vec<f64> {
        self.0.take_recording()
    }

    /// See [`Client::declared`].
    ///
    /// # Errors
    /// As [`Client::declared`].
    pub fn declared(&self) -> Result<String, JsError> {
        self.0.declared().map_err(|error| thrown(&error))
    }

    /// See [`Client::compensation`].
    ///
    /// # Errors
    /// As [`Client::compensation`].
    pub fn compensation(&self, model: &str) -> Result<String, JsError> {
        let found = self.0.compensation(model).map_err(|error| thrown(&error))?;
        Ok(found.to_string())
    }

    /// See [`Client::counts`].
    #[must_use]
    pub fn counts(&self) -> String {
        self.0.counts().to_string()
    }
}

/// See [`identification::operating_points`].
#[wasm_bindgen]
#[must_use]
pub fn operating_points() -> String {
    identification::operating_points().to_string()
}

/// See [`identification::identify`].
///
/// # Errors
/// As [`identification::identify`].
#[wasm_bindgen]
pub fn identify(declared: &str, fit: &[f64], check: &[f64]) -> Result<String, JsError> {
    let found = identification::identify(declared, fit, check).map_err(|error| thrown(&error))?;
    Ok(found.to_string())
}

/// See [`signals::list`].
#[wasm_bindgen]
#[must_use]
pub fn signals() -> String {
    signals::list().to_string()
}

/// See [`burst::signals`].
#[wasm_bindgen]
#[must_use]
pub fn burst_signals() -> String {
    burst::signals().to_string()
}

/// See [`schema::settings`].
#[wasm_bindgen]
#[must_use]
pub fn settings_schema() -> String {
    schema::settings().to_string()
}

/// See [`schema::injections`].
#[wasm_bindgen]
#[must_use]
pub fn injections() -> String {
    schema::injections().to_string()
}

/// See [`analysis::ripple`]; `{"error": sentence}` where there is none.
#[wasm_bindgen]
#[must_use]
pub fn ripple(table_m: &[f64], interval_s: f64) -> String {
    analysis::ripple(table_m, interval_s)
        .unwrap_or_else(|error| json!({ "error": format!("{error:#}") }))
        .to_string()
}

/// See [`loops::predicted`]; `values` is a JSON object. `{"error": sentence}` where a value is not possible.
#[wasm_bindgen]
#[must_use]
pub fn loops(values: &str, pwm_hz: f64, speed_hz: f64) -> String {
    serde_json::from_str(values)
        .map_err(anyhow::Error::from)
        .and_then(|values| loops::predicted(&values, Rates { pwm_hz, speed_hz }))
        .unwrap_or_else(|error| json!({ "error": format!("{error:#}") }))
        .to_string()
}

/// See [`vrf::spectrum`]: pairs of frequency, Hz, and amplitude.
#[wasm_bindgen]
#[must_use]
pub fn spectrum(values: &[f64], interval_s: f64) -> Vec<f64> {
    vrf::spectrum(values, 1.0 / interval_s)
        .into_iter()
        .flat_map(|(hz, amplitude)| [hz, amplitude])
        .collect()
}

/// See [`analysis::orders`].
#[wasm_bindgen]
#[must_use]
pub fn orders(values: &[f64], angle_rad: &[f64]) -> Vec<f64> {
    analysis::orders(values, angle_rad)
}

/// Version of the page and layout of the link.
#[wasm_bindgen]
#[must_use]
pub fn about() -> String {
    json!({ "version": env!("CARGO_PKG_VERSION"), "layout": link::LAYOUT }).to_string()
}
