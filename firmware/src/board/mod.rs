//! The boards. One module each holds its pins, amplifiers, dividers and limits; a cargo feature picks one.
//!
//! To add a board, in this order:
//!
//! 1. Numbers beside `mains_plate.rs`: the drive's own settings, A and V per count with their signs, guards.
//!    Numbers only, each with its source; what does not fit its fixed-point format stops the build.
//! 2. A module beside `mains_310v.rs` with the same public names: `PLATE`, `SETTINGS`, `OVER_CURRENT`, `DRIVER_FAULT`,
//!    `DRIVER_WAKE_S`, `AMPLIFIERS_SLEEP`, `BREAK_FILTER_S`, `GUARD`, `GUARDS`, `WATCH_LIMITS`, `GATE_PULL_DOWN_OHM`,
//!    `ScrewEncoder`, `NutEncoder`, `start_encoders`, `take_encoder_flags`, `claim`. In `claim` each pin goes once, by value,
//!    through a function of [`pins`] whose bounds only the right pin in the right alternate function meets; three shunts a motor have
//!    their places in [`shunts`].
//! 3. A feature in `Cargo.toml`, and two lines below.
//! 4. `cargo check --package firmware --target thumbv7em-none-eabihf --no-default-features --features board-yours`: a pin
//!    used twice is a use of a moved value, a wrong alternate function an unmet bound that names the pin.
//! 5. What is wired to which ADC channel, for the emulator (`tests/src/chip/wiring.rs`), and the plate in
//!    `tests/src/bench.rs`: then the tests can run it.
//! 6. A wiring page in `firmware/boards`, which a person can follow with a meter in hand.

mod claimed;
mod paper_machine;
mod pins;
mod shunts;
pub(crate) use claimed::{Claimed, Claims};
pub(crate) use pins::{EncoderParts, Pins, Ports};

#[cfg(feature = "board-nucleo")]
mod nucleo_g474re;
#[cfg(feature = "board-nucleo")]
pub(crate) use nucleo_g474re::*;

#[cfg(feature = "board-mains")]
mod mains_310v;
#[cfg(feature = "board-mains")]
pub(crate) use mains_310v::*;

#[cfg(not(any(feature = "board-nucleo", feature = "board-mains")))]
compile_error!(
    "pick a board: build with `--features board-nucleo`, or add a module beside nucleo_g474re.rs"
);
#[cfg(all(feature = "board-nucleo", feature = "board-mains"))]
compile_error!("pick one board: `--no-default-features` leaves the default one out");
