//! The boards. One module each holds its pins, amplifiers, dividers and limits; a cargo feature picks one.

#[cfg(feature = "board-nucleo")]
mod pins;
pub(crate) use pins::Ports;
mod nucleo_g474re;
#[cfg(feature = "board-nucleo")]
pub(crate) use nucleo_g474re::*;

#[cfg(not(feature = "board-nucleo"))]
compile_error!(
    "pick a board: build with `--features board-nucleo`, or add a module beside nucleo_g474re.rs"
);
