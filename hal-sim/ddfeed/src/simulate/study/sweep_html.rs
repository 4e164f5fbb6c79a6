//! `sweep.html`: where CDFS beats DDFS and where not, as a page that stands alone.

use super::heat::{Verdict, cdfs, map, verdict, vrf};
use super::sweep_report::SweepReport;
use crate::simulate::proposal::RULE;
use askama::Template;
use page::document::{document, sentence, short, two};
use page::markup::Markup;
use page::table::{Kind, table};

/// The page.
pub(crate) fn page(report: &SweepReport) -> String {
    let compensated = report.compensated();
    let caption = report.compensated_title();
    let mut maps = vec![(report, "VRF over table velocity and nut speed")];
    if let Some(compensated) = &compensated {
        maps.push((compensated, &caption));
    }
    let result = &result(report);
    document(
        "Where the differential feed is smoother, and where not",
        &Body {
            report,
            result,
            maps,
        },
    )
}

#[derive(Template)]
#[template(path = "sweep.html")]
struct Body<'a> {
    report: &'a SweepReport,
    result: &'a str,
    maps: Vec<(&'a SweepReport, &'a str)>,
}

const LESS: &str = "\u{25BC}";
const MORE: &str = "\u{25B3}";

/// The nut speeds that are proposed.
fn proposals(report: &SweepReport) -> Markup {
    let columns = [
        ("Table velocity, mm/s", Kind::Number),
        ("Nut speed, rpm", Kind::Number),
        ("VRF, %", Kind::Number),
        ("Loss, W", Kind::Number),
    ];
    let rows = report.proposed.iter().map(|one| {
        let choice = &one.choice;
        [
            short(one.table_mm_s),
            short(choice.nut_rpm),
            two(Some(choice.vrf_percent)),
            two(choice.loss_w),
        ]
    });
    table("Proposed nut speeds", columns, rows)
}

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
            loss_w: Vec::new(),
            learned: false,
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
            page.contains("&#60;m&#62;"),
            "no {:?} in:\n{page}",
            "&#60;m&#62;"
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
