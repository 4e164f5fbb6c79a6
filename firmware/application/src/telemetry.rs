//! Telemetry: the speed task leaves rows in a queue, the code below all tasks sends them over the line that asked for them.
//!
//! The current loops do nothing for it but leave their words where every task below finds them. The speed task runs right after the screw's loop and between two steps of the nut's, so it finds both motors' words whole; a
//! nut's step that comes between is noticed by its count. While the channel is full, rows stay in the queue; once that is
//! full too they are dropped and counted, and the host sees by their period that they are missing.

use crate::configured::Configured;
use crate::exchange::{TelemetryExchange, count};
use crate::rows::{ROWS, WORDS};
use control::current_loop::CurrentLoopConfig;
use control::exchange::MotorExchange;
use control::plate::DriveConfig;
use control::speed_task::SpeedTaskOutput;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use link::frame;
use link::message::DriveFrame;
use link::scale::{SAMPLE_CURRENT_DROPS, SAMPLE_VOLTAGE_DROPS};
use link::telemetry::{Frame, Header, MotorSample, Request, Sample, rounded};

/// The speed task's end.
#[derive(Clone, Debug)]
pub(crate) struct Sampler {
    serving: u32,
    left: u8,
}

impl Sampler {
    pub(crate) const fn new() -> Self {
        Self {
            serving: 0,
            left: 0,
        }
    }

    /// After a step of the speed task: a row, if one is due.
    #[inline(always)]
    pub(crate) fn step(
        &mut self,
        telemetry: &TelemetryExchange,
        motors: [&MotorExchange; 2],
        dropped: &AtomicU32,
        output: &SpeedTaskOutput,
        scale: i32,
    ) {
        let asked = telemetry.served.load(Relaxed);
        if asked == 0 {
            return;
        }
        let [screw, nut] = motors;
        if asked != self.serving {
            self.serving = asked;
            self.left = 0;
        }
        if let Some(left) = self.left.checked_sub(1) {
            self.left = left;
            return;
        }
        self.left = Request::of_word(asked).divider.saturating_sub(1);
        let (s, n) = (words(screw), words(nut));
        let [to_screw, to_nut] = output.current.map(|c| c.i_q.to_bits().cast_unsigned());
        let [screw_speed, nut_speed] = output.speed.map(|s| s.omega_e.to_bits().cast_unsigned());
        let row = [
            screw.periods(),
            s[0],
            s[1],
            s[2],
            s[3],
            s[4],
            to_screw,
            screw_speed,
            n[0],
            n[1],
            n[2],
            n[3],
            n[4],
            to_nut,
            nut_speed,
            scale.cast_unsigned(),
        ];
        if !telemetry.rows.push(row) {
            count(dropped);
        }
    }
}

/// A motor's encoder, currents and voltages, of one step of its current loop: currents as codes, voltages as the loop has
/// them.
#[inline(always)]
fn words(exchange: &MotorExchange) -> [u32; 5] {
    let take = || {
        let periods = exchange.periods();
        // The last step's voltage acts from the next period on; what acted in the period that ended with the sample is
        // the one of two steps before.
        let voltage = exchange.voltage(periods.wrapping_sub(2));
        let [a, b, _] = exchange.codes().map(i32::cast_unsigned);
        let [d, q] = [voltage.d, voltage.q].map(|v| v.to_bits().cast_unsigned());
        (periods, [exchange.encoder(), a, b, d, q])
    };
    let (periods, words) = take();
    if exchange.periods() == periods {
        words
    } else {
        // Its next step is a period away.
        take().1
    }
}

/// A row as it is sent. Its period counts from the stream's first row.
fn sample(config: &DriveConfig, first: u32, row: [u32; WORDS]) -> Sample {
    let [period, motors @ .., scale] = row;
    let motor = |config: &CurrentLoopConfig, words: &[i32; 7]| {
        let [encoder, a, b, d, q, i_q_ref, speed_ref] = *words;
        let [a, b, _] = config.sense.phases([a, b, 0]);
        MotorSample {
            encoder: encoder.cast_unsigned(),
            phases: [a, b].map(|i| rounded(i.to_bits(), SAMPLE_CURRENT_DROPS)),
            voltage: [d, q].map(|u| rounded(u, SAMPLE_VOLTAGE_DROPS)),
            i_q_ref: rounded(i_q_ref, SAMPLE_CURRENT_DROPS),
            speed_ref,
        }
    };
    let [screw, nut] = &config.current_loops;
    let [s0, s1, s2, s3, s4, s5, s6, n0, n1, n2, n3, n4, n5, n6] = motors.map(u32::cast_signed);
    Sample {
        period: period.wrapping_sub(first),
        motors: [
            motor(screw, &[s0, s1, s2, s3, s4, s5, s6]),
            motor(nut, &[n0, n1, n2, n3, n4, n5, n6]),
        ],
        scale: scale.cast_signed(),
    }
}

/// The stream that a host asked for over its line. The latest request has the rows.
#[derive(Clone, Debug)]
pub(crate) struct LinkStream {
    /// A header that is yet to be sent.
    header: Option<u32>,
    /// PWM period of the stream's first row.
    first: Option<u32>,
}

impl LinkStream {
    pub(crate) const fn new() -> Self {
        Self {
            header: None,
            first: None,
        }
    }

    /// Begins the stream of a [`Request`]'s word, or ends it.
    pub(crate) fn start(&mut self, telemetry: &TelemetryExchange, request: u32) {
        telemetry.end_stream();
        (self.header, self.first) = (Some(request), None);
    }

    /// Sends what the queue holds and the line takes: `send` is given whole frames, and says whether it took them.
    pub(crate) fn step(
        &mut self,
        configured: &Configured,
        telemetry: &TelemetryExchange,
        mut send: impl FnMut(&[u8]) -> bool,
    ) {
        let mut send = |frame: Frame| {
            let mut buffer = [0; frame::FRAME_MAX];
            match frame::encode(&DriveFrame::Telemetry(frame), &mut buffer) {
                Some(bytes) => send(bytes),
                None => true,
            }
        };
        if let Some(request) = self.header {
            let header = Header {
                request,
                ..configured.header
            };
            if !send(Frame::Header(header)) {
                return;
            }
            self.header = None;
            let wanted = Request::of_word(request).divider != 0;
            telemetry
                .served
                .store(if wanted { request } else { 0 }, Relaxed);
        }
        for _ in 0..ROWS {
            let Some(row) = telemetry.rows.first() else {
                return;
            };
            let first = *self.first.get_or_insert(row[0]);
            if !send(Frame::Sample(sample(&configured.drive, first, row))) {
                return;
            }
            telemetry.rows.drop_first();
        }
    }
}
