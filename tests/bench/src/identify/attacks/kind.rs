//! What is wrong with a motor or its record, and which names that allows.

/// What can be there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Kind {
    Clean,
    // Torques that repeat in a coordinate. Numbers are orders of the turn.
    Order(f64),
    OrderBySpeed(f64),
    OrderByCurrent(f64),
    OrderByDirection(f64),
    TwoOrders(f64, f64),
    Square(f64),
    Sawtooth,
    Dent,
    Resonant(f64),
    Windage,
    Cubic,
    Stribeck,
    StribeckOneWay,
    Asymmetry,
    OneWayFriction,
    LoadedFriction,
    TightPlace,
    TightHalf,
    Breakaway,
    /// Way over which the friction turns round, rad.
    Dahl(f64),
    Spring,
    Detent,
    Gravity,
    // Torques that do not come again.
    OrderFades(f64),
    OrderStarts(f64),
    RandomWalk,
    RandomTorque,
    /// Time constant, s.
    Warming(f64),
    WarmingOil,
    Ramp,
    Step,
    OnlyInFit,
    OnlyInCheck,
    /// Hz.
    Hum(f64),
    Bursts,
    Hammer,
    // Mechanics behind the motor.
    /// Stiffness, of the usual one.
    SoftLoad(f64),
    /// Play each way, rad.
    Backlash(f64),
    Crank,
    HeavierLate,
    // Measurement of the current.
    /// Time constant, s.
    Lag(f64),
    TwoLags(f64),
    /// Rows.
    Delay(usize),
    DelayGrows,
    GainByDirection,
    GainBySign,
    GainSteps,
    OffsetSteps,
    OffsetByDirection,
    Drift,
    Curved,
    DeadBand,
    Saturated,
    Clipped,
    CoarseCurrent,
    SlowNoise,
    RedNoise,
    NoisyFit,
    NoisyCheck,
    NoiseByCurrent,
    NoiseBySpeed,
    NoNoise,
    Spikes,
    HumOfCurrent(f64),
    Held,
    // Measurement of the angle.
    Eccentric,
    /// Order, and size in rad.
    EncoderOrder(f64, f64),
    EncoderGain,
    EncoderNoise,
    EncoderHysteresis,
    EncoderHeld,
    EncoderSlips,
    CoarseEncoder,
    AngleSpikes,
    Missed,
    // Rows.
    RowsLost,
    RowsTwice,
    ClockJitter,
    ClockWrong,
    OtherMachine,
}

