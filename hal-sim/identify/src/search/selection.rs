//! When an effect is taken: one criterion for every machine, and its thresholds with their reasons.
//!
//! An effect must explain more of the fit record than chance makes of the best of many candidates, and a record that it
//! was not fitted to must bear it out: with the parameters of the fit its coefficient there must be near 1 and more
//! standard deviations from 0 than chance allows, whatever the colour of the residual (Newey and West, *Econometrica* 55,
//! 1987).

use crate::regression::column::Column;
use crate::regression::normal::{Normal, Prior};
use crate::regression::sandwich::robust;

/// What an effect must explain at least, as a share of what noise leaves: smaller than a sixteenth of the noise's rms,
/// simplifications of the balances explain as much.
pub const MATERIAL: f64 = 0.004;
/// Share of that which the check record must confirm, with the parameters of the fit.
pub(crate) const CONFIRMED: f64 = 0.25;
/// Share by which an effect must lower the rms of what it was not fitted to where no noise floor is declared, of a feed axis
/// and of a motor.
pub const MATERIAL_OF_ERROR: f64 = 0.01;
/// Share of the force's rms that a term of a feed axis must explain of what it was not fitted to: friction and the law of a clean axis
/// repeat less well than this. Its frequency distinguishes an order of the turn from them.
pub(crate) const MATERIAL_OF_FORCE: f64 = 0.01;
pub(crate) const MATERIAL_ORDER_OF_FORCE: f64 = 0.002;
pub(crate) const MATERIAL_OF_CURRENT: f64 = 0.005;
/// The same of an order that a slow turn of the same motor has.
pub(crate) const VOUCHED_OF_CURRENT: f64 = 5e-4;
/// Hypotheses that are looked at closely in each step.
pub(crate) const MOST_CONTENDERS: usize = 5;
/// Effects of one double drive at most, those without a name included.
pub(crate) const MOST_EFFECTS: usize = 5;
/// Effects of one bare motor at most where no slow turn vouches for more orders.
pub(crate) const MOST_NAMES: usize = 10;
/// How much more than any hypothesis a shape without a name must explain, which has more freedom (parsimony).
pub(crate) const PLAINER: f64 = 2.0;
/// Share of what is explained in a channel that the simplifications of effects may leave there: a tenth of their
/// amplitude.
pub(crate) const SIMPLIFIED: f64 = 0.01;
/// Smallest power of a shape without a name, of its channel's noise: half of the noise's rms.
pub(crate) const AUDIBLE: f64 = 0.25;
/// Share of the best cost reduction within which the check record has a say in the choice.
pub(crate) const CLOSE: f64 = 0.03;
/// Share of the residual in a channel that an effect must explain there: less than a quarter of its amplitude is no more
/// than a likeness.
pub(crate) const MODEST: f64 = 0.05;
/// Why an effect is not named that explains less.
pub(crate) const TOO_MODEST: &str = "more is left in its channel than it explains";
/// Times the residual beyond noise that an effect must explain of its channel on the check record.
pub(crate) const DOMINANT: f64 = 3.0;
/// Share of the error of a free-running drive's ripple that may be left on the check record with an effect that was found
/// by simulation: more than half of it is then gone, and three quarters of its square.
pub(crate) const RIPPLE_LEFT: f64 = 0.5;
/// Holds of a record without which two parameters of such an effect are not told.
pub(crate) const LEAST_HOLDS: usize = 4;
/// Parameters of a harmonic: cosine, sine and order.
const PARAMETERS: f64 = 3.0;
/// Orders, frequencies and other hypotheses of which the best is taken.
const CANDIDATES: f64 = 1e4;
/// Standard deviations of a coefficient on a record that it was not fitted to: chance exceeds them once in 700 times.
const SURE: f64 = 3.0;
/// The same on the fit record, beyond what chance's best of so many has, the root of twice the logarithm of their number.
const SURE_OF_BEST: f64 = 0.45;
/// Coefficients of an effect that is there: at less than a half its parameters raise the error instead of lowering it.
const COEFFICIENT: std::ops::Range<f64> = 0.5..1.5;

/// Why an effect of the fit record alone is not named.
pub(crate) const NOT_BORNE_OUT: &str =
    "the fit record has it, the check record does not bear it out";

/// Share of what an effect explains that a shape over its own coordinate may have beside it: a third of its amplitude is a
/// law of its own.
pub(crate) const LACK_OF_FIT: f64 = 0.1;

/// Why an effect is not named beside which a shape over its own coordinate is left.
pub(crate) const ANOTHER_LAW: &str =
    "what is left beside it is a shape over the same coordinate: its law is another";

/// Why an effect is not named beside which more is left.
pub(crate) const MORE_IS_LEFT: &str =
    "more is left on the check record, where it shows, than it explains";

