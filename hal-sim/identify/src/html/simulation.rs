//! The record's profile, measured and simulated.

use crate::report::{Hold, Simulation, Stage};
use page::axis::{Axis, extent};
use page::chart::{COOL, Chart, INK, MUTED, Mark, Series, WARM, chart};
use page::document::{legend, short, two};

/// Holds whose spectra are drawn.
const DRAWN: usize = 4;
/// Lines of a spectrum that are marked.
const MARKED: usize = 8;
/// Lines nearer than this are one, Hz.
const APART_HZ: f64 = 5.0;
/// Measured, declared, new: rings, crosses and dots, told apart without colour too.
const INKS: [(page::chart::Ink, Mark); 3] =
    [(INK, Mark::Ring), (WARM, Mark::Cross), (COOL, Mark::Dot)];

/// The section.
pub(super) fn section(simulation: &Simulation) -> String {
    let rows: String = simulation
        .holds
        .iter()
        .map(|hold| {
            format!(
                "<tr><th scope=\"row\">{} s</th><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
                two(Some(hold.start_s)),
                two(Some(hold.table_mm_s)),
                short(hold.nut_rpm.round()),
                two(Some(hold.measured_vrf_percent)),
                two(Some(hold.declared_vrf_percent)),
                two(Some(hold.new_vrf_percent)),
            )
        })
        .collect();
    let keys = [
        "measured",
        "simulated, declared model",
        "simulated, new model",
    ];
    let keys: Vec<_> = INKS
        .iter()
        .zip(keys)
        .map(|((color, mark), name)| (*color, *mark, name.to_owned()))
        .collect();
    // Where the two models differ most there is most to see.
    let mut holds: Vec<&Hold> = simulation.holds.iter().collect();
    let gap = |hold: &Hold| (hold.declared_vrf_percent - hold.new_vrf_percent).abs();
    holds.sort_by(|a, b| gap(b).total_cmp(&gap(a)));
    let figures: String = holds.into_iter().take(DRAWN).map(figure).collect();
    format!(
        "<section>\n<h2>The check record, driven again</h2>\n<p class=\"note\">The fixed-point drive, free-running on the \
         declared and on the new model, over the speeds of the check record. Ripple of the table\u{2019}s velocity (VRF, \
         peak to peak over the reference, from the scale with its noise): simulated less measured is {} points rms with \
         the declared model, {} with the new one.</p>\n\
         <div class=\"scroll\" role=\"region\" aria-label=\"Ripple by hold\" tabindex=\"0\">\n<table>\n\
         <thead><tr><th scope=\"col\">From</th><th scope=\"col\">Table, mm/s</th><th scope=\"col\">Nut, rpm</th>\
         <th scope=\"col\">Measured, %</th><th scope=\"col\">Declared model, %</th><th scope=\"col\">New model, %</th></tr></thead>\n\
         <tbody>\n{rows}</tbody>\n</table>\n</div>\n{}<div class=\"pair\">\n{figures}</div>\n</section>\n",
        two(Some(simulation.declared_rms_points)),
        two(Some(simulation.new_rms_points)),
        legend(&keys),
    )
}

fn figure(hold: &Hold) -> String {
    let caption = format!(
        "Velocity spectrum, table {} mm/s, nut {} rpm",
        short(hold.table_mm_s),
        short(hold.nut_rpm.round())
    );
    let most = extent(hold.spectra.iter().flatten().map(|p| p.1)).map_or(1.0, |r| r.end);
    let last = extent(hold.spectra.iter().flatten().map(|p| p.0)).map_or(1.0, |r| r.end);
    let lines = highest(&hold.spectra[0]);
    let near = |points: &[(f64, f64)], hz: f64| {
        let near = points.iter().filter(|p| (p.0 - hz).abs() < APART_HZ);
        near.map(|p| p.1).fold(0.0, f64::max)
    };
    let measured = Series {
        points: hold.spectra[0].clone(),
        color: MUTED,
        mark: Mark::Line(1.5),
    };
    // Dots first: a ring and a cross still show on them.
    let marked = hold
        .spectra
        .iter()
        .zip(INKS)
        .rev()
        .map(|(points, (color, mark))| Series {
            points: lines.iter().map(|hz| (*hz, near(points, *hz))).collect(),
            color,
            mark,
        });
    let series = std::iter::once(measured).chain(marked).collect();
    let svg = chart(&Chart {
        about: &caption,
        x: Axis {
            title: "Frequency, Hz",
            range: Some(0.0..last),
            log: false,
        },
        y: Axis {
            title: "Amplitude, mm/s",
            range: Some(0.0..1.1 * most),
            log: false,
        },
        series,
        labels: Vec::new(),
    });
    format!("<figure>\n<figcaption>{caption}</figcaption>\n{svg}</figure>\n")
}

/// Frequencies of a spectrum's highest lines.
fn highest(spectrum: &[(f64, f64)]) -> Vec<f64> {
    let mut points: Vec<_> = spectrum.iter().filter(|p| p.1.is_finite()).collect();
    points.sort_by(|a, b| b.1.total_cmp(&a.1));
    let most = points.first().map_or(0.0, |p| p.1);
    let mut lines: Vec<f64> = Vec::new();
    for (hz, amplitude) in points {
        let new = lines.iter().all(|line| (line - hz).abs() > 2.0 * APART_HZ);
        if new && lines.len() < MARKED && *amplitude > 0.05 * most {
            lines.push(*hz);
        }
    }
    lines
}

/// Closed-loop errors, effect by effect.
pub(super) fn stages(stages: &[Stage]) -> String {
    if stages.is_empty() {
        return String::new();
    }
    let rows: String = stages
        .iter()
        .map(|stage| {
            format!(
                "<tr><th scope=\"row\" class=\"text\">{}</th><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
                page::document::escape(&stage.added),
                two(Some(stage.fit.force_percent)),
                two(Some(stage.check.force_percent)),
                two(Some(stage.check_homed.force_percent)),
                format_args!("{:.3}", stage.check_homed.velocity_percent),
                two(Some(stage.check_homed.position_um)),
            )
        })
        .collect();
    format!(
        "<section>\n<h2>Closed-loop simulation, effect by effect</h2>\n<p class=\"note\">Force after a 100 Hz zero-phase \
         filter, rms of the error over rms. Nothing is fitted on the check record; what repeats with the screw has no phase \
         there and is left out, or (homed) its one angle is taken from the first quarter and the rest is scored. The last \
         row has the derivative as it is instead of the controller\u{2019}s own.</p>\n\
         <div class=\"scroll\" role=\"region\" aria-label=\"Errors by stage\" tabindex=\"0\">\n<table>\n\
         <thead><tr><th scope=\"col\">Added</th><th scope=\"col\">Fit, %</th><th scope=\"col\">Check, %</th>\
         <th scope=\"col\">Check, homed, %</th><th scope=\"col\">Velocity, %</th><th scope=\"col\">Position, \u{B5}m</th></tr></thead>\n\
         <tbody>\n{rows}</tbody>\n</table>\n</div>\n</section>\n"
    )
}