/// Every kind, and whether its torque repeats in a coordinate that the records cover.
pub(super) const KINDS: [(Kind, bool); 103] = [
    (Kind::Clean, false),
    (Kind::Order(12.0), true),
    (Kind::Order(1.0), true),
    (Kind::Order(2.0), true),
    (Kind::Order(3.7), true),
    (Kind::Order(7.3), true),
    (Kind::OrderBySpeed(1.0), true),
    (Kind::OrderBySpeed(3.0), true),
    (Kind::Windage, true),
    (Kind::Stribeck, true),
    (Kind::Asymmetry, true),
    (Kind::TightPlace, true),
    (Kind::Dahl(0.2), true),
    (Kind::Spring, true),
    (Kind::RandomWalk, false),
    (Kind::Warming(5.0), false),
    (Kind::Step, false),
    (Kind::Hum(13.7), false),
    (Kind::Bursts, false),
    (Kind::SoftLoad(1.0), false),
    (Kind::Backlash(0.02), false),
    (Kind::Gravity, true),
    (Kind::Lag(0.004), false),
    (Kind::Lag(0.03), false),
    (Kind::Lag(0.12), false),
    (Kind::Delay(2), false),
    (Kind::Delay(8), false),
    (Kind::GainByDirection, false),
    (Kind::Eccentric, false),
    (Kind::Drift, false),
    (Kind::Clipped, false),
    (Kind::CoarseCurrent, false),
    (Kind::SlowNoise, false),
    (Kind::RedNoise, false),
    (Kind::NoisyFit, false),
    (Kind::OtherMachine, false),
    (Kind::Held, false),
    (Kind::Missed, false),
    (Kind::Order(0.5), true),
    (Kind::Order(6.0), true),
    (Kind::Order(24.0), true),
    (Kind::Order(48.0), true),
    (Kind::OrderBySpeed(12.0), true),
    (Kind::OrderByCurrent(6.0), true),
    (Kind::OrderByDirection(4.0), true),
    (Kind::OrderFades(5.0), false),
    (Kind::OrderStarts(9.0), false),
    (Kind::TwoOrders(7.0, 7.2), true),
    (Kind::TwoOrders(2.0, 36.0), true),
    (Kind::Square(4.0), true),
    (Kind::Sawtooth, true),
    (Kind::Dent, true),
    (Kind::Resonant(8.0), true),
    (Kind::Cubic, true),
    (Kind::StribeckOneWay, true),
    (Kind::OneWayFriction, true),
    (Kind::LoadedFriction, true),
    (Kind::TightHalf, true),
    (Kind::Breakaway, true),
    (Kind::Dahl(0.02), true),
    (Kind::Detent, true),
    (Kind::RandomTorque, false),
    (Kind::Warming(1.0), false),
    (Kind::WarmingOil, false),
    (Kind::Ramp, false),
    (Kind::OnlyInFit, false),
    (Kind::OnlyInCheck, false),
    (Kind::Hum(0.2), false),
    (Kind::Hum(50.0), false),
    (Kind::Hum(200.0), false),
    (Kind::Hammer, false),
    (Kind::SoftLoad(0.25), false),
    (Kind::SoftLoad(4.0), false),
    (Kind::Backlash(0.1), false),
    (Kind::Crank, false),
    (Kind::HeavierLate, false),
    (Kind::TwoLags(0.01), false),
    (Kind::DelayGrows, false),
    (Kind::GainBySign, false),
    (Kind::GainSteps, false),
    (Kind::OffsetSteps, false),
    (Kind::OffsetByDirection, false),
    (Kind::Curved, false),
    (Kind::DeadBand, false),
    (Kind::Saturated, false),
    (Kind::NoisyCheck, false),
    (Kind::NoiseByCurrent, false),
    (Kind::NoiseBySpeed, false),
    (Kind::NoNoise, false),
    (Kind::Spikes, false),
    (Kind::HumOfCurrent(50.0), false),
    (Kind::EncoderOrder(4.0, 0.005), false),
    (Kind::EncoderGain, false),
    (Kind::EncoderNoise, false),
    (Kind::EncoderHysteresis, false),
    (Kind::EncoderHeld, false),
    (Kind::EncoderSlips, false),
    (Kind::CoarseEncoder, false),
    (Kind::AngleSpikes, false),
    (Kind::RowsLost, false),
    (Kind::RowsTwice, false),
    (Kind::ClockJitter, false),
    (Kind::ClockWrong, false),
];

impl Kind {
    /// Whether a torque of that order of the turn is there.
    pub(super) fn has_order(self, order: f64) -> bool {
        match self {
            Self::Order(own)
            | Self::OrderBySpeed(own)
            | Self::OrderByDirection(own)
            | Self::OrderFades(own)
            | Self::OrderStarts(own)
            | Self::Resonant(own)
            // An encoder's error shows the torque of its own order.
            | Self::EncoderOrder(own, _) => order == own,
            Self::TwoOrders(one, other) => order == one || order == other,
            // The current has that order itself.
            Self::OrderByCurrent(own) | Self::Square(own) => order % own == 0.0,
            Self::Sawtooth | Self::Dent | Self::TightHalf => order.fract() == 0.0,
            Self::Crank => order % 2.0 == 0.0,
            Self::Eccentric | Self::Gravity => order == 1.0,
            _ => false,
        }
    }

    /// Whether the current is reported late by a time constant, s.
    pub(super) fn has_lag(self, value: f64) -> bool {
        match self {
            Self::Lag(tau) => (value / tau - 1.0).abs() < 0.2,
            // Two equal lags are one of up to their sum.
            Self::TwoLags(tau) => (0.8 * tau..2.4 * tau).contains(&value),
            _ => false,
        }
    }

    /// Rows that are no measurement: noted by the reader, they are not kept quiet.
    pub(super) fn is_noted(self) -> bool {
        matches!(self, Self::Spikes | Self::AngleSpikes)
    }

    /// A time between motion and current: allowed for, it is not wrong.
    pub(super) fn is_late(self) -> bool {
        matches!(self, Self::Delay(_) | Self::Held)
    }
}
