//! A record under a model, and that whitened.

use crate::balance::Balance;
use crate::effects::family::Family;
use crate::effects::hypothesis::Hypothesis;
use crate::record::Base;
use crate::regression::design::Whitener;
use crate::regression::normal::Normal;
use crate::search::select::{Columns, Search};
use crate::signal::noise::Noise;

/// A record under a model: what is looked through, or what must confirm.
pub(crate) struct Case<'a> {
    pub(crate) balance: &'a Balance<'a>,
    pub(crate) base: &'a Base,
    pub(crate) declared: Noise,
}

impl<'a> Case<'a> {
    pub(crate) fn new(balance: &'a Balance<'a>, base: &'a Base) -> Self {
        Case {
            balance,
            base,
            declared: Noise::declared(balance.model, balance.signals, balance.fourier),
        }
    }

    pub(crate) fn whitener(&self, noise: &Noise) -> Whitener<'a> {
        Whitener::new(self.balance.signals, self.balance.fourier, noise)
    }

    /// The regression of the declared parameters and given effects.
    pub(crate) fn search<'w>(&self, whitener: &'w Whitener<'w>, found: &[Hypothesis]) -> Search<'w>
    where
        'a: 'w,
    {
        let mut search = Search::new(self.balance, whitener, self.base.normal(whitener));
        found.iter().for_each(|hypothesis| search.add(hypothesis));
        search
    }

    /// What the sensors make of the channels of a machine with given effects.
    fn sensors(&self, found: &[Hypothesis]) -> Noise {
        let soft = found
            .iter()
            .find(|hypothesis| hypothesis.family == Family::AxialCompliance);
        match soft {
            Some(soft) => Noise::with_resonance(
                self.balance.model,
                self.balance.signals,
                self.balance.fourier,
                soft.shape,
            ),
            None => self.declared.clone(),
        }
    }

    /// The noise that fits what a regression with given effects leaves, starting from another estimate of it.
    pub(crate) fn noise(&self, from: Option<&Noise>, found: &[Hypothesis]) -> Noise {
        let sensors = self.sensors(found);
        // A softer screw amplifies the sensors' noise elsewhere: what was estimated without it does not hold.
        let from = from
            .filter(|_| found.iter().all(|h| h.family != Family::AxialCompliance))
            .unwrap_or(&sensors);
        let whitener = self.whitener(from);
        let normal = self.search(&whitener, found).normal;
        let left = normal.residual(&normal.solve(None).values);
        from.corrected(&sensors, &left.parts, self.balance.fourier)
    }
}

/// A record under a model and a noise: whitened once for all that is asked of it.
pub(crate) struct Whitened<'c, 'a> {
    pub(crate) case: &'c Case<'a>,
    pub(crate) noise: Noise,
    pub(crate) whitener: Whitener<'a>,
    /// The regression of the declared parameters.
    bare: Normal,
    columns: Columns,
}

impl<'c, 'a> Whitened<'c, 'a> {
    /// Under a noise.
    pub(crate) fn new(case: &'c Case<'a>, noise: Noise) -> Self {
        let whitener = case.whitener(&noise);
        Whitened {
            bare: case.base.normal(&whitener),
            columns: Columns::default(),
            case,
            noise,
            whitener,
        }
    }

    /// The regression of the declared parameters and given effects.
    pub(crate) fn search(&self, found: &[Hypothesis]) -> Search<'_> {
        let mut search = self.of(self.bare.clone());
        found.iter().for_each(|hypothesis| search.add(hypothesis));
        search
    }

    /// A search from a regression that was made here.
    pub(crate) fn of(&self, normal: Normal) -> Search<'_> {
        Search::new(self.case.balance, &self.whitener, normal).knowing(&self.columns)
    }

    /// The same under the noise that fits the residual with given effects.
    pub(crate) fn again(&mut self, found: &[Hypothesis]) {
        let soft = |h: &Hypothesis| h.family == Family::AxialCompliance;
        let noise = match found.iter().any(soft) {
            true => self.case.noise(None, found),
            false => {
                let normal = self.search(found).normal;
                let left = normal.residual(&normal.solve(None).values);
                let sensors = self.case.sensors(found);
                let fourier = self.case.balance.fourier;
                self.noise.corrected(&sensors, &left.parts, fourier)
            }
        };
        if self.noise.differs(&noise) >= SAME_NOISE {
            *self = Whitened::new(self.case, noise);
        }
    }
}

/// Relative difference of two noises that makes one: what is whitened by the one is white under the other within a tenth
/// of its power, less than a band's own chance.
const SAME_NOISE: f64 = 0.1;
