//! A session with the chip through a debug probe.

pub mod attach;
mod chip;
mod choose;
mod image;
pub mod line;
pub mod memory;
pub mod patience;

pub use chip::unreachable;
pub use image::Image;

use crate::session::Which;
use anyhow::{Context, Result};
use choose::choose;
use patience::watch;
use probe_rs::probe::list::Lister;
use probe_rs::probe::{DebugProbeInfo, DebugProbeSelector};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

/// How often a running drive is looked at.
const LOOK: Duration = Duration::from_millis(200);

/// The probe that was asked for, or the only one.
///
/// # Errors
/// There is no such probe, or more than one.
pub fn find(which: &Which) -> Result<DebugProbeInfo> {
    if let Some(address) = which.probe.as_deref().and_then(address) {
        return at(address);
    }
    let probes = watch("look for probes", patience::LIST, |_: &dyn Fn(())| {
        Ok(Lister::new().list_all())
    })?;
    choose(&probes, which.probe.as_deref()).cloned()
}

/// A network address in the place of a probe's name: host's number and port.
fn address(wanted: &str) -> Option<SocketAddr> {
    wanted.parse().ok()
}

/// The probe at a network address: an emulated chip's.
fn at(address: SocketAddr) -> Result<DebugProbeInfo> {
    let nobody = move || {
        format!(
            "no debug probe found at {address}, which --probe names: start an emulated chip with `cargo xtask emulate --probe \
             {address}`"
        )
    };
    // A Black Magic Probe's numbers: its protocol is what goes over a network.
    let selector = DebugProbeSelector {
        vendor_id: 0x1D50,
        product_id: 0x6018,
        interface: None,
        serial_number: Some(address.to_string()),
    };
    watch(
        "look for the probe",
        patience::LIST,
        move |_: &dyn Fn(())| {
            TcpStream::connect_timeout(&address, patience::LIST).with_context(nobody)?;
            let probes = Lister::new().list(Some(&selector));
            probes.into_iter().next().with_context(nobody)
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::TcpListener;

    #[test]
    fn an_address_names_the_probe_there_and_nobody_there_is_said() {
        assert_eq!(address("0041002D"), None);
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let free = listener.local_addr().unwrap();
        let which = Which {
            probe: Some(free.to_string()),
        };
        let found = find(&which).unwrap();
        assert_eq!(found.serial_number, Some(free.to_string()));
        drop(listener);
        let error = format!("{:#}", find(&which).unwrap_err());
        assert!(error.contains("cargo xtask emulate"), "{error}");
    }
}
