//! What drive and host say to each other: the one definition of every code, word and frame.
//!
//! | what | where | which way |
//! | --- | --- | --- |
//! | [`codes`]: state, fault, reset reason | in the view | |
//! | [`view::DriveView`], at the symbol [`VIEW_SYMBOL`] | the drive's RAM | the host reads, at any time, without halting |
//! | [`bringup`]: a request that survives a reset, and a report of raw readings | the drive's RAM | both |
//! | [`message`]s in [`frame`]s: commands, answers, settings, telemetry | a serial port at [`SERIAL_BAUD`], RTT channels [`LINK_UP_CHANNEL`] and [`LINK_DOWN_CHANNEL`], TCP | both |
//! | [`burst`]: every PWM period of a motor around a trigger | in the messages | |
//! | [`settings`]: what a person may set, by number | in the messages | |
//! | the log, in defmt's frames | RTT up-channel [`LOG_CHANNEL`] | the drive writes |
//!
//! With the feature `host`, [`host`] is the other end: it reads and decodes all of this through a chip's memory, be it
//! behind a debug probe or emulated. [`scale`] says in which steps the fixed-point words count.
#![cfg_attr(not(feature = "host"), no_std)]
#![forbid(unsafe_code)]

pub mod bringup;
pub mod burst;
pub mod codes;
pub mod frame;
#[cfg(feature = "host")]
pub mod host;
pub mod message;
pub mod scale;
pub mod settings;
pub mod telemetry;
pub mod view;

/// Number of the layout of everything here. Raise it with every change of a word, a code's meaning or a frame: a host
/// of another layout then reports it instead of reading nonsense.
pub const LAYOUT: u32 = 20;

/// Symbol of the firmware's [`view::DriveView`].
pub const VIEW_SYMBOL: &str = "DRIVE_VIEW";
/// Symbol of RTT's control block, as every RTT host knows it.
pub const RTT_SYMBOL: &str = "_SEGGER_RTT";
/// Symbol of the firmware's record of its last crash: a magic word, the text's length, and the text.
pub const CRASH_SYMBOL: &str = "DRIVE_CRASH";
/// Symbol of the firmware's [`Journal`](control::journal::Journal), which outlives a reset.
pub const JOURNAL_SYMBOL: &str = "DRIVE_JOURNAL";
/// Most bytes of that text.
pub const CRASH_TEXT: usize = 120;
/// RTT up-channel of the log.
pub const LOG_CHANNEL: usize = 0;
/// RTT up-channel of the frames, and of the bring-up's readings.
pub const LINK_UP_CHANNEL: usize = 1;
/// RTT down-channel of the frames.
pub const LINK_DOWN_CHANNEL: usize = 0;
/// Bits a second of the serial port: the highest that operating systems know by a name (Linux, `termios.h`, `B4000000`). The
/// full telemetry takes 2.3 million. An ST-LINK/V3 goes up to 15 million by its data sheet (ST, STLINK-V3MINI, "VCP frequency
/// up to 15 MHz"), and from an STM32G474 at 14 million by a measurement (weifengdq, csdn.net, article 113695910).
pub const SERIAL_BAUD: u32 = 4_000_000;
