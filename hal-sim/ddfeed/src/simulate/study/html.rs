//! `report.html`: the experiment as a page that stands alone.

use super::curves::{curve, sensitivity};
use super::learned::LEARNING_S;
use super::records::records;
use super::report::{Report, RunReport};
use askama::Template;
use page::document::{document, sentence, short, two};

/// The page.
pub(crate) fn page(report: &Report) -> String {
    let title = format!(
        "Ripple of the table velocity at {} mm/s",
        short(report.setup.table_mm_s)
    );
    let result = &result(report);
    document(&title, &Body { report, result })
}

#[derive(Template)]
#[template(path = "simulate.html")]
struct Body<'a> {
    report: &'a Report,
    result: &'a str,
}

/// What the runs say, in a sentence.
fn result(report: &Report) -> String {
    match learned_result(report) {
        Some(learned) => format!("{} {learned}", plain_result(report)),
        None => plain_result(report),
    }
}

/// The ripple after learning: of the single drive and of the best double drive where both are there, else its range.
fn learned_result(report: &Report) -> Option<String> {
    let runs = report.runs.iter();
    let learned = runs.filter_map(|run| Some((run.nut_rpm, run.learned_percent?)));
    let single = learned.clone().find(|(rpm, _)| *rpm == 0.0);
    let double = learned
        .clone()
        .filter(|(rpm, _)| *rpm != 0.0)
        .min_by(|a, b| a.1.total_cmp(&b.1));
    if let (Some((_, single)), Some((rpm, double))) = (single, double) {
        return Some(format!(
            "After learning it is {} % with CDFS and {} % at {} rpm.",
            two(Some(single)),
            two(Some(double)),
            short(rpm)
        ));
    }
    let percents = learned.map(|(_, percent)| percent);
    let least = percents.clone().reduce(f64::min)?;
    let most = percents.reduce(f64::max)?;
    let range = match least == most {
        true => two(Some(least)),
        false => format!("{} to {}", two(Some(least)), two(Some(most))),
    };
    Some(format!("After learning it is {range} %."))
}

