//! The bring-up: a start that reads the board instead of arming the bridges. [`link::bringup`] has what is asked and said.
//!
//! It is a mode of the drive's own firmware, not a firmware of its own: what it reads are the clocks, pins, converters,
//! comparators and timers as the drive has set them up, by the code that the drive starts with. It is entered by a request
//! in RAM that a reset keeps and a power cycle does not; two words must match, and the first thing that it does is to take
//! the request back. From then on interrupts stay masked, and nothing returns to the drive but a reset.
//!
//! In the first stage the gate drivers stay asleep, and the bridges' pins are inputs until the last item but two, so that what the timers do
//! meanwhile does not reach the power stage; then the timers drive them to their idle level, both switches off. With a
//! voltage on the bus it refuses. The second stage is `powered`.
//! Everything waited for has a bound.

mod breaks;
mod clock;
mod comparators;
mod converters;
mod encoders;
mod flash;
mod pins;
mod powered;
mod stream;

use crate::board;
use crate::hw::analog::{self, Converters};
use crate::hw::clock::{ADC_HZ, CORE_HZ};
use crate::hw::encoder::Encoder;
use control::plate::MotorPlate;
use core::sync::atomic::AtomicU32;
use core::sync::atomic::Ordering::Relaxed;
use cortex_m::peripheral::DWT;
use link::bringup::{
    BUS_LIMIT_V, BringupReport, BringupRequest, POWERED_V, REPORT_MAGIC, REQUEST_MAGIC, Stage,
};
use rtt_target::UpChannel;

/// At a symbol that the host knows; a reset keeps it.
#[used]
#[unsafe(no_mangle)]
#[unsafe(link_section = ".uninit.keep")]
static BRINGUP_REQUEST: BringupRequest = BringupRequest::zero();

/// At a symbol that the host knows. A reset keeps it: a start that gives up on the way says how far it came.
#[used]
#[unsafe(no_mangle)]
#[unsafe(link_section = ".uninit.keep")]
static BRINGUP_REPORT: BringupReport = BringupReport::zero();

/// What the drive's start has set up, and the bring-up goes on with.
pub(crate) struct Started<'a> {
    pub(crate) motors: &'a [MotorPlate; 2],
    pub(crate) screw_encoder: &'a board::ScrewEncoder,
    pub(crate) nut_encoder: &'a board::NutEncoder,
    pub(crate) converters: &'a Converters<'a>,
    pub(crate) pins: &'a board::Pins,
    pub(crate) channel: UpChannel,
}

/// Whether a bring-up was asked for; if so the request is taken back and the report begins. Call it first of all.
pub(crate) fn begin() -> bool {
    let request = &BRINGUP_REQUEST;
    let asked = request.magic.load(Relaxed) == REQUEST_MAGIC
        && request.complement.load(Relaxed) == !REQUEST_MAGIC;
    request.magic.store(0, Relaxed);
    request.complement.store(0, Relaxed);
    if asked {
        // SAFETY: words of which all are atomic, and for which zero is valid; nobody else runs yet.
        unsafe { core::ptr::write_bytes((&raw const BRINGUP_REPORT).cast_mut(), 0, 1) };
        expect();
        enter(Stage::Start);
        BRINGUP_REPORT.layout.store(link::LAYOUT, Relaxed);
        BRINGUP_REPORT.magic.store(REPORT_MAGIC, Relaxed);
        enter(Stage::Clock);
    }
    asked
}

/// Reads the board, and waits for a reset. With a frame of its own: that of `init` must not step over the stack's guard.
#[inline(never)]
pub(crate) fn run(mut started: Started<'_>) -> ! {
    let report = &BRINGUP_REPORT;
    clock::read(&report.clock);

    enter(Stage::Converters);
    converters::read(&report.channels);
    let powered = BRINGUP_REQUEST.powered.load(Relaxed) != 0;
    let bus = converters::bus(&report.channels);
    let allowed = match powered {
        true => const { bus_counts(POWERED_V[0])..=bus_counts(POWERED_V[1]) },
        false => const { i64::MIN..=bus_counts(BUS_LIMIT_V) },
    };
    if !allowed.contains(&bus) {
        enter(Stage::Refused);
        wait_for_reset();
    }
    if powered {
        enter(Stage::Powered);
        powered::read(report, &started);
        enter(Stage::Done);
        wait_for_reset();
    }

    enter(Stage::Pins);
    pins::read(&started.pins.claims, &report.pins);

    enter(Stage::Comparators);
    comparators::read(&report.comparators);

    enter(Stage::Breaks);
    let gates_are_inputs = pins::gates_as_inputs(&started.pins.claims);
    if gates_are_inputs {
        breaks::read(&report.breaks, &started);
    }

    enter(Stage::Encoders);
    let listen_ms = BRINGUP_REQUEST.listen_ms.load(Relaxed);
    encoders::read(&report.encoders, &started, listen_ms);

    enter(Stage::Idle);
    pins::drive_idle(&started.pins.claims, &report.pins);

    enter(Stage::Flash);
    flash::read(&report.flash);

    enter(Stage::Stream);
    let asked = || BRINGUP_REQUEST.stream.load(Relaxed) != 0;
    stream::send(&mut started.channel, &report.streamed, asked);

    enter(Stage::Done);
    wait_for_reset();
}

