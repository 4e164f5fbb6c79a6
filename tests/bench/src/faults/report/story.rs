//! Scenarios, pairs of faults and long runs.

use super::board_name;
use crate::faults::{
    Drives, Hazard, Matrix, Outcome, Pair, Scenario, Soaked, Steady, Story, healthy, run_scenario,
    soak,
};
use anyhow::Result;
use hal_sim::boards::BoardKind;
use hal_sim::experiment::ExperimentError;
use hal_sim::parallel::on_all_cores;
use page::axis::Axis;
use page::chart::{COOL, Chart, Mark, REFERENCE, Series, THIRD, WARM, chart};
use page::document::legend;
use page::markup::Markup;
use serde::Serialize;
use std::collections::BTreeMap;

const BOARDS: [BoardKind; 2] = [BoardKind::Nucleo, BoardKind::Mains];

/// A scenario on a board.
#[derive(Serialize)]
pub(super) struct Told {
    board: &'static str,
    scenario: &'static str,
    travel_mm: f64,
    travel_limit_mm: f64,
    peak_a: f64,
    peak_limit_a: f64,
    bus_v: f64,
    bus_limit_v: f64,
    end_stop_n: f64,
    end_stop_limit_n: f64,
    seconds: f64,
    state: &'static str,
    first_cause: Option<&'static str>,
    within: bool,
    #[serde(skip)]
    story: Story,
}

/// All scenarios on both boards.
pub(super) fn scenarios() -> Result<Vec<Told>> {
    let all: Vec<_> = BOARDS
        .into_iter()
        .flat_map(|board| Scenario::ALL.map(|scenario| (board, scenario)))
        .collect();
    let stories = on_all_cores(&all, |(board, scenario)| run_scenario(*board, *scenario));
    all.into_iter()
        .zip(stories)
        .map(|((board, scenario), story)| {
            let story = story?;
            Ok(Told {
                board: board_name(board),
                scenario: scenario.name(),
                travel_mm: 1e3 * story.travel_m,
                travel_limit_mm: 1e3 * story.travel_max_m,
                peak_a: story.peak_a,
                peak_limit_a: story.peak_max_a,
                bus_v: story.bus_v,
                bus_limit_v: story.bus_max_v,
                end_stop_n: story.end_force_n,
                end_stop_limit_n: story.end_force_max_n,
                seconds: story.seconds,
                state: story.state.name(),
                first_cause: super::cause(story.state),
                within: story.within(),
                story,
            })
        })
        .collect()
}

pub(super) fn tell_scenarios(all: &[Told]) {
    for t in all {
        println!(
            "{:<14} {:<38} {:>7.2} mm (limit {}) {:>6.2} A ({:.1}) {:>6.1} V ({:.0}) {:>5.0} N ({:.0}) {:>6.2} s  {}{}",
            t.board,
            t.scenario,
            t.travel_mm,
            t.travel_limit_mm,
            t.peak_a,
            t.peak_limit_a,
            t.bus_v,
            t.bus_limit_v,
            t.end_stop_n,
            t.end_stop_limit_n,
            t.seconds,
            t.first_cause.unwrap_or(t.state),
            if t.within { "" } else { "  PAST A LIMIT" }
        );
    }
}

/// Longest that a plot goes on after the event, s: what comes later is slow.
const PLOTTED_S: f64 = 3.0;

impl Told {
    pub(super) fn heading(&self) -> String {
        format!("{}, {}", self.scenario, self.board)
    }

    /// How it ended, and how far it was from each limit.
    pub(super) fn sentence(&self) -> String {
        format!(
            "Ended as: {}. Table {:.2} mm (limit {}), current {:.2} A ({:.1}), bus {:.1} V ({:.0}), end stop {:.0} N ({:.0}){}. \
             Watched for {:.1} s.",
            self.first_cause.unwrap_or(self.state),
            self.travel_mm,
            self.travel_limit_mm,
            self.peak_a,
            self.peak_limit_a,
            self.bus_v,
            self.bus_limit_v,
            self.end_stop_n,
            self.end_stop_limit_n,
            if self.within { "" } else { ": past a limit" },
            self.seconds
        )
    }

