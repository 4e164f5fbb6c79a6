//! Which kind was told for which.

use page::document::standalone;
use page::drawing::{Anchor, Shape, drawing};
use plant::effects::{AnyEffect, EffectModel};
use std::collections::BTreeMap;

/// Counts by what was there and what was found.
#[derive(Default)]
pub struct Matrix {
    counts: BTreeMap<(String, String), u32>,
}

const NOTHING: &str = "nothing";

impl Matrix {
    /// Counts one machine: effects on both sides are right, the others are confused.
    pub fn count(&mut self, truth: &[EffectModel], found: &[String]) {
        let mut there: Vec<String> = truth.iter().map(|e| e.effect().kind().to_owned()).collect();
        let mut told: Vec<String> = found
            .iter()
            .map(|f| f.split(' ').next().unwrap_or(f).to_owned())
            .collect();
        there.retain(|kind| match told.iter().position(|other| other == kind) {
            Some(at) => {
                told.remove(at);
                *self.counts.entry((kind.clone(), kind.clone())).or_default() += 1;
                false
            }
            None => true,
        });
        let rest = there
            .len()
            .max(told.len())
            .max(usize::from(truth.is_empty() && found.is_empty()));
        let name =
            |list: &[String], k: usize| list.get(k).cloned().unwrap_or_else(|| NOTHING.to_owned());
        for k in 0..rest {
            *self
                .counts
                .entry((name(&there, k), name(&told, k)))
                .or_default() += 1;
        }
    }

    /// The matrix as a picture: what was there by rows, what was found by columns.
    pub fn svg(&self) -> String {
        const CELL: f64 = 26.0;
        const LEFT: f64 = 190.0;
        // The colours that a page's style gives others in the dark.
        const INK: &str = "#1B1F24";
        const LINE: (&str, f64) = ("#5A626B", 0.5);
        let names: Vec<&str> = AnyEffect::KINDS.iter().copied().chain([NOTHING]).collect();
        let size = LEFT + CELL * names.len() as f64 + 10.0;
        let text = |at, anchor, words: &str| Shape::text(at, anchor, INK, words);
        let mut shapes = vec![
            text((12.0, LEFT - 30.0), Anchor::Start, "has (rows),").bold(),
            text((12.0, LEFT - 14.0), Anchor::Start, "told (columns)").bold(),
        ];
        for (k, name) in names.iter().enumerate() {
            let at = LEFT + CELL * k as f64 + CELL / 2.0 + 4.0;
            shapes.push(text((LEFT - 8.0, at), Anchor::End, name));
            shapes.push(text((at, LEFT - 8.0), Anchor::Start, name).turned());
        }
        for (row, there) in names.iter().enumerate() {
            for (column, found) in names.iter().enumerate() {
                let count = self
                    .counts
                    .get(&((*there).to_owned(), (*found).to_owned()))
                    .copied()
                    .unwrap_or(0);
                let (x, y) = (LEFT + CELL * column as f64, LEFT + CELL * row as f64);
                // Right, silent, a wrong name.
                let fill = match (count, row == column, *found == NOTHING) {
                    (0, _, _) => "none",
                    (_, true, _) => "#0B62A8",
                    (_, _, true) => "#5A626B",
                    _ => "#C2410C",
                };
                shapes.push(Shape::rectangle((x, y), (CELL, CELL), fill, LINE));
                if count > 0 {
                    let middle = (x + CELL / 2.0, y + CELL / 2.0 + 4.0);
                    let count = count.to_string();
                    shapes.push(Shape::text(middle, Anchor::Middle, "#fff", count));
                }
            }
        }
        let about = "Which effect was told for which";
        standalone(&drawing(about, (size, size), 12.0, &shapes))
    }
}
