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
    bytes: Vec<u8>,
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
            bytes: Vec::new(),
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
            if self.bytes.len() <= FRAME_MAX {
                self.bytes.push(byte);
            }
            if byte != 0 {
                continue;
            }
            let frame = postcard::from_bytes_cobs(&mut self.bytes);
            self.bytes.clear();
            match frame {
                Ok(frame) => {
                    if let (Some(row), Some(header)) = (self.frame(frame), &self.header) {
                        each(header, &row)?;
                    }
                }
                Err(_) if self.header.is_some() => self.count.damaged += 1,
                Err(_) => {}
            }
        }
        Ok(())
    }

    /// Takes the next frame: the row, if it is one of this stream.
    pub fn frame(&mut self, frame: Frame) -> Option<Row> {
        match (frame, self.header) {
            (Frame::Header(header), None) if header.request == self.request.word() => {
                self.header = Some(header);
                None
            }
            (Frame::Sample(sample), Some(header)) => self.row(&header, sample),
            // Of another stream, before this one's header.
            (_, None) => None,
            (Frame::Header(_), Some(_)) => {
                self.count.damaged += 1;
                None
            }
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::telemetry::{EncoderKind, MotorPlate, Real};

    const REQUEST: Request = Request {
        divider: 1,
        stream: 7,
    };
    const COUNTS: u32 = 1 << 20;

    fn header(request: Request) -> Frame {
        let motor = MotorPlate {
            resistance_ohm: Real::new(1.7),
            inductance_h: Real::new(5.9e-3),
            pole_pairs: 5,
            flux_wb: Real::new(0.11),
            inertia_kg_m2: Real::new(7.2e-4),
            encoder_counts: COUNTS,
            encoder: EncoderKind::Incremental,
        };
        Frame::Header(Header {
            layout: crate::LAYOUT,
            request: request.word(),
            speed_divider: 4,
            period_s: Real::new(50e-6),
            current_lsb_a: Real::new(0.0025),
            scale_count_m: Real::new(1e-8),
            lead_m: Real::new(5e-3),
            motors: [motor; 2],
        })
    }

    /// The row at time `k` of a drive whose nut turns back at 50 turns a second, and whose screw stands.
    fn row(k: u32) -> Frame {
        let turns = -50.0 * f64::from(k) * 200e-6;
        let mut sample = Sample {
            period: 4 * k,
            scale: -3,
            ..Sample::default()
        };
        sample.motors[1] = MotorSample {
            encoder: ((turns.rem_euclid(1.0)) * f64::from(COUNTS)) as u32 % COUNTS,
            phases: [4096, -2048],
            voltage: [8192, -4096],
            i_q_ref: 1024,
            speed_ref: scale::word(-50.0 * TAU * 5.0, scale::SPEED).unwrap(),
        };
        Frame::Sample(sample)
    }

    fn bytes(frames: impl IntoIterator<Item = Frame>) -> Vec<u8> {
        let mut buffer = [0; FRAME_MAX];
        let mut encode = |frame: Frame| frame.encode(&mut buffer).unwrap().to_vec();
        frames.into_iter().flat_map(&mut encode).collect()
    }

    fn decode(bytes: &[u8], piece: usize) -> (Vec<Row>, Count) {
        let mut decoder = Decoder::new(REQUEST);
        let mut rows = Vec::new();
        for piece in bytes.chunks(piece) {
            let take = |_: &Header, row: &Row| {
                rows.push(*row);
                Ok::<(), ()>(())
            };
            decoder.take(piece, take).unwrap();
        }
        (rows, decoder.count())
    }

    #[test]
    fn rows_come_in_their_units_whatever_the_pieces() {
        let stream = bytes([header(REQUEST), row(0), row(1), row(2)]);
        for piece in [1, 7, 1000] {
            let (rows, count) = decode(&stream, piece);
            assert_eq!((count.rows, count.lost, count.damaged), (3, 0, 0));
            let nut = rows[1].motors[1];
            assert_eq!(nut.phases_a, [1.0, -0.5]);
            assert_eq!(nut.voltage_v, [1.0, -0.5]);
            assert_eq!(nut.i_q_ref_a, 0.25);
            assert!(
                (nut.speed_ref_rad_s + 50.0 * TAU).abs() < 1e-4,
                "measured {}, expected -({}) within {:e}",
                nut.speed_ref_rad_s,
                50.0 * TAU,
                1e-4
            );
            assert!(
                (rows[1].time_s - 200e-6).abs() < 1e-15,
                "measured {}, expected {} within {:e}",
                rows[1].time_s,
                200e-6,
                1e-15
            );
            assert!(
                (rows[1].table_m + 3e-8).abs() < 1e-20,
                "measured {}, expected -({}) within {:e}",
                rows[1].table_m,
                3e-8,
                1e-20
            );
        }
    }

    #[test]
    fn what_is_missing_is_counted_and_turns_are_kept_over_it() {
        // 480 rows are missing: almost five turns of the nut.
        let frames = [0, 1, 2, 483, 484, 486].map(row);
        let (rows, count) = decode(&bytes([header(REQUEST)].into_iter().chain(frames)), 100);
        assert_eq!((count.rows, count.lost, count.gaps), (6, 481, 2));
        assert_eq!(
            rows.iter().map(|row| row.lost).collect::<Vec<_>>(),
            [0, 0, 0, 480, 0, 1]
        );
        let angle = rows[5].motors[1].angle_rad - rows[0].motors[1].angle_rad;
        assert!(
            (angle + 486.0 * 200e-6 * 50.0 * TAU).abs() < 1e-4,
            "{angle}"
        );
    }

    #[test]
    fn another_stream_and_damage_are_not_taken_for_rows() {
        let other = Request {
            stream: 6,
            ..REQUEST
        };
        // A host that stopped in the middle of a frame left its rest, and rows of its own stream.
        let mut stream = bytes([header(other), row(5), row(6)]).split_off(30);
        stream.extend(bytes([header(REQUEST), row(0), row(1)]));
        let mut broken = bytes([row(2)]);
        broken[3] ^= 0x55;
        broken.remove(9);
        stream.extend(broken);
        stream.extend([1; 2 * FRAME_MAX]);
        stream.push(0);
        stream.extend(bytes([row(3), row(3)]));
        let (rows, count) = decode(&stream, 13);
        let times: Vec<f64> = rows
            .iter()
            .map(|row| (row.time_s * 5000.0).round())
            .collect();
        assert_eq!(times, [0.0, 1.0, 3.0]);
        assert_eq!((count.lost, count.damaged), (1, 3));
    }
}
