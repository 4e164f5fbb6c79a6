//! `sweep.html`: where CDFS beats DDFS and where not, as a page that stands alone.

use super::heat::{Verdict, cdfs, map, verdict, vrf};
use super::sweep_report::SweepReport;
use page::document::{document, escape, sentence, short, two};

/// The page.
pub(crate) fn page(report: &SweepReport) -> String {
    let body = format!(
        "<p class=\"result\">{}</p>\n<figure>\n<figcaption>VRF over table velocity and nut speed</figcaption>\n\
         <p class=\"note\">{} less ripple than CDFS at this table velocity; {} as much or more; heavy line: where the \
         one turns into the other</p>\n{}</figure>\n{}{}{}",
        sentence(&result(report)),
        LESS,
        MORE,
        map(report),
        compensated(report),
        table(report),
        foot(report),
    );
    document(
        "Where the differential feed is smoother, and where not",
        &body,
    )
}

/// The same map of the compensated drive, if there is one.
fn compensated(report: &SweepReport) -> String {
    report.compensated().map_or_else(String::new, |compensated| {
        format!(
            "<figure>\n<figcaption>The same with what the model says repeats compensated</figcaption>\n{}</figure>\n{}",
            map(&compensated),
            table(&compensated)
        )
    })
}

const LESS: &str = "\u{25BC}";
const MORE: &str = "\u{25B3}";

/// What the grid says, in a few sentences.
fn result(report: &SweepReport) -> String {
    let points = || {
        (0..report.table_mm_s.len())
            .flat_map(|row| (0..report.nut_rpm.len()).map(move |column| (row, column)))
    };
    let missing = points()
        .filter(|&(row, column)| vrf(report, row, column).is_none())
        .count();
    let unreached = match missing {
        0 => String::new(),
        n => format!(
            " The drive did not reach {n} of {} points of the grid.",
            points().count()
        ),
    };
    let compared: Vec<_> = points()
        .filter(|&(row, column)| verdict(report, row, column) != Verdict::Open)
        .collect();
    if compared.is_empty() {
        return format!("No point has both a CDFS and a DDFS result to compare.{unreached}");
    }
    let better =
        |&&(row, column): &&(usize, usize)| verdict(report, row, column) == Verdict::Better;
    let wins = compared.iter().filter(better).count();
    let gain = |&(row, column): &(usize, usize)| {
        let of = vrf(report, row, column).zip(cdfs(report, row));
        of.map_or(0.0, |(ddfs, cdfs)| 1.0 - ddfs / cdfs)
    };
    let best = compared
        .iter()
        .filter(better)
        .max_by(|a, b| gain(a).total_cmp(&gain(b)));
    let most = best.map_or_else(String::new, |&(row, column)| {
        format!(
            " The most it gains: {} % less at {} mm/s with the nut at {} rpm, {} % instead of {} %.",
            short((100.0 * gain(&(row, column))).round()),
            short(report.table_mm_s[row]),
            short(report.nut_rpm[column]),
            two(vrf(report, row, column)),
            two(cdfs(report, row)),
        )
    });
    let lost: Vec<_> = (0..report.table_mm_s.len())
        .filter(|row| compared.iter().any(|p| p.0 == *row))
        .filter(|row| !compared.iter().any(|p| p.0 == *row && better(&p)))
        .map(|row| short(report.table_mm_s[row]))
        .collect();
    let never = match (wins, lost.is_empty()) {
        (0, _) | (_, true) => String::new(),
        _ => format!(" At {} mm/s no nut speed beats CDFS.", lost.join(", ")),
    };
    let count = compared.len();
    let say = match wins {
        0 => format!("DDFS has less ripple than CDFS at none of the {count} points compared."),
        n if n == count => {
            format!("DDFS has less ripple than CDFS at all {count} points compared.")
        }
        n => format!("DDFS has less ripple than CDFS at {n} of {count} points compared."),
    };
    format!("{say}{most}{never}{unreached}")
}

fn table(report: &SweepReport) -> String {
    let heads: String = report
        .nut_rpm
        .iter()
        .map(|rpm| {
            let kind = if *rpm == 0.0 { " (CDFS)" } else { "" };
            format!("<th scope=\"col\">{}{kind}</th>", short(*rpm))
        })
        .collect();
    let rows: String = report
        .table_mm_s
        .iter()
        .enumerate()
        .map(|(row, speed)| {
            let cells: String = (0..report.nut_rpm.len())
                .map(|column| cell(report, row, column))
                .collect();
            format!("<tr><th scope=\"row\">{}</th>{cells}</tr>\n", short(*speed))
        })
        .collect();
    format!(
        "<h2>The same in numbers</h2>\n<p class=\"note\">VRF, %. Rows: table velocity, mm/s. Columns: nut speed, rpm.</p>\n\
         <div class=\"scroll\" role=\"region\" aria-label=\"Velocity ripple\" tabindex=\"0\">\n<table class=\"grid\">\n\
         <thead><tr><th scope=\"col\">mm/s</th>{heads}</tr></thead>\n<tbody>\n{rows}</tbody>\n\
         </table>\n</div>\n"
    )
}