fn enter(stage: Stage) {
    BRINGUP_REPORT.stage.store(stage.word(), Relaxed);
}

fn wait_for_reset() -> ! {
    loop {
        cortex_m::asm::wfi();
    }
}

/// What the firmware was built for.
fn expect() {
    use control::thermometer::{Side, Thermometer};
    let expected = &BRINGUP_REPORT.expected;
    let board = &board::PLATE.board;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let whole = |value: f64| (value + 0.5) as u32;
    #[allow(clippy::cast_possible_truncation)]
    let signed = |value: f64| value as i32;
    put(&expected.core_hz, CORE_HZ);
    put(&expected.crystal_hz, crate::hw::clock::CRYSTAL_HZ);
    put(&expected.adc_hz, ADC_HZ);
    put(&expected.adc_counts, board.adc_counts);
    put(&expected.zero_sixteenths, whole(16.0 * board.zero_counts));
    put(
        &expected.zero_tolerance,
        control::sense::ZERO_TOLERANCE_COUNTS,
    );
    expected
        .microamperes
        .store(signed(1e6 * board.amps_per_count), Relaxed);
    put(
        &expected.bus_microvolts,
        whole(1e6 * board.bus_volts_per_count),
    );
    put(&expected.amplifiers_sleep, board::AMPLIFIERS_SLEEP.into());
    put(&expected.gate_pull_down_ohm, board::GATE_PULL_DOWN_OHM);
    put(&expected.calibrated, analog::calibrated().into());
    let sensors = board::GUARDS.temperatures;
    for ((words, sensor), range) in expected
        .sensors
        .iter()
        .zip(sensors)
        .zip(board::GUARD.temperatures)
    {
        let (platinum, ohm, beta_k) = match sensor.sensor {
            Thermometer::Ntc { r25_ohm, beta_k } => (0, r25_ohm, beta_k),
            Thermometer::Platinum { r0_ohm } => (1, r0_ohm, 0.0),
        };
        put(&words.platinum, platinum);
        put(&words.ohm, whole(ohm));
        put(&words.beta_k, whole(beta_k));
        put(&words.divider_ohm, whole(sensor.divider_ohm));
        put(
            &words.at_reference,
            u32::from(sensor.side == Side::Reference),
        );
        put(&words.range[0], range.least.into());
        put(&words.range[1], range.most.into());
    }
}

/// Counts of the bus at a voltage, V.
const fn bus_counts(volts: f64) -> i64 {
    let counts = volts / board::PLATE.board.bus_volts_per_count;
    assert!(counts >= 2.0, "the bus divider does not see the limit");
    #[allow(clippy::cast_possible_truncation)]
    let counts = counts as i64;
    counts
}

fn put(word: &AtomicU32, value: u32) {
    word.store(value, Relaxed);
}

/// Microseconds at the clock that should be.
fn pause(microseconds: u32) {
    cortex_m::asm::delay(CORE_HZ / 1_000_000 * microseconds);
}

/// Looks until `there`, for at most `looks`.
fn wait_until(looks: u32, mut there: impl FnMut() -> bool) -> bool {
    let mut left = looks;
    while left > 0 {
        if there() {
            return true;
        }
        left -= 1;
    }
    false
}

/// Core cycles, modulo 2^32.
fn cycles() -> u32 {
    DWT::cycle_count()
}

/// The word of an encoder, whichever it is.
fn word(encoder: &impl Encoder) -> u32 {
    encoder.word()
}
