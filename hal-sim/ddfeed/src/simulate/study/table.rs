//! The result as a table on the terminal.

use super::report::Report;

/// Prints the ripple of each run.
pub fn print(report: &Report) {
    let setup = &report.setup;
    println!(
        "Velocity ripple factor (Eq 19) at {} mm/s, load {}, {} machine, {} sensors, {} s each\n",
        setup.table_mm_s, setup.load, setup.machine, setup.sensors, setup.record_s
    );
    println!(
        "{:>16} {:>11} {:>14} {:>16} {:>18}",
        "nut speed", "simulated", "after learning", "S(s), App. A", "paper, measured"
    );
    for run in &report.runs {
        let name = if run.nut_rpm == 0.0 {
            "CDFS, 0 rpm".to_owned()
        } else {
            format!("DDFS, {:.0} rpm", run.nut_rpm)
        };
        let percent = |value: Option<f64>, digits| {
            value.map_or("-".to_owned(), |value| format!("{value:.digits$} %"))
        };
        println!(
            "{name:>16} {:>9.2} % {:>14} {:>14.2} % {:>18}",
            run.vrf_percent,
            percent(run.learned_percent, 2),
            run.analytic_percent,
            percent(run.measured_percent, 1)
        );
    }
    if report.runs.iter().all(|run| run.learned_percent.is_none()) {
        println!("\nafter learning: only a board as it ships learns: give --board without --model");
    }
    println!(
        "\nS(s), App. A: the torque harmonics of the model through the speed loop. Without them it is 0. Encoders, friction and \
         load are not in it."
    );
}