/// Why an effect is not named beside a curve without a name in another channel.
pub(crate) const OF_PLATE_VALUES: &str =
    "a shape without a name in another channel moves the plate values that they share by more";

/// Why an effect is not named that may be none.
pub(crate) const MAY_BE_NOTHING: &str = "its interval holds zero";

/// Why an effect is not named that a wrong plate value explains as well.
pub(crate) const PLATE_IS_OFF: &str = "a plate value beyond its tolerance explains as much: are the declared resistance, inductance, inertia, flux and friction right?";

/// Why one order of the turn is not named beside others of no name.
pub(crate) const PART_OF_A_SHAPE: &str =
    "it is one order of a shape over the turn: other orders of it are left beside it";

/// Why an effect is not named that is there and hardly matters.
pub(crate) const TOO_LITTLE: &str = "takes too little of the error on what it was not fitted to";

/// What an effect must lower the sum of squares by over so many rows: what is material, and what the extended Bayesian
/// information criterion asks of the best of many candidates (Chen and Chen, *Biometrika* 95, 2008, with gamma 1).
pub(crate) fn threshold(rows: usize) -> f64 {
    let rows = rows.max(2) as f64;
    (MATERIAL * rows).max(PARAMETERS * rows.ln() + 2.0 * CANDIDATES.ln())
}

/// What a record says of an effect whose parameters are given.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Evidence {
    /// How much of it is there: 1 if it is as given.
    pub(crate) coefficient: f64,
    /// Standard deviations of that from 0.
    pub(crate) deviations: f64,
}

impl Evidence {
    /// Of what an effect adds to the record of a regression, whose own columns are free.
    pub(crate) fn new(normal: &Normal, effect: Column) -> Self {
        let mut with = normal.clone();
        let at = with.len();
        with.push(effect, Prior::FREE);
        let solution = with.solve(None);
        let variance = robust(&with, &solution, &[at])[(0, 0)];
        let coefficient = solution.values[at];
        Evidence {
            coefficient,
            deviations: coefficient / variance.max(1e-300).sqrt(),
        }
    }

    /// Of records that are independent of each other (Stouffer's sum of deviations).
    pub(crate) fn of_all(records: &[Evidence]) -> Self {
        let count = records.len() as f64;
        let sum = |of: fn(&Evidence) -> f64| records.iter().map(of).sum::<f64>();
        Evidence {
            coefficient: sum(|one| one.coefficient) / count,
            deviations: sum(|one| one.deviations) / count.sqrt(),
        }
    }

    /// Whether the record that it was fitted to has more of it than chance makes of the best of so many candidates.
    pub(crate) fn on_fit(&self, best_of: usize) -> Result<(), &'static str> {
        let of_chance = (2.0 * (best_of.max(2) as f64).ln()).sqrt();
        match self.deviations >= of_chance + SURE_OF_BEST {
            true => Ok(()),
            false => Err("no more than chance makes of the fit record"),
        }
    }

    /// Whether a record that it was not fitted to bears it out.
    pub(crate) fn borne_out(&self) -> Result<(), &'static str> {
        if self.deviations < SURE || self.coefficient <= COEFFICIENT.start {
            return Err(NOT_BORNE_OUT);
        }
        match self.coefficient < COEFFICIENT.end {
            true => Ok(()),
            false => Err("the check record has it in another size"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::regression::sandwich::tests::coloured;

    const ROWS: usize = 4000;

    /// What a record with coloured noise and `size` times a wave says of the wave.
    fn evidence(seed: u64, size: f64) -> Evidence {
        let wave: Vec<f64> = (0..ROWS).map(|k| (0.05 * k as f64).cos()).collect();
        let noise = coloured(seed, ROWS, 0.9);
        let target = wave.iter().zip(&noise).map(|(w, e)| size * w + e).collect();
        let folds = std::iter::once(0..ROWS).collect();
        Evidence::new(
            &Normal::new(Column::alone(target), &folds),
            Column::alone(wave),
        )
    }

    #[test]
    fn what_is_there_in_its_size_is_borne_out_and_nothing_else() {
        let share = |size: f64| {
            let runs = (0..100).filter(|seed| evidence(*seed, size).borne_out().is_ok());
            runs.count()
        };
        let (there, not_there, half, twice) = (share(1.0), share(0.0), share(0.3), share(2.5));
        assert!(
            there > 95,
            "{there} of 100 with the wave, expected more than 95"
        );
        assert!(
            not_there < 3,
            "{not_there} of 100 without the wave, expected less than 3"
        );
        assert!(
            half < 10 && twice < 3,
            "of another size: {half}, {twice} of 100"
        );
    }
}
