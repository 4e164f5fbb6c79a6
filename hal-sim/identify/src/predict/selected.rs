//! Which functions of the coordinates are tried on a residual, and which of them predict it.

use super::basis::{Along, At, Group};
use super::ridge::Products;
use super::side::{Partialled, Side};

/// Share of the residual's power that a group must take of blocks to which it was not fitted.
const LEAST_SHARE: f64 = 0.02;
/// Groups at most: the search's budget.
const MOST_GROUPS: usize = 16;
/// Share of the check record's rows that may be outside of what a group learnt.
const OUTSIDE: f64 = 0.05;
/// Share of a function that must be left beside the declared regressors, or it says the same as they.
const LEAST_OWN: f64 = 0.03;

/// A side's coordinates where its rows count.
fn counted_places(side: &Side) -> impl Iterator<Item = &At> {
    let rows = side.at.iter().zip(&side.open);
    rows.filter(|(_, open)| **open).map(|(at, _)| at)
}

/// Groups of functions that are offered, and whose range holds the check record.
pub(super) fn groups(
    [fit, check]: [&Side; 2],
    highest_order: u32,
    further: &[f64],
    offered: impl Fn(Along) -> bool,
) -> Vec<Group> {
    let rows: Vec<At> = counted_places(fit).copied().collect();
    let mut groups = Group::all(&rows, highest_order, further);
    groups.retain(|group| {
        let (outside, all) = counted_places(check).fold((0, 0), |(outside, all), at| {
            (outside + usize::from(group.is_outside(at)), all + 1)
        });
        offered(group.along) && outside as f64 <= OUTSIDE * all as f64
    });
    groups
}

/// Columns of each group that tell something beside the known regressors.
pub(super) fn members(groups: &[Group], fit: &Partialled) -> Vec<Vec<usize>> {
    let mut first = 0;
    groups
        .iter()
        .map(|group| {
            let own = first..first + group.len();
            first = own.end;
            let tells = own.clone().any(|k| fit.own[k] > LEAST_OWN);
            // Of functions side by side those between two speeds join the values at both.
            let is_whole = group.is_smooth() && tells;
            own.filter(|k| is_whole || fit.own[*k] > LEAST_OWN)
                .collect()
        })
        .collect()
}

/// Groups that lower the residual of blocks to which they were not fitted, and their columns.
/// The strongest group comes first.
pub(super) fn selected(products: &Products, members: &[Vec<usize>]) -> (Vec<usize>, Vec<usize>) {
    let energy = products.held_back(&[]);
    let (mut chosen, mut taken, mut least): (Vec<usize>, Vec<usize>, f64) =
        (Vec::new(), Vec::new(), energy);
    while taken.len() < MOST_GROUPS {
        let with = |group: usize| [chosen.as_slice(), &members[group]].concat();
        let open = (0..members.len())
            .filter(|group| !taken.contains(group) && !members[*group].is_empty());
        let best = open
            .map(|group| (products.held_back(&with(group)), group))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        match best {
            Some((left, group)) if least - left > LEAST_SHARE * least.min(energy) => {
                chosen = with(group);
                taken.push(group);
                least = left;
            }
            _ => break,
        }
    }
    (taken, chosen)
}