    /// Its plots in time.
    pub(super) fn plots(&self) -> Vec<Markup> {
        let points = &self.story.points;
        let shown = points.iter().take_while(|p| p.seconds <= PLOTTED_S).count();
        let points = &points[..shown];
        let line = |color, of: &dyn Fn(&crate::faults::Point) -> f64| Series {
            points: points.iter().map(|p| (p.seconds, of(p))).collect(),
            color,
            mark: LINE,
        };
        let end = points.last().map_or(1.0, |p| p.seconds);
        let plot = |(about, unit, series): (&str, &str, Vec<Series>)| {
            let values = series.iter().flat_map(|s| s.points.iter().map(|(_, y)| *y));
            let (least, most) = values.fold((0.0f64, 0.0f64), |(a, b), y| (a.min(y), b.max(y)));
            chart(&Chart {
                about,
                x: Axis {
                    title: "s after the event",
                    range: Some(0.0..end),
                    log: false,
                },
                y: Axis {
                    title: unit,
                    range: Some(least * 1.05..most.max(1e-3) * 1.05),
                    log: false,
                },
                series,
                labels: Vec::new(),
            })
        };
        [
            (
                "Table",
                "table, mm",
                vec![line(COOL, &|p| 1e3 * p.travel_m)],
            ),
            (
                "Speeds of screw and nut",
                "shafts, rpm",
                vec![line(WARM, &|p| p.rpm[0]), line(COOL, &|p| p.rpm[1])],
            ),
            (
                "Largest phase currents of screw and nut",
                "phase currents, A",
                vec![
                    line(WARM, &|p| p.peak_a[0]),
                    line(COOL, &|p| p.peak_a[1]),
                    line(REFERENCE, &|_| self.peak_limit_a),
                ],
            ),
            (
                "Bus",
                "bus, V",
                vec![
                    line(THIRD, &|p| p.bus_v),
                    line(REFERENCE, &|_| self.bus_limit_v),
                ],
            ),
        ]
        .into_iter()
        .map(plot)
        .collect()
    }
}

const LINE: Mark = Mark::Line(1.5);

/// The key of the plots.
pub(super) fn key() -> Markup {
    legend(&[
        (WARM, LINE, "screw".into()),
        (COOL, LINE, "nut; the table".into()),
        (THIRD, LINE, "bus".into()),
        (REFERENCE, LINE, "limit".into()),
    ])
}

/// Pairs of faults.
#[derive(Default, Serialize)]
pub(super) struct Pairs {
    pairs: usize,
    #[serde(rename = "unsafe")]
    hazardous: usize,
    over_current: usize,
    travel: usize,
    wrong_cause: usize,
    travel_mm_worst: f64,
    overcurrent_periods_worst: f64,
    unsafe_pairs: Vec<String>,
}

pub(super) fn pairs(count: usize, seed: u64, drives: Drives) -> Result<Pairs> {
    let drawn = Pair::drawn(count, seed);
    let matrix = Matrix::of_pairs(&drawn, drives)?;
    let outcomes = on_all_cores(&drawn, |pair| matrix.run_pair(pair));
    let outcomes: Vec<Outcome> = outcomes.into_iter().collect::<Result<_, _>>()?;
    let of = |hazard: Hazard| {
        let has = outcomes.iter().filter(|o| o.hazards.contains(&hazard));
        has.count()
    };
    let unsafe_pairs: Vec<String> = drawn
        .iter()
        .zip(&outcomes)
        .filter(|(_, outcome)| !outcome.hazards.is_empty())
        .map(|(pair, outcome)| {
            let by: Vec<_> = outcome.hazards.iter().map(|h| h.name()).collect();
            format!(
                "{}: {}: {:.1} mm, {:.1} periods, {}",
                pair.name(),
                by.join(", "),
                1e3 * outcome.travel_m,
                outcome.over_current_periods,
                super::cause(outcome.state).unwrap_or(outcome.state.name())
            )
        })
        .collect();
    let worst = |value: fn(&Outcome) -> f64| outcomes.iter().map(value).fold(0.0, f64::max);
    Ok(Pairs {
        pairs: drawn.len(),
        hazardous: unsafe_pairs.len(),
        over_current: of(Hazard::OverCurrent),
        travel: of(Hazard::Travel),
        wrong_cause: of(Hazard::WrongCause),
        travel_mm_worst: 1e3 * worst(|o| o.travel_m),
        overcurrent_periods_worst: worst(|o| o.over_current_periods),
        unsafe_pairs,
    })
}

