//! What is not fitted says of what is: a record beside another one, or two halves of one that take turns
//! (cross-validation).

use crate::regression::column::{Column, dot};
use crate::regression::normal::{Normal, Prior};
use crate::search::selection::{Evidence, TOO_LITTLE};

/// A regression of one channel, and the same columns where they are not fitted.
#[derive(Clone)]
pub(crate) struct Holdout {
    pub(crate) fit: Normal,
    target: Column,
    columns: Vec<Column>,
}

/// The mean square of a channel.
fn square(column: &Column) -> f64 {
    let values = column.only();
    dot(values, values) / values.len().max(1) as f64
}

/// A regression without columns, of one operating point.
pub(crate) fn alone(target: Column) -> Normal {
    let whole = std::iter::once(0..target.only().len()).collect();
    Normal::new(target, &whole)
}

impl Holdout {
    /// Without columns, of what is fitted and what is not.
    pub(crate) fn new([fit, target]: [Column; 2]) -> Self {
        Holdout {
            fit: alone(fit),
            columns: Vec::new(),
            target,
        }
    }

    /// Adds columns, there and there.
    pub(crate) fn extend<'a>(&mut self, columns: [impl IntoIterator<Item = &'a Column>; 2]) {
        let [fit, other] = columns;
        for column in fit {
            self.fit.push(column.clone(), Prior::FREE);
        }
        self.columns.extend(other.into_iter().cloned());
    }

    /// What parameters leave of what was not fitted.
    fn left(&self, values: &[f64]) -> Column {
        self.target.less(&self.columns, values.iter().copied())
    }

    /// Mean squares that its columns leave of what is fitted and what is not.
    pub(crate) fn squares(&self) -> [f64; 2] {
        let values = self.fit.solve(None).values;
        [self.fit.residual(&values), self.left(values.as_slice())].map(|left| square(&left))
    }
}

/// An effect that was fitted on one side of each holdout and compared with the other.
#[derive(Debug, Clone)]
pub(crate) struct Validated {
    /// Its parameters, the mean of all fits.
    pub(crate) values: Vec<f64>,
    /// Mean squares that are left of what was not fitted, without it and with it.
    pub(crate) squares: [f64; 2],
    on_fit: Evidence,
    on_check: Evidence,
}

impl Validated {
    /// Of an effect with columns on both sides of each holdout.
    pub(crate) fn new<'a>(
        holdouts: impl IntoIterator<Item = (&'a Holdout, [&'a [Column]; 2])>,
        prior: Prior,
    ) -> Self {
        let (mut values, mut on_fit) = (Vec::new(), Vec::new());
        let (mut without, mut rest, mut effect) = (Vec::new(), Vec::new(), Vec::new());
        for (holdout, [fit, other]) in holdouts {
            let mut with = holdout.fit.clone();
            for column in fit {
                with.push(column.clone(), prior);
            }
            let solution = with.solve(None).values;
            let (known, own) = solution.as_slice().split_at(holdout.fit.len());
            on_fit.push(Evidence::new(
                &holdout.fit,
                Column::default().plus(fit, own),
            ));
            let before = holdout.fit.solve(None).values;
            without.extend_from_slice(holdout.left(before.as_slice()).only());
            rest.extend_from_slice(holdout.left(known).only());
            effect.extend_from_slice(Column::default().plus(other, own).only());
            values.push(own.to_vec());
        }
        let mean = |k: usize| {
            values.iter().map(|own: &Vec<f64>| own[k]).sum::<f64>() / values.len() as f64
        };
        let [without, rest, effect] = [without, rest, effect].map(Column::alone);
        Validated {
            values: (0..values.first().map_or(0, Vec::len)).map(mean).collect(),
            squares: [&without, &rest.less([&effect], [1.0])].map(square),
            on_fit: Evidence::of_all(&on_fit),
            on_check: Evidence::new(&alone(rest), effect),
        }
    }

    /// Share by which it lowers the rms of what was not fitted.
    pub(crate) fn fall(&self) -> f64 {
        1.0 - (self.squares[1] / self.squares[0].max(1e-300)).sqrt()
    }

    /// Rms of what it explains of what was not fitted.
    pub(crate) fn explained_rms(&self) -> f64 {
        (self.squares[0] - self.squares[1]).max(0.0).sqrt()
    }

    /// Whether what it was not fitted to bears it out.
    pub(crate) fn borne_out(&self) -> Result<(), &'static str> {
        self.on_check.borne_out()
    }

    /// The same of the best of so many candidates that must lower the rms by a share.
    pub(crate) fn stands(&self, best_of: usize, least: f64) -> Result<(), &'static str> {
        match self.fall() > least {
            true => self.on_fit.on_fit(best_of).and(self.borne_out()),
            false => Err(TOO_LITTLE),
        }
    }
}
