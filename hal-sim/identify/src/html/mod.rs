//! `report.html`: what was found, for a person. The first screen answers: a sentence, the error before and after, the
//! picture; all else stands below.

mod charts;
mod live;
mod remedies;
mod simulation;
mod tables;
mod words;

use crate::report::{Channel, Report};
use askama::Template;
use page::document::{document, two};
use page::markup::Markup;

/// The page.
pub fn page(report: &Report) -> String {
    document(&title(report), &Body::of(report, None))
}

/// The page with what takes a script: at its end, so that without one nothing is missing.
pub fn live_page(report: &Report) -> String {
    let live = live::section(&shown(report), report);
    document(&title(report), &Body::of(report, live))
}

#[derive(Template)]
#[template(path = "report.html")]
struct Body<'a> {
    report: &'a Report,
    not_excited: Option<String>,
    result: String,
    lead: Option<Lead>,
    notes: Vec<String>,
    shown: Vec<&'a Channel>,
    marked: bool,
    refused: usize,
    live: Option<Markup>,
}

impl<'a> Body<'a> {
    fn of(report: &'a Report, live: Option<Markup>) -> Self {
        let notes = report
            .effects
            .iter()
            .flat_map(|effect| [words::held_back(effect), words::not_separable(effect)]);
        let shown = shown(report);
        Self {
            report,
            not_excited: not_excited(report),
            result: result(report),
            lead: lead(report),
            notes: notes.flatten().collect(),
            marked: shown.iter().any(|channel| !channel.marks.is_empty()),
            shown,
            refused: report.refused.iter().map(|refusal| refusal.trials).sum(),
            live,
        }
    }
}

/// The order spectrum of the first screen, as a file of its own.
pub fn picture(report: &Report) -> Option<String> {
    let (channel, _) = report.lead()?;
    Some(page::document::standalone(&charts::spectrum_chart(channel)))
}

/// The verdict, and what it says of the machine.
fn title(report: &Report) -> String {
    let verdict = words::capital(report.verdict);
    let of_machine = match report.verdict {
        "nothing missing" => return verdict,
        "not excited" => "the record cannot tell",
        "unexplained" => "something is left that is not explained",
        "wrong data" => "the data are not what they are said to be",
        "partly explained" => "a part of what the model lacks",
        _ => "what the record has and the model lacks",
    };
    format!("{verdict}: {of_machine}")
}

/// What the records do not excite.
fn not_excited(report: &Report) -> Option<String> {
    let words = report.said.untested_words()?;
    let refused = match report.refused.is_empty() {
        true => "",
        false => " Refused trials are listed below.",
    };
    Some(format!("Not tested by this record: {words}.{refused}"))
}

/// Effects that the first sentence names; the table has all.
const NAMED: usize = 3;

fn result(report: &Report) -> String {
    let mut sentences: Vec<String> = report
        .effects
        .iter()
        .take(NAMED)
        .map(words::sentence)
        .collect();
    if report.effects.len() > NAMED {
        sentences.push(format!(
            "{} more effects are below.",
            report.effects.len() - NAMED
        ));
    }
    sentences.push(report.said.why.clone());
    sentences.extend(report.said.left.clone());
    sentences.join(" ")
}

/// What one must know, on one screen.
struct Lead {
    /// Name, value, and what stands beside it.
    figures: Vec<[String; 3]>,
    key: Markup,
    orders: Markup,
    over: Markup,
}

fn lead(report: &Report) -> Option<Lead> {
    let (channel, figures) = report.lead()?;
    let (fall, beside) = words::fall(figures);
    let name = format!(
        "{} residual, rms, on the run that was not fitted",
        words::capital(&figures.channel)
    );
    let change = |name: &str, [before, after]: [f64; 2], unit: &str| {
        let value = format!(
            "{} \u{2192} {}\u{A0}{unit}",
            two(Some(before)),
            two(Some(after))
        );
        [name.to_owned(), value, String::new()]
    };
    let simulated = report.simulation.as_ref().map(|simulation| {
        change(
            "Ripple of the table (VRF), simulated less measured",
            [simulation.declared_rms_points, simulation.new_rms_points],
            "points",
        )
    });
    let stages = report.stages.first().zip(report.last_stage());
    let forces = stages.map(|(before, after)| {
        change(
            "Force error in closed-loop simulation of the check record",
            [before.check.force_percent, after.check_homed.force_percent],
            "%",
        )
    });
    Some(Lead {
        figures: [Some([name, fall, beside]), simulated, forces]
            .into_iter()
            .flatten()
            .collect(),
        key: charts::key(!channel.marks.is_empty()),
        orders: charts::orders(channel),
        over: charts::over(channel, &channel.turn),
    })
}