pub(super) fn tell_pairs(p: &Pairs) {
    for pair in &p.unsafe_pairs {
        println!("{pair}");
    }
    println!(
        "{} pairs of faults: {} unsafe: {} by over-current, {} by travel, {} by a wrong cause; worst travel {:.1} mm, worst \
         over-current {:.1} periods",
        p.pairs,
        p.hazardous,
        p.over_current,
        p.travel,
        p.wrong_cause,
        p.travel_mm_worst,
        p.overcurrent_periods_worst
    );
}

/// A long run on a board.
#[derive(Serialize)]
pub(super) struct Long {
    board: &'static str,
    kind: &'static str,
    simulated_s: f64,
    commands: u32,
    faults_put_in: u32,
    stopped_by: BTreeMap<&'static str, u32>,
    stuck: u32,
    overcurrent_periods_worst: f64,
    overcurrents: u32,
}

/// A run of a board for so many seconds, from a seed.
type LongRun = fn(BoardKind, Drives, f64, u64) -> Result<Soaked, ExperimentError>;

/// Each kind that is asked, on both boards, for so many seconds.
pub(super) fn long_runs(
    of_healthy: Option<f64>,
    of_faults: Option<f64>,
    drives: Drives,
) -> Result<Vec<Long>> {
    let kinds: [(&'static str, LongRun, Option<f64>); 2] = [
        ("healthy", healthy, of_healthy),
        ("faults and resets", soak, of_faults),
    ];
    let mut all = Vec::new();
    for (name, run, seconds) in kinds {
        for board in BOARDS {
            all.extend(seconds.map(|seconds| (board, name, run, seconds)));
        }
    }
    let soaked = on_all_cores(&all, |(board, _, run, seconds)| {
        run(*board, drives, *seconds, 1)
    });
    all.into_iter()
        .zip(soaked)
        .map(|((board, kind, ..), soaked)| {
            let Soaked {
                seconds,
                commands,
                faults,
                stopped,
                stuck,
                over_current_periods,
                over_currents,
            } = soaked?;
            Ok(Long {
                board: board_name(board),
                kind,
                simulated_s: seconds,
                commands,
                faults_put_in: faults,
                stopped_by: stopped,
                stuck,
                overcurrent_periods_worst: over_current_periods,
                overcurrents: over_currents,
            })
        })
        .collect()
}

pub(super) fn tell_soaks(all: &[Long]) {
    for l in all {
        println!(
            "{}, {}: {:.0} s simulated, {} commands, {} faults put in; not ready again after {}; above the current limit for \
             longer than a period {} times; stopped by {:?}",
            l.board,
            l.kind,
            l.simulated_s,
            l.commands,
            l.faults_put_in,
            l.stuck,
            l.overcurrents,
            l.stopped_by
        );
    }
}

/// A steady run.
#[derive(Serialize)]
pub(super) struct SteadyRow {
    board: &'static str,
    nut_rpm: f64,
    load_of_rated: f64,
    seconds: f64,
    stopped_by: Option<&'static str>,
    stopped_after_s: Option<f64>,
}

/// Steady running of so many seconds at each of the common speeds and loads.
pub(super) fn steady(seconds: Option<f64>, drives: Drives) -> Result<Vec<SteadyRow>> {
    let Some(seconds) = seconds else {
        return Ok(Vec::new());
    };
    let all = Steady::all();
    let ran = on_all_cores(&all, |steady| steady.run(drives, seconds, 1));
    all.into_iter()
        .zip(ran)
        .map(|(steady, stopped)| {
            let stopped = stopped?;
            Ok(SteadyRow {
                board: board_name(steady.board),
                nut_rpm: steady.nut_rpm,
                load_of_rated: steady.load,
                seconds,
                stopped_by: stopped.map(|(fault, _)| fault.name()),
                stopped_after_s: stopped.map(|(_, after)| after),
            })
        })
        .collect()
}

pub(super) fn tell_steady(rows: &[SteadyRow]) {
    for row in rows {
        println!(
            "{}, nut at {} rpm, {} of the rated torque, {} s: {}",
            row.board,
            row.nut_rpm,
            row.load_of_rated,
            row.seconds,
            row.stopped_by.unwrap_or("no fault")
        );
    }
}
