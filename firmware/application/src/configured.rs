//! All that the parts of a drive read of its configuration.

use control::guard::GuardConfig;
use control::homing::HomePlan;
use control::plate::{BASES, BasePlate, DriveConfig, DrivePlate};
use control::stream::StreamConfig;
use control::table_move::MoveConfig;
use control::travel::TravelConfig;
use link::scale;
use link::telemetry::Header;

/// Time between two steps of [`Orders`](crate::orders::Orders), s.
pub(crate) const STEP_S: f64 = 1e-3;

/// What the drive runs on. The control's comes first: the firmware keeps it beside the speed task's state.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Configured {
    /// The control's.
    pub drive: DriveConfig,
    /// The guard's.
    pub guard: GuardConfig,
    /// The head of each stream of telemetry.
    pub header: Header,
    /// The soft limits.
    pub travel: TravelConfig,
    /// What the link's commands and replies take.
    pub words: CommandWords,
    /// The plate that they come from.
    pub plate: DrivePlate,
}

/// What commands and replies take of the plate, computed when the drive is configured: the chip has no double float unit.
#[derive(Clone, Copy, Debug)]
pub struct CommandWords {
    /// How a move is planned.
    pub moves: MoveConfig,
    /// How the drive homes.
    pub home: HomePlan,
    /// How it follows a stream.
    pub stream: StreamConfig,
    /// The base speeds of commands that have none.
    pub bases: Bases,
    /// Bus voltage of an ADC count, uV.
    pub bus_uv: u32,
    /// PWM rate, Hz.
    pub pwm_hz: u32,
}

impl CommandWords {
    /// Of a plate.
    // Inlined where the drive is configured, which is apart from what the tasks call.
    #[must_use]
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    pub const fn new(plate: &DrivePlate) -> Self {
        Self {
            bases: Bases::new(&plate.base),
            moves: MoveConfig::new(plate, STEP_S),
            home: HomePlan::new(plate, STEP_S),
            stream: StreamConfig::new(plate, STEP_S),
            bus_uv: (plate.board.bus_volts_per_count * 1e6 + 0.5) as u32,
            pwm_hz: (plate.board.pwm_hz + 0.5) as u32,
        }
    }
}

/// Table velocities, 2^-28 m/s either way, and the base speed, 2^-18 rad/s, up to each.
#[derive(Clone, Copy, Debug)]
pub struct Bases([Option<[i32; 2]>; BASES]);

impl Bases {
    // Inlined where the drive is configured, which is apart from what the tasks call.
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation)]
    const fn new(plate: &BasePlate) -> Self {
        let velocity_word = (1u64 << scale::TABLE_VELOCITY) as f64;
        let base_word = (1u64 << scale::BASE_SPEED) as f64;
        let mut bases = [None; BASES];
        let mut k = 0;
        while k < BASES && plate.table[k].velocity != 0.0 {
            let point = &plate.table[k];
            // Of a table velocity's last step, which is 4 nm/s.
            let velocity = ((point.velocity + 4e-9) * velocity_word) as i32;
            bases[k] = Some([velocity, (point.base * base_word + 0.5) as i32]);
            k += 1;
        }
        Self(bases)
    }

    /// The base speed, 2^-18 rad/s, for a table velocity, 2^-28 m/s, for which none is commanded.
    #[must_use]
    pub fn base_for(&self, velocity: i32) -> i32 {
        let points = || self.0.iter().flatten();
        let of_velocity = |[most, _]: &&[i32; 2]| velocity.unsigned_abs() <= most.unsigned_abs();
        let point = points().find(of_velocity).or(points().last());
        point.map_or(0, |[_, base]| *base)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// The words say what the settings say in floats.
        #[test]
        fn the_base_speed_is_that_of_the_settings(
            velocities in proptest::collection::vec(1e-4..0.1f64, 0..BASES), word in -30_000_000i32..30_000_000,
        ) {
            let mut velocities = velocities;
            velocities.sort_by(f64::total_cmp);
            let mut plate = BasePlate::NONE;
            for (k, velocity) in velocities.into_iter().enumerate() {
                plate.table[k].velocity = velocity;
                plate.table[k].base = 10.0 * (k + 1) as f64;
            }
            let words = Bases::new(&plate);
            let base = plate.base_for(scale::value(word, scale::TABLE_VELOCITY));
            prop_assert_eq!(Some(words.base_for(word)), scale::word(base, scale::BASE_SPEED));
        }
    }
}
