//! Progress on standard error: a bar in a terminal, lines where it was asked for, nothing else.

use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;

/// Tells what is going on.
pub(super) enum Told {
    /// A bar.
    Bar(ProgressBar),
    /// Lines: the last one's subject and tenth.
    Lines(String, u32),
    /// Nothing.
    Silent,
}

impl Told {
    /// For a person at a terminal, or in lines where lines are asked for.
    pub(super) fn new(lines: bool) -> Self {
        if lines {
            return Told::Lines(String::new(), 0);
        }
        if !std::io::stderr().is_terminal() {
            return Told::Silent;
        }
        let bar = ProgressBar::new(100);
        let style = ProgressStyle::with_template("{msg:24} {bar:40} {pos:>3} %");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        Told::Bar(bar)
    }

    /// `what` is going on, `share` of it done.
    pub(super) fn say(&mut self, what: &str, share: Option<f64>) {
        let percent = share.map_or(0, |share| (100.0 * share.clamp(0.0, 1.0)) as u32);
        match self {
            Told::Bar(bar) => {
                bar.set_message(what.to_owned());
                bar.set_position(percent.into());
            }
            Told::Lines(before, tenth) => {
                if before != what || percent / 10 != *tenth {
                    let done = share.map_or_else(String::new, |_| format!(", {percent} %"));
                    eprintln!("{what}{done}");
                    (*before, *tenth) = (what.to_owned(), percent / 10);
                }
            }
            Told::Silent => {}
        }
    }

    /// Nothing more is to come.
    pub(super) fn end(&mut self) {
        if let Told::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }
}
