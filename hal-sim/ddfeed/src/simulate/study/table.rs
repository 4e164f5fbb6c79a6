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
        "{:>16} {:>11} {:>16} {:>18}",
        "nut speed", "simulated", "S(s), App. A", "paper, measured"
    );
    for run in &report.runs {
        let name = if run.nut_rpm == 0.0 {
            "CDFS, 0 rpm".to_owned()
        } else {
            format!("DDFS, {:.0} rpm", run.nut_rpm)
        };
        let measured = run
            .measured_percent
            .map_or("-".to_owned(), |m| format!("{m:.1} %"));
        println!(
            "{name:>16} {:>9.2} % {:>14.2} % {measured:>18}",
            run.vrf_percent, run.analytic_percent
        );
    }
}
