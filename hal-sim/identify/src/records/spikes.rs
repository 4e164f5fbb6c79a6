//! Single rows that leave both neighbours and come back: a lost frame or a disturbed sample, no motion.

use super::data_quality::DataQuality;
use crate::signal::quantile::quantile;

/// How far a row must be from the mean of its neighbours, in medians of what changes. Of a million normal values the largest is 7
/// medians, of as many with an exponential tail 20.
const FAR: f64 = 30.0;
/// How far the neighbours may be apart, of that: a step leaves them as far apart as twice itself.
const TOGETHER: f64 = 0.25;
/// How much further it must be than every row about it: a fast wave in a slow record turns round as sharply at each of its tops.
const FURTHER: f64 = 4.0;
/// Rows about it that are looked at. The next ones are off by half of the spike themselves.
const ABOUT: std::ops::RangeInclusive<usize> = 2..=8;
/// Share of the rows that may be so: what comes oftener is the signal.
const RARE: f64 = 0.01;

/// The rows that are spikes, from the second to the last but one.
fn spikes(values: &[f64]) -> Vec<usize> {
    let off = |row: usize| values[row] - 0.5 * (values[row - 1] + values[row + 1]);
    let rows = 1..values.len().saturating_sub(1);
    let sizes = rows.clone().map(|row| off(row).abs());
    let Some(usual) = quantile(sizes.filter(|size| *size > 0.0), 0.5) else {
        return Vec::new();
    };
    let is_spike = |row: &usize| {
        let size = off(*row).abs();
        let apart = (values[row + 1] - values[row - 1]).abs();
        let about = ABOUT.flat_map(|away| [row.checked_sub(away), row.checked_add(away)]);
        let about = about.flatten().filter(|other| rows.contains(other));
        let sharpest = about.map(|other| off(other).abs()).fold(0.0, f64::max);
        size > FAR * usual && apart < TOGETHER * size && size > FURTHER * sharpest
    };
    let found: Vec<usize> = rows.clone().filter(is_spike).collect();
    match found.len() as f64 > RARE * values.len() as f64 {
        true => Vec::new(),
        false => found,
    }
}

impl DataQuality {
    /// Notes the spikes of a measured column with its times, s.
    pub fn note_spikes(&mut self, name: &str, time: &[f64], values: &[f64]) {
        let found = spikes(values);
        if let Some(&first) = found.first() {
            self.notes.push(format!(
                "in {} of its rows `{name}` leaves both neighbours by more than {FAR} times its usual change and comes back, first at {:.4} s: a \
                 disturbed sample or a lost frame? The rows are used as they are; remove them if they are no measurement",
                found.len(),
                time[first]
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_that_leaves_its_neighbours_is_a_spike_and_a_step_is_none() {
        let noise = |row: usize| 1e-3 * ((row * 7919 % 1009) as f64 / 1009.0 - 0.5);
        let wave = |row: usize| (0.01 * row as f64).sin() + noise(row);
        let mut values: Vec<f64> = (0..5000).map(wave).collect();
        assert_eq!(spikes(&values), [0usize; 0]);
        values[3000..].iter_mut().for_each(|value| *value += 2.0);
        assert_eq!(spikes(&values), [0usize; 0], "a step");
        values[1234] += 0.2;
        values[4321] -= 0.2;
        assert_eq!(spikes(&values), [1234, 4321]);
        let mut quality = DataQuality::default();
        let time: Vec<f64> = (0..5000).map(|row| 1e-3 * f64::from(row)).collect();
        quality.note_spikes("current_a", &time, &values);
        let [note] = &quality.notes[..] else {
            panic!("{:?}", quality.notes);
        };
        assert!(
            note.contains("in 2 of its rows `current_a`") && note.contains("1.2340 s"),
            "{note}"
        );
    }

    #[test]
    fn counts_of_a_shaft_that_rests_are_no_spikes() {
        let counts = |row: usize| f64::from(u8::from(row.is_multiple_of(50))) + (row / 2500) as f64;
        let values: Vec<f64> = (0..5000).map(counts).collect();
        assert_eq!(spikes(&values), [0usize; 0]);
    }

    /// A phase's current: slow for most of the record, then eight rows a turn.
    #[test]
    fn a_wave_that_is_fast_for_a_while_has_none() {
        let turned = |row: usize| match row {
            0..4500 => 0.002 * row as f64,
            _ => 9.0 + 0.8 * (row - 4500) as f64,
        };
        let wave = |row: usize| turned(row).sin();
        assert_eq!(
            spikes(&(0..5000).map(wave).collect::<Vec<_>>()),
            [0usize; 0]
        );
    }

    #[test]
    fn an_angle_that_wraps_has_none() {
        let angle = |row: usize| (0.3 * row as f64).rem_euclid(std::f64::consts::TAU);
        assert_eq!(
            spikes(&(0..5000).map(angle).collect::<Vec<_>>()),
            [0usize; 0]
        );
    }
}
