//! Speeds of a command as the link's words.

use crate::scale;
use crate::settings::PER_KRPM;
use anyhow::{Context, Result};
use std::f64::consts::TAU;

/// Largest base speed of a command, rad/s.
const BASE_SPEED_END: f64 = i32::MAX as f64 / (1u64 << scale::BASE_SPEED) as f64;
/// Largest table velocity of a command, m/s.
const TABLE_VELOCITY_END: f64 = i32::MAX as f64 / (1u64 << scale::TABLE_VELOCITY) as f64;

/// How errors name the two speeds.
#[derive(Clone, Copy, Debug)]
pub struct SpeedNames {
    /// Of the table velocity.
    pub velocity: &'static str,
    /// Of the base speed.
    pub base: &'static str,
}

/// Word of a speed, rpm, that an error names `name`.
///
/// # Errors
/// A speed that exceeds its word.
pub fn base_speed(rpm: f64, name: &str) -> Result<i32> {
    scale::word(rpm * TAU / 60.0, scale::BASE_SPEED).with_context(|| {
        format!(
            "{name} is {rpm:.0} rpm, but -{most:.0} to {most:.0} rpm are possible",
            most = BASE_SPEED_END * 60.0 / TAU
        )
    })
}

/// Word of the current along q that makes a torque, N m, in a motor of that voltage constant, V rms per 1000 rpm; `None`: the word does
/// not hold it.
#[must_use]
pub fn torque_current(torque_nm: f64, voltage_constant_v_rms_per_krpm: f64) -> Option<i32> {
    // What a motor induces at 1 rad/s between two leads, rms, is its torque per ampere: see `settings::datasheet`.
    let newton_metre_per_a = voltage_constant_v_rms_per_krpm / PER_KRPM;
    scale::word(torque_nm / newton_metre_per_a, scale::CURRENT)
}

/// Words of a table velocity, m/s, and of a base speed, rad/s; `None`: that of the drive's table.
///
/// # Errors
/// A speed that exceeds its word, by its name.
pub fn speeds(velocity: f64, base: Option<f64>, names: &SpeedNames) -> Result<(i32, Option<i32>)> {
    let base_word = |base: f64| base_speed(base * 60.0 / TAU, names.base);
    let velocity = scale::word(velocity, scale::TABLE_VELOCITY).with_context(|| {
        format!(
            "{} is {} mm/s, but -{most:.0} to {most:.0} mm/s are possible",
            names.velocity,
            1e3 * velocity,
            most = 1e3 * TABLE_VELOCITY_END
        )
    })?;
    Ok((velocity, base.map(base_word).transpose()?))
}