fn plain_result(report: &Report) -> String {
    let known = |run: &&RunReport| run.vrf_percent.is_finite();
    let moving = || {
        report
            .runs
            .iter()
            .filter(|run| run.nut_rpm != 0.0)
            .filter(known)
    };
    let best = moving().min_by(|a, b| a.vrf_percent.total_cmp(&b.vrf_percent));
    let at = |run: &RunReport| format!("{} rpm", short(run.nut_rpm));
    let vrf = |run: &RunReport| format!("{} %", two(Some(run.vrf_percent)));
    match (report.cdfs().filter(known), best) {
        (Some(cdfs), Some(best)) if best.vrf_percent < cdfs.vrf_percent => {
            let worse: Vec<_> = moving()
                .filter(|run| run.vrf_percent >= cdfs.vrf_percent)
                .map(at)
                .collect();
            let but = match worse.is_empty() {
                true => String::new(),
                false => format!(" Not so at {}: no better than CDFS.", worse.join(", ")),
            };
            format!(
                "Turning the nut at {} lowers the velocity ripple (VRF) from {} with CDFS to {}: {} % less.{but}",
                at(best),
                vrf(cdfs),
                vrf(best),
                short((100.0 * (1.0 - best.vrf_percent / cdfs.vrf_percent)).round()),
            )
        }
        (Some(cdfs), Some(best)) => format!(
            "Turning the nut does not lower the velocity ripple (VRF): {} with CDFS, {} at the best nut speed, {}.",
            vrf(cdfs),
            vrf(best),
            at(best),
        ),
        (Some(cdfs), None) => format!(
            "The velocity ripple (VRF) is {} with CDFS; no DDFS run was made.",
            vrf(cdfs)
        ),
        (None, Some(best)) => format!(
            "The velocity ripple (VRF) is least, {}, with the nut at {}; no CDFS run was made to compare with.",
            vrf(best),
            at(best),
        ),
        (None, None) => "No run gave a velocity ripple.".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::report::{CurveReport, Mark as Harmonic, SensitivityReport, SetupReport};
    use super::*;
    use std::f64::consts::TAU;

    fn run(nut_rpm: f64, vrf_percent: f64, measured_percent: Option<f64>) -> RunReport {
        let wave = |k: u32| 2.5 + 0.0125 * vrf_percent * (TAU * 15.0 * f64::from(k) * 1e-4).sin();
        RunReport {
            nut_rpm,
            vrf_percent,
            learned_percent: (vrf_percent > 20.0).then_some(1.25),
            analytic_percent: vrf_percent + 0.25,
            measured_percent,
            mean_mm_s: 2.5,
            velocity_mm_s: (0..10_000).map(wave).collect(),
            spectrum: (1..4_000)
                .map(|k| (f64::from(k) * 0.25, 1.0 / f64::from(k)))
                .collect(),
        }
    }

    fn report(runs: Vec<RunReport>) -> Report {
        let slope = |k: u32| (f64::from(k), 50.0 / f64::from(k));
        Report {
            setup: SetupReport {
                machine: "models/<odd> & \"old\".toml".into(),
                sensors: "ideal".into(),
                table_mm_s: 2.5,
                load: "1 N m".into(),
                record_s: 4.0,
                record_hz: 10_000.0,
                seed: 4711,
                is_paper: true,
            },
            runs,
            sensitivity: SensitivityReport {
                analytic: (5..5_000).map(slope).collect(),
                ideal: vec![slope(50)],
                measured: vec![slope(60)],
                marks: vec![Harmonic {
                    name: "A6".into(),
                    omega: 94.2,
                    gain: 0.5,
                }],
            },
            curve: CurveReport {
                analytic: vec![(0.0, 21.0), (800.0, 6.0)],
                measured: vec![(800.0, 8.2)],
            },
        }
    }

    #[test]
    fn every_figure_of_the_runs_is_on_the_page() {
        let page = page(&report(vec![
            run(0.0, 21.2, Some(20.1)),
            run(800.0, 6.3, Some(8.2)),
            run(500.0, 9.8, None),
        ]));
        page::check::sound(&page).unwrap();
        let page = page.replace('\u{A0}', " ");
        assert!(
            page.contains(
                "<th scope=\"row\">0 (CDFS)</th><td>21.20</td><td>1.25</td><td>21.45</td><td>20.1</td>"
            ),
            "no {:?} in:\n{page}",
            "<th scope=\"row\">0 (CDFS)</th><td>21.20</td><td>1.25</td><td>21.45</td><td>20.1</td>"
        );
        assert!(
            page.contains(
                "<th scope=\"row\">800</th><td>6.30</td><td>\u{2013}</td><td>6.55</td><td>8.2</td>"
            ),
            "no {:?} in:\n{page}",
            "<th scope=\"row\">800</th><td>6.30</td><td>\u{2013}</td><td>6.55</td><td>8.2</td>"
        );
        assert!(
            page.contains("<th scope=\"row\">500</th><td>9.80</td><td>\u{2013}</td><td>10.05</td><td>\u{2013}</td>"),
            "no {:?} in:\n{page}",
            "<th scope=\"row\">500</th><td>9.80</td><td>\u{2013}</td><td>10.05</td><td>\u{2013}</td>"
        );
        assert!(page.contains( "nut at 800 rpm lowers the velocity ripple (VRF) from 21.20 % with CDFS to 6.30 %: 70 %" ), "no {:?} in:\n{page}", "nut at 800 rpm lowers the velocity ripple (VRF) from 21.20 % with CDFS to 6.30 %: 70 %");
        assert_eq!(page.matches("<svg class=\"plot\"").count(), 2 * 2 + 2);
        assert!(
            page.contains("Fig 8)") && page.contains("Fig 7)") && page.contains("A6"),
            "figures 7 and 8 and A6 are not all named in:\n{page}"
        );
        assert!(
            page.contains("Load: 1 N m.") && page.contains("Seed: 4711."),
            "no load of 1 N m or no seed 4711 in:\n{page}"
        );
    }

    #[test]
    fn names_from_outside_are_escaped() {
        let page = page(&report(vec![run(0.0, 21.2, None)]));
        page::check::sound(&page).unwrap();
        assert!(
            page.contains("Machine: models/&#60;odd&#62; &#38; &#34;old&#34;.toml."),
            "no {:?} in:\n{page}",
            "Machine: models/&#60;odd&#62; &#38; &#34;old&#34;.toml."
        );
        assert!(
            !page.contains("<odd>"),
            "there is {:?} in:\n{page}",
            "<odd>"
        );
    }

    #[test]
    fn empty_records_and_missing_values_leave_a_sound_page() {
        let hollow = |nut_rpm| RunReport {
            analytic_percent: f64::INFINITY,
            velocity_mm_s: Vec::new(),
            spectrum: vec![(10.0, f64::NAN)],
            ..run(nut_rpm, f64::NAN, None)
        };
        let mut bare = report(vec![hollow(0.0), hollow(300.0)]);
        bare.sensitivity.marks[0].gain = 0.0;
        bare.sensitivity.measured = vec![(10.0, -1.0)];
        bare.curve.analytic = Vec::new();
        let page_ = page(&bare);
        page::check::sound(&page_).unwrap();
        assert!(
            page_.contains("No run gave a velocity ripple."),
            "no {:?} in:\n{page_}",
            "No run gave a velocity ripple."
        );
        assert!(
            page_.contains("nothing was recorded"),
            "no {:?} in:\n{page_}",
            "nothing was recorded"
        );
        let mut none = report(Vec::new());
        none.sensitivity.analytic.clear();
        none.curve.measured.clear();
        page::check::sound(&page(&none)).unwrap();
    }

    #[test]
    fn the_sentence_does_not_praise_what_is_worse() {
        let worse = result(&report(vec![
            run(0.0, 5.0, None),
            run(300.0, 7.0, None),
            run(500.0, 6.0, None),
        ]));
        assert!(
            worse.contains("does not lower")
                && worse.contains("6.00 % at the best nut speed, 500 rpm"),
            "{worse}"
        );
        let mixed = result(&report(vec![
            run(0.0, 5.0, None),
            run(300.0, 7.0, None),
            run(500.0, 4.0, None),
        ]));
        assert!(
            mixed.contains("20 % less") && mixed.contains("Not so at 300 rpm"),
            "{mixed}"
        );
        let alone = result(&report(vec![run(300.0, 7.0, None)]));
        assert!(
            alone.contains("no CDFS run"),
            "no {:?} in:\n{alone}",
            "no CDFS run"
        );
        assert!(
            result(&report(vec![run(0.0, 7.0, None)])).contains("no DDFS run"),
            "{}",
            result(&report(vec![run(0.0, 7.0, None)]))
        );
    }
}
