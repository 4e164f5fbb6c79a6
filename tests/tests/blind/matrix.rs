//! Which kind was told for which.

use plant::effects::{AnyEffect, EffectModel};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Counts by what was there and what was found.
#[derive(Default)]
pub struct Matrix {
    counts: BTreeMap<(String, String), u32>,
}

const NOTHING: &str = "nothing";

impl Matrix {
    /// Counts one machine: what is on both sides is told right, the rest is told for each other.
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
        const CELL: usize = 26;
        const LEFT: usize = 190;
        let names: Vec<&str> = AnyEffect::KINDS.iter().copied().chain([NOTHING]).collect();
        let size = LEFT + CELL * names.len() + 10;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {size} {size}\" font-family=\"sans-serif\" font-size=\"12\">\n\
             <style>svg {{ background: #fff; color: #1b1f24; fill: currentColor }} \
             @media screen and (prefers-color-scheme: dark) {{ svg {{ background: #14171a; color: #e8eaed }} }}</style>\n"
        );
        let _ = writeln!(
            svg,
            "<text x=\"12\" y=\"{}\" font-weight=\"bold\">has (rows),</text>\n\
             <text x=\"12\" y=\"{}\" font-weight=\"bold\">told (columns)</text>",
            LEFT - 30,
            LEFT - 14
        );
        for (k, name) in names.iter().enumerate() {
            let at = LEFT + CELL * k + CELL / 2;
            let _ = writeln!(
                svg,
                "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{name}</text>",
                LEFT - 8,
                at + 4
            );
            let _ = writeln!(
                svg,
                "<text transform=\"translate({},{}) rotate(-90)\">{name}</text>",
                at + 4,
                LEFT - 8
            );
        }
        for (row, there) in names.iter().enumerate() {
            for (column, found) in names.iter().enumerate() {
                let count = self
                    .counts
                    .get(&((*there).to_owned(), (*found).to_owned()))
                    .copied()
                    .unwrap_or(0);
                let (x, y) = (LEFT + CELL * column, LEFT + CELL * row);
                // Right, silent, a wrong name.
                let fill = match (count, row == column, *found == NOTHING) {
                    (0, _, _) => "none",
                    (_, true, _) => "#0b62a8",
                    (_, _, true) => "#6b7280",
                    _ => "#c2410c",
                };
                let _ = writeln!(
                    svg,
                    "<rect x=\"{x}\" y=\"{y}\" width=\"{CELL}\" height=\"{CELL}\" fill=\"{fill}\" stroke=\"#8a929b\" stroke-width=\"0.5\"/>"
                );
                if count > 0 {
                    let _ = writeln!(
                        svg,
                        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\" fill=\"#fff\">{count}</text>",
                        x + CELL / 2,
                        y + CELL / 2 + 4
                    );
                }
            }
        }
        svg + "</svg>\n"
    }
}
