//! Telemetry bytes to rows in SI units, with what is missing counted.

use crate::scale::{self, SAMPLE_CURRENT_DROPS, SAMPLE_VOLTAGE_DROPS};
use crate::telemetry::{FRAME_MAX, Frame, Header, MotorSample, Request, Sample};
use std::f64::consts::TAU;

/// One motor at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotorRow {
    /// Mechanical angle of its encoder, rad, many turns; within the first turn when the stream starts.
    pub angle_rad: f64,
    /// Measured currents of phases a and b, A.
    pub phases_a: [f64; 2],
    /// d and q voltage commanded for the control period that ends with the row, V.
    pub voltage_v: [f64; 2],
    /// Output of the speed loop, A.
    pub i_q_ref_a: f64,
    /// Speed reference, mechanical, rad/s.
    pub speed_ref_rad_s: f64,
}

/// One row of a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Row {
    /// Time since the stream's first row, s.
    pub time_s: f64,
    /// Screw, nut.
    pub motors: [MotorRow; 2],
    /// The table's scale, m.
    pub table_m: f64,
    /// Rows that are missing between this one and the one before it.
    pub lost: u32,
}

/// How a stream went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// Rows that came.
    pub rows: u64,
    /// Rows that are missing between them.
    pub lost: u64,
    /// How many times rows are missing.
    pub gaps: u64,
    /// Frames that could not be read; what they held is among the lost.
    pub damaged: u64,
}

/// Decodes one stream.
#[derive(Debug)]
pub struct Decoder {
    request: Request,
    frame: Vec<u8>,
    header: Option<Header>,
    last: Option<(Sample, [i64; 2])>,
    count: Count,
}

impl Decoder {
    /// Of the stream that `request` started; what comes before its header is another's.
    #[must_use]
    pub fn new(request: Request) -> Self {
        Self {
            request,
            frame: Vec::new(),
            header: None,
            last: None,
            count: Count::default(),
        }
    }

    /// What the drive said of itself, once it has.
    #[must_use]
    pub fn header(&self) -> Option<&Header> {
        self.header.as_ref()
    }

    /// How it went so far.
    #[must_use]
    pub fn count(&self) -> Count {
        self.count
    }

    /// Time from one row to the next, s; `None` before the header came.
    #[must_use]
    pub fn interval_s(&self) -> Option<f64> {
        let header = self.header.as_ref()?;
        Some(f64::from(self.step(header)) * header.period_s.get())
    }

    /// Takes what came, in pieces of any length, and gives the rows that are whole to `each`.
    ///
    /// # Errors
    /// What `each` returns.
    pub fn take<E>(
        &mut self,
        bytes: &[u8],
        mut each: impl FnMut(&Header, &Row) -> Result<(), E>,
    ) -> Result<(), E> {
        for &byte in bytes {
            // A frame cannot be this long; it is dropped at its end.
            if self.frame.len() <= FRAME_MAX {
                self.frame.push(byte);
            }
            if byte != 0 {
                continue;
            }
            let frame = postcard::from_bytes_cobs(&mut self.frame);
            self.frame.clear();
            match (frame, self.header) {
                (Ok(Frame::Header(header)), None) if header.request == self.request.word() => {
                    self.header = Some(header);
                }
                (Ok(Frame::Sample(sample)), Some(header)) => {
                    if let Some(row) = self.row(&header, sample) {
                        each(&header, &row)?;
                    }
                }
                (Err(_), Some(_)) => self.count.damaged += 1,
                // Of another stream.
                _ => {}
            }
        }
        Ok(())
    }

    /// PWM periods from row to row.
    fn step(&self, header: &Header) -> u32 {
        header
            .speed_divider
            .saturating_mul(u32::from(self.request.divider))
            .max(1)
    }

    fn row(&mut self, header: &Header, sample: Sample) -> Option<Row> {
        let step = self.step(header);
        let mut lost = 0;
        let mut turns = [0; 2];
        if let Some((last, last_turns)) = &self.last {
            let passed = sample.period.wrapping_sub(last.period);
            // Rows come in their order; what does not is none.
            if passed == 0 || passed > u32::MAX / 2 {
                self.count.damaged += 1;
                return None;
            }
            lost = (passed + step / 2) / step;
            lost = lost.saturating_sub(1);
            let seconds = f64::from(passed) * header.period_s.get();
            for (k, turns) in turns.iter_mut().enumerate() {
                let (now, before) = (&sample.motors[k], &last.motors[k]);
                let plate = &header.motors[k];
                let speed = |m: &MotorSample| {
                    scale::value(m.speed_ref, scale::SPEED) / f64::from(plate.pole_pairs.max(1))
                };
                // The turn that is nearest to where its speed has brought the shaft: over a gap it may be several.
                let expected = (speed(now) + speed(before)) / 2.0 * seconds / TAU;
                let counts = f64::from(plate.encoder_counts.max(1));
                let part = (f64::from(now.encoder) - f64::from(before.encoder)) / counts;
                #[allow(clippy::cast_possible_truncation)]
                let whole = (expected - part).round() as i64;
                *turns = last_turns[k] + whole;
            }
        }
        self.last = Some((sample, turns));
        self.count.rows += 1;
        self.count.lost += u64::from(lost);
        self.count.gaps += u64::from(lost > 0);
        let motor = |k: usize| {
            let (sample, plate): (&MotorSample, _) = (&sample.motors[k], &header.motors[k]);
            let part = f64::from(sample.encoder) / f64::from(plate.encoder_counts.max(1));
            let current = |word| scale::value(word, scale::CURRENT - SAMPLE_CURRENT_DROPS);
            let voltage = |word| scale::value(word, scale::VOLTAGE - SAMPLE_VOLTAGE_DROPS);
            MotorRow {
                angle_rad: (turns[k] as f64 + part) * TAU,
                phases_a: sample.phases.map(current),
                voltage_v: sample.voltage.map(voltage),
                i_q_ref_a: current(sample.i_q_ref),
                speed_ref_rad_s: scale::value(sample.speed_ref, scale::SPEED)
                    / f64::from(plate.pole_pairs.max(1)),
            }
        };
        Some(Row {
            time_s: f64::from(sample.period) * header.period_s.get(),
            motors: [motor(0), motor(1)],
            table_m: f64::from(sample.scale) * header.scale_count_m.get(),
            lost,
        })
    }
}
