//! Speeds of a command as the link's words.

use crate::scale;
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

/// Words of a table velocity, m/s, and of a base speed, rad/s; `None`: that of the drive's table.
///
/// # Errors
/// A speed that exceeds its word, by its name.
pub fn speeds(velocity: f64, base: Option<f64>, names: &SpeedNames) -> Result<(i32, Option<i32>)> {
    let base_word = |base: f64| {
        scale::word(base, scale::BASE_SPEED).with_context(|| {
            format!(
                "{} is {:.0} rpm, but -{most:.0} to {most:.0} rpm are possible",
                names.base,
                base * 60.0 / TAU,
                most = BASE_SPEED_END * 60.0 / TAU
            )
        })
    };
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