fn cell(report: &SweepReport, row: usize, column: usize) -> String {
    let value = two(vrf(report, row, column));
    match verdict(report, row, column) {
        Verdict::Better => format!("<td class=\"better\">{value} {LESS}</td>"),
        Verdict::Worse => format!("<td class=\"worse\">{value} {MORE}</td>"),
        Verdict::Open => format!("<td>{value}</td>"),
    }
}

fn foot(report: &SweepReport) -> String {
    format!(
        "<footer>\n<h2>What was simulated</h2>\n<p>Machine: {}. Sensors: {}.</p>\n<p>VRF (Eq 19) is the peak-to-peak of \
         the table velocity over its reference, taken of the true velocity of the simulated table, with no scale and \
         no filter between. CDFS: the screw alone turns; DDFS: screw and nut turn, the table moves by the difference. A \
         dash: the drive did not reach the point.</p>\n</footer>\n",
        escape(&report.machine),
        escape(&report.sensors),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sweep(
        nut_rpm: &[f64],
        table_mm_s: &[f64],
        vrf_percent: Vec<Vec<Option<f64>>>,
    ) -> SweepReport {
        SweepReport {
            machine: "<m>".into(),
            sensors: "real".into(),
            table_mm_s: table_mm_s.into(),
            nut_rpm: nut_rpm.into(),
            vrf_percent,
            compensated_percent: None,
            proposed: Vec::new(),
        }
    }

    #[test]
    fn every_cell_is_on_the_page_with_its_verdict() {
        let rows = vec![
            vec![Some(21.2), Some(15.5), Some(6.3)],
            vec![Some(2.0), None, Some(3.456)],
        ];
        let page = page(&sweep(&[0.0, 300.0, 800.0], &[2.5, 50.0], rows));
        page::check::sound(&page).unwrap();
        let page = page.replace('\u{A0}', " ");
        assert!(
            page.contains("&lt;m&gt;"),
            "no {:?} in:\n{page}",
            "&lt;m&gt;"
        );
        for text in [
            "<td>21.20<",
            "<td class=\"better\">15.50 ",
            "<td class=\"better\">6.30 ",
            "<td>2.00<",
            "<td>\u{2013}<",
        ] {
            assert!(page.contains(text), "{text}");
        }
        assert!(
            page.contains("<td class=\"worse\">3.46 "),
            "no {:?} in:\n{page}",
            "<td class=\"worse\">3.46 "
        );
        assert!(
            page.contains("at 2 of 3 points")
                && page.contains("70 % less at 2.5 mm/s with the nut at 800 rpm"),
            "not 2 of 3 points, or not 70 % less in:\n{page}"
        );
        assert!(
            page.contains("At 50 mm/s no nut speed beats CDFS.")
                && page.contains("did not reach 1 of 6"),
            "no word of 50 mm/s, or of 1 of 6 in:\n{page}"
        );
        // In the picture too: the cells' values, two triangles down, one up, and the line between.
        let picture = &page[page.find("<svg").unwrap()..page.find("</svg>").unwrap()];
        for value in ["21.2", "15.5", "6.30", "2.00", "3.46"] {
            assert!(picture.contains(&format!(">\n{value}\n<")), "{value}");
        }
        assert_eq!(picture.matches("<polygon").count(), 2);
    }

    #[test]
    fn a_grid_with_holes_is_sound() {
        page::check::sound(&page(&sweep(&[], &[], Vec::new()))).unwrap();
        page::check::sound(&page(&sweep(
            &[0.0, 300.0],
            &[1.0, 2.0],
            vec![vec![None, Some(f64::NAN)], vec![Some(1.0)]],
        )))
        .unwrap();
        page::check::sound(&page(&sweep(&[300.0], &[1.0], vec![vec![Some(0.0)]]))).unwrap();
        let wide: Vec<f64> = (0..60).map(|k| f64::from(k) * 50.0).collect();
        let rows = wide
            .iter()
            .map(|t| wide.iter().map(|n| Some(1.0 + t * n)).collect())
            .collect();
        page::check::sound(&page(&sweep(&wide, &wide, rows))).unwrap();
    }

    #[test]
    fn a_tie_is_no_win() {
        assert!(
            result(&sweep(
                &[0.0, 300.0],
                &[1.0],
                vec![vec![Some(5.0), Some(5.0)]]
            ))
            .contains("at none of the 1 points")
        );
    }
}
