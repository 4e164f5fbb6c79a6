//! The telemetry stream: a [`Header`], then a [`Sample`] for each row of the recording.
//!
//! Frames are postcard's, each ended by a zero byte (COBS), so that a reader finds the next frame wherever it starts.
//! A frame goes into the channel whole or not at all; a [`Sample`] says in which period it was taken, so a reader knows
//! exactly which are missing.

use control::encoder::Interface;
use serde::{Deserialize, Serialize};

/// Longest frame, bytes, its end included: the header's numbers take at most ten bytes each.
pub const FRAME_MAX: usize = 256;

/// What telemetry is asked for, in the command's word `record`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Request {
    /// Each how manieth step of the speed task makes a sample; 0: none.
    pub divider: u8,
    /// Any number that differs from the last request's: a new one starts a new stream.
    pub stream: u32,
}

impl Request {
    /// As the word.
    #[must_use]
    pub const fn word(self) -> u32 {
        self.stream << 8 | self.divider as u32
    }

    /// Of the word.
    #[must_use]
    pub const fn of_word(word: u32) -> Self {
        Self {
            divider: word as u8,
            stream: word >> 8,
        }
    }
}

/// A real number as its bits: the telemetry passes on numbers of the configuration, and computes with none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Real([u8; 8]);

impl Real {
    /// Of a number.
    #[must_use]
    pub const fn new(value: f64) -> Self {
        Self(value.to_bits().to_le_bytes())
    }

    /// The number.
    #[must_use]
    pub const fn get(self) -> f64 {
        f64::from_bits(u64::from_le_bytes(self.0))
    }
}

/// What an encoder knows of the rotor's angle when power comes up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum EncoderKind {
    /// Nothing: an incremental encoder.
    Incremental,
    /// The angle, once its index has passed.
    Index,
    /// The angle.
    Absolute,
}

impl EncoderKind {
    /// Of an encoder that is read so.
    #[must_use]
    pub const fn of(interface: Interface) -> Self {
        match interface {
            Interface::Incremental => Self::Incremental,
            Interface::IncrementalWithIndex => Self::Index,
            Interface::Mt6835 => Self::Absolute,
        }
    }
}

/// A motor as the drive's plate has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MotorPlate {
    /// Stator resistance of a phase, ohm.
    pub resistance_ohm: Real,
    /// Stator inductance, H.
    pub inductance_h: Real,
    /// Electrical turns a mechanical turn.
    pub pole_pairs: u32,
    /// Magnet flux, Wb, power invariant.
    pub flux_wb: Real,
    /// Inertia that the motor moves, kg m^2.
    pub inertia_kg_m2: Real,
    /// Counts of its encoder a mechanical turn.
    pub encoder_counts: u32,
    /// What its encoder knows at a start.
    pub encoder: EncoderKind,
}

/// What a host must know to read the samples, so that it guesses nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// [`LAYOUT`](crate::LAYOUT).
    pub layout: u32,
    /// The [`Request`]'s word that started the stream.
    pub request: u32,
    /// PWM periods from one step of the speed task to the next.
    pub speed_divider: u32,
    /// PWM period, s.
    pub period_s: Real,
    /// One count of the current measurement, A.
    pub current_lsb_a: Real,
    /// One count of the table's scale, m.
    pub scale_count_m: Real,
    /// Lead of the screw, m a turn.
    pub lead_m: Real,
    /// Screw, nut.
    pub motors: [MotorPlate; 2],
}

impl Header {
    /// Of a drive of `plate`; the request is to be filled in.
    #[must_use]
    pub const fn of_plate(plate: &control::plate::DrivePlate) -> Self {
        const fn motor(plate: &control::plate::MotorPlate) -> MotorPlate {
            MotorPlate {
                resistance_ohm: Real::new(plate.resistance_ohm),
                inductance_h: Real::new(plate.inductance_h),
                pole_pairs: plate.pole_pairs,
                flux_wb: Real::new(plate.flux_wb),
                inertia_kg_m2: Real::new(plate.inertia_kg_m2),
                encoder_counts: plate.encoder.counts_per_turn,
                encoder: EncoderKind::of(plate.encoder.interface),
            }
        }
        let [screw, nut] = &plate.motors;
        Self {
            layout: crate::LAYOUT,
            request: 0,
            speed_divider: plate.board.speed_divider,
            period_s: Real::new(plate.board.sample_time()),
            current_lsb_a: Real::new(plate.board.amps_per_count.abs()),
            scale_count_m: Real::new(plate.feed.scale_count_m),
            lead_m: Real::new(plate.feed.lead_m),
            motors: [motor(screw), motor(nut)],
        }
    }
}

/// One motor at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MotorSample {
    /// The encoder's count within the turn.
    pub encoder: u32,
    /// Measured current of phases a and b, 2^-12 A.
    pub phases: [i32; 2],
    /// d and q voltage commanded for the control period that ends with the sample, 2^-13 V.
    pub voltage: [i32; 2],
    /// The speed loop's output, 2^-12 A.
    pub i_q_ref: i32,
    /// Speed reference, electrical, 2^-16 rad/s.
    pub speed_ref: i32,
}

/// One row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sample {
    /// PWM periods of the screw since the stream's first sample.
    pub period: u32,
    /// Screw, nut.
    pub motors: [MotorSample; 2],
    /// The table's scale, counts.
    pub scale: i32,
}

/// What the channel carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Frame {
    /// Starts a stream.
    Header(Header),
    /// A row.
    Sample(Sample),
}

impl Frame {
    /// The frame's bytes, in `buffer`. `None` would be a frame longer than [`FRAME_MAX`]; there is none.
    pub fn encode<'b>(&self, buffer: &'b mut [u8; FRAME_MAX]) -> Option<&'b [u8]> {
        postcard::to_slice_cobs(self, buffer)
            .ok()
            .map(|bytes| &*bytes)
    }
}

/// A word without its lowest bits, rounded.
#[must_use]
pub const fn rounded(word: i32, drops: u32) -> i32 {
    word.saturating_add(1 << (drops - 1)) >> drops
}