/// All channels in which something shows; where nothing is missing, the torques and the table.
fn shown(report: &Report) -> Vec<&Channel> {
    let shows = |name: &str| {
        report
            .figures(name)
            .is_some_and(|f| f.fit_before > 1.02 * f.fit_after)
    };
    let mut list: Vec<_> = report.channels.iter().filter(|c| shows(&c.name)).collect();
    if list.is_empty() {
        list = report
            .channels
            .iter()
            .filter(|c| !c.name.contains("voltage"))
            .collect();
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conclusion::said::Said;
    use crate::records::DataQuality;
    use crate::report::*;
    use std::collections::BTreeMap;

    fn report() -> Report {
        let time: Vec<f64> = (0..4000).map(|k| f64::from(k) * 1e-3).collect();
        let figures = |channel: &str, after| Residual {
            channel: channel.into(),
            unit: "N m".into(),
            fit_before: 0.0312,
            fit_after: after,
            check_before: 0.0312,
            check_after: after,
            check_signal: None,
            noise_floor: f64::NAN,
            whiteness: 0.94,
        };
        Report {
            verdict: "explained",
            summary: "What is named takes 99 %.".into(),
            said: Said {
                why: "What is named takes 99 %.".into(),
                untested: Some(Vec::new()),
                ..Said::default()
            },
            demo_seed: Some(358),
            refused: vec![crate::effects::refusals::Refusal {
                hypothesis: "lead_error".into(),
                place: "feed".into(),
                reason: "the table does not move far enough",
                trials: 12,
            }],
            effects: vec![cogging()],
            residual: vec![
                figures("nut torque", 0.0311),
                figures("screw torque", 0.0012),
            ],
            unexplained: vec![Left {
                channel: "nut torque".into(),
                coordinate: "time".into(),
                order: None,
                hz: Some(43.2),
                size: 1e-4,
                unit: "N m".into(),
                reason: "a <reason>".into(),
            }],
            calibration: Vec::new(),
            correction: None,
            derivatives: "without phase".into(),
            selection: Selection {
                rule: "a & b".into(),
                tried: 7,
                threshold: 100.0,
                measure: "fall",
                trials: Vec::new(),
            },
            simulation: Some(simulation()),
            stages: Vec::new(),
            records: vec![DataQuality {
                file: "a&b.csv".into(),
                rows: 10,
                used: 9,
                ..DataQuality::default()
            }],
            channels: channels(&time).into(),
            time,
            model: String::new(),
        }
    }

    fn cogging() -> Effect {
        Effect {
            kind: "cogging".into(),
            place: "screw".into(),
            order: Some(36.0),
            hz: None,
            parameters: BTreeMap::from([
                ("order".to_owned(), 36.0),
                ("amplitude".to_owned(), 0.0441),
            ]),
            interval: BTreeMap::from([("amplitude".to_owned(), [0.044, 0.0442])]),
            unit: BTreeMap::from([("amplitude".to_owned(), "N m".to_owned())]),
            explained: 0.97,
            held_back: vec![0.93, 0.99],
            candidates: &[],
            curve: None,
            shows: Some("screw torque".into()),
            not_separable: vec![Alias {
                kind: "flux_harmonic".into(),
                place: "screw".into(),
                parameters: BTreeMap::from([("order".to_owned(), 7.2)]),
                behind: 4.0,
                check_behind: -1.5,
            }],
            suggests: None,
        }
    }

    fn simulation() -> Simulation {
        Simulation {
            declared_rms_points: 3.5,
            new_rms_points: 0.25,
            holds: vec![Hold {
                start_s: 1.0,
                seconds: 1.0,
                table_mm_s: 2.5,
                nut_rpm: 300.0,
                measured_vrf_percent: 18.25,
                declared_vrf_percent: 14.75,
                new_vrf_percent: 18.5,
                spectra: [
                    vec![(1.0, 0.1), (2.0, 0.2)],
                    Vec::new(),
                    vec![(1.0, f64::NAN)],
                ],
            }],
        }
    }

    fn channels(time: &[f64]) -> [Channel; 2] {
        let angle: Vec<f64> = time.iter().map(|t| 20.0 * t).collect();
        let wave = |size: f64| {
            angle
                .iter()
                .map(|a| size * (36.0 * a).cos())
                .collect::<Vec<_>>()
        };
        let coordinate = |title: &str, folded, values: &[f64]| Coordinate {
            title: title.into(),
            folded,
            values: values.to_vec(),
        };
        ["nut torque", "screw torque"].map(|name| Channel {
            name: name.into(),
            unit: "N m".into(),
            residual: [wave(0.0441), wave(0.0001)],
            open: vec![true; 4000],
            turn: coordinate("Angle of the screw, turns", true, &angle),
            marks: vec![(36.0, "cogging".into())],
            over: vec![coordinate("Time, s", false, time)],
        })
    }

    /// A sentence, the figures before and after, and the picture come before all else.
    #[test]
    fn the_first_screen_answers() {
        let page = page(&report());
        page::check::sound(&page).unwrap();
        let first = &page[..page.find("<h2>").expect("a second part")];
        for answer in [
            "The screw\u{2019}s motor cogs 36 times a turn, by 44.1\u{A0}mN m.",
            "Screw torque residual",
            "31.2 \u{2192} 1.20\u{A0}mN m",
            "3.50 \u{2192} 0.25\u{A0}points",
            "36 \u{D7} cogging",
        ] {
            assert!(
                first.contains(answer),
                "`{answer}` is not on the first screen"
            );
        }
        assert_eq!(first.matches("<svg class=\"plot\"").count(), 2);
    }

    /// Scripts stand at the end, behind all that is there without them, and ask for nothing from outside.
    #[test]
    fn what_takes_a_script_is_beside_the_page() {
        let (page, live) = (page(&report()), live_page(&report()));
        let (rest, end) = page.split_at(page.rfind("</main>").unwrap());
        assert!(live.starts_with(rest) && live.ends_with(end));
        let added = &live[rest.len()..live.len() - end.len()];
        assert!(added.contains("hidden=\"hidden\"") && added.contains("@media print"));
        assert!(!added.contains("src=") && !added.contains("@import"));
        let data = added.split("id=\"live-data\">").nth(1).unwrap();
        let data: serde_json::Value =
            serde_json::from_str(data.split("</script>").next().unwrap()).unwrap();
        assert_eq!(data["time"].as_array().unwrap().len(), 4000);
        assert_eq!(data["channels"][0]["after"].as_array().unwrap().len(), 4000);
    }

    #[test]
    fn everything_else_is_there_and_escaped() {
        let page = page(&report());
        for part in [
            "a &#60;reason&#62;",
            "a &#38; b",
            "a&#38;b.csv",
            "<td>18.25</td><td>14.75</td><td>18.50</td>",
            "94 %",
            "93\u{A0}% to 99\u{A0}%",
            "not separable from Flux harmonic (screw), 7.2 times a turn: behind by 4.0",
            "without phase",
            // 36 periods a turn at 20 rad/s.
            "115 Hz",
            "Feed the opposite current forward over the mechanical angle",
            "<td>ripple 18.5 \u{2192} 14.75 %</td>",
            "rms over the rows",
            "--demo --seed 358",
            "would feed energy in",
            "<td>12</td><td class=\"long\">the table does not move far enough</td>",
        ] {
            assert!(page.contains(part), "`{part}` is not on the page");
        }
        let left = &page[page.find("without a cause</h2>").expect("the section")..];
        assert!(left[..300].contains("43.2") && !left[..300].contains("cogging"));
    }

    /// The verdict is the first word, and what the record does not excite stands beneath it.
    #[test]
    fn the_verdict_is_on_top() {
        let mut thin = report();
        let top = |report: &Report| page(report).split_once("<h1>").unwrap().1.to_owned();
        let first = top(&thin);
        assert!(first.starts_with("Explained: "), "{}", &first[..200]);
        let beneath = first
            .find("Not tested by this record: nothing.")
            .expect("the line");
        assert!(beneath < first.find("class=\"result\"").unwrap());
        thin.said.untested = Some(vec!["orders of the turn".into()]);
        thin.said.next = vec!["at least 1 turn".into()];
        thin.said.command = Some("ddfeed drive record".into());
        let first = top(&thin);
        assert!(first.contains("Not tested by this record: orders of the turn."));
        assert!(first.contains("<code>ddfeed drive record</code>"));
    }

    /// The first picture is of the channel that the sentence names, whichever fell most.
    #[test]
    fn the_picture_shows_what_the_sentence_names() {
        let mut named = report();
        let lead = |report: &Report| report.lead().unwrap().0.name.clone();
        assert_eq!(lead(&named), "screw torque");
        named.effects[0].shows = Some("nut torque".into());
        assert_eq!(lead(&named), "nut torque");
        assert!(page(&named).contains("Nut torque residual"));
        named.effects.clear();
        assert_eq!(lead(&named), "screw torque");
        named.said.channel = Some("nut torque");
        assert_eq!(lead(&named), "nut torque");
    }

    /// A model whose simulation is further from the record is not to be compensated with.
    #[test]
    fn a_model_that_is_further_off_promises_nothing() {
        let mut worse = report();
        let simulation = worse.simulation.as_mut().unwrap();
        (simulation.declared_rms_points, simulation.new_rms_points) = (11.78, 43.33);
        let page = page(&worse);
        let advice = &page[page.find("What to do</h2>").expect("the section")..];
        let advice = &advice[..advice.find("</section>").unwrap()];
        assert!(!advice.contains("<td>compensate</td>"), "{advice}");
        assert!(!advice.contains("<td>ripple") && !advice.contains("% of the residual"));
        assert!(advice.contains("11.78 \u{2192} 43.33 points"), "{advice}");
    }

    #[test]
    fn a_clean_machine_has_a_page_too() {
        let mut clean = report();
        clean.verdict = "nothing missing";
        clean.effects.clear();
        clean.unexplained.clear();
        clean
            .channels
            .iter_mut()
            .for_each(|channel| channel.marks.clear());
        clean.simulation = None;
        let page = page(&clean);
        page::check::sound(&page).unwrap();
        assert!(page.contains("<h1>Nothing missing</h1>"));
    }
}
