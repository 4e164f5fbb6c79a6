//! The chip's memory through the probe, with nothing halted.
//!
//! probe-rs's own session clears the core's breakpoints when it attaches and halts the core for that. The bridges of a
//! running drive would hold their last voltages meanwhile; so only flashing, which stops the drive anyway, opens a
//! session, and all else reads and writes through the debug port's memory access alone.

use super::chip;
use super::patience::{ANSWER, watch_from};
use anyhow::{Context, Result};
use link::host::Memory;
use probe_rs::architecture::arm::FullyQualifiedApAddress;
use probe_rs::architecture::arm::dp::DpAddress;
use probe_rs::architecture::arm::memory::ArmMemoryInterface;
use probe_rs::architecture::arm::sequences::DefaultArmSequence;
use probe_rs::probe::{DebugProbeInfo, Probe, WireProtocol};

/// Clock of the wire, kHz: what an ST-LINK V3 has at most; a slower probe takes the next below.
const SPEED_KHZ: u32 = 24_000;

/// The chip's memory.
pub struct Target<'a>(&'a mut dyn ArmMemoryInterface);

impl Memory for Target<'_> {
    fn read(&mut self, address: u32, bytes: &mut [u8]) -> Result<()> {
        self.0
            .read(u64::from(address), bytes)
            .with_context(|| format!("the chip's memory at {address:#010x} cannot be read: is the probe still connected, and is the board powered?"))
    }

    fn write(&mut self, address: u32, word: u32) -> Result<()> {
        self.0
            .write_word_32(u64::from(address), word)
            .with_context(|| format!("the chip's memory at {address:#010x} cannot be written: is the probe still connected, and is the board powered?"))
    }
}

/// Opens the probe.
///
/// # Errors
/// It does not open, or has no SWD.
pub fn open(info: &DebugProbeInfo) -> Result<Probe> {
    let mut probe = info.open().with_context(|| {
        format!("the probe {info} does not open: is another debugger using it, and may this user open it? End the other session, then \
             try again")
    })?;
    // A probe that cannot set its speed keeps the one it has.
    let _ = probe.set_speed(SPEED_KHZ);
    // Some probes know no other wire; those that do must be told.
    probe.select_protocol(WireProtocol::Swd).with_context(|| {
        format!("the probe {info} has no serial wire debug (SWD), which the chip is reached by")
    })?;
    Ok(probe)
}

/// Opens the probe, checks the chip, and does `work` on its memory in a thread; what `work` says goes to `each`. `work`
/// must say something at least every [`ANSWER`].
///
/// # Errors
/// The probe or the chip cannot be reached, it is another chip or a locked one, or what `work` or `each` returns.
pub fn with_chip<E: Send + 'static, T: Send + 'static>(
    info: DebugProbeInfo,
    work: impl FnOnce(Target<'_>, &dyn Fn(E)) -> Result<T> + Send + 'static,
    mut each: impl FnMut(E) -> Result<()>,
) -> Result<T> {
    let name = info.to_string();
    watch_from(
        "talk to the chip",
        move |say: &dyn Fn(Option<E>)| {
            let lost = |error: &dyn std::error::Error| chip::unreachable(&info, error);
            let mut probe = open(&info)?;
            probe
                .attach_to_unspecified()
                .map_err(|error| lost(&error))?;
            let mut arm = probe
                .try_into_arm_debug_interface(DefaultArmSequence::create())
                .map_err(|(_, error)| lost(&error))?;
            arm.select_debug_port(DpAddress::Default)
                .map_err(|error| lost(&error))?;
            let mut memory = arm
                .memory_interface(&FullyQualifiedApAddress::v1_with_default_dp(0))
                .map_err(|error| lost(&error))?;
            let mut target = Target(&mut *memory);
            chip::check(&mut target)?;
            say(None);
            work(target, &|said| say(Some(said)))
        },
        |said| said.map_or(Ok(()), &mut each),
        || chip::silent(&name, ANSWER),
    )
}
