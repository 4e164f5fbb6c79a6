//! Which of the probes that are there.

use anyhow::{Result, bail};
use std::fmt::Display;

/// The probe whose line has `wanted` in it, or the only one.
///
/// # Errors
/// There is none, or more than one: a list of them.
pub fn choose<'p, P: Display>(probes: &'p [P], wanted: Option<&str>) -> Result<&'p P> {
    let list = |probes: &[&P]| {
        let lines: Vec<String> = probes.iter().map(|probe| format!("\n  {probe}")).collect();
        lines.concat()
    };
    let all: Vec<&P> = probes.iter().collect();
    if all.is_empty() {
        bail!(
            "no debug probe found: connect the board's ST-LINK by USB; on Linux the udev rules of probe-rs must let this \
             user open it"
        );
    }
    let wanted_line = |probe: &&&P| {
        let line = probe.to_string().to_lowercase();
        wanted.is_none_or(|wanted| line.contains(&wanted.to_lowercase()))
    };
    let matching: Vec<&P> = all.iter().filter(wanted_line).copied().collect();
    match (&matching[..], wanted) {
        ([one], _) => Ok(one),
        ([], Some(wanted)) => bail!(
            "none of the debug probes has `{wanted}` in its line; there is:{}",
            list(&all)
        ),
        (more, _) => bail!(
            "{} debug probes match, and one is needed: name it with --probe, by its serial number or another part of its \
             line:{}",
            more.len(),
            list(more)
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO: [&str; 2] = [
        "STLink V3 -- 0483:374e:0041002D (ST-LINK)",
        "STLink V3 -- 0483:374e:00320041 (ST-LINK)",
    ];

    fn refused(probes: &[&str], wanted: Option<&str>) -> String {
        choose(probes, wanted).unwrap_err().to_string()
    }

    #[test]
    fn the_only_probe_or_the_named_one_is_taken() {
        assert_eq!(choose(&TWO[..1], None).unwrap(), &TWO[0]);
        assert_eq!(choose(&TWO, Some("0041002d")).unwrap(), &TWO[0]);
        assert_eq!(choose(&TWO, Some("00320041")).unwrap(), &TWO[1]);
    }

    #[test]
    fn none_several_and_a_wrong_name_are_said_in_a_sentence() {
        assert!(
            refused(&[], None).starts_with("no debug probe found"),
            "{}",
            refused(&[], None)
        );
        assert!(
            refused(&[], Some("x")).starts_with("no debug probe found"),
            "{}",
            refused(&[], Some("x"))
        );
        let two = refused(&TWO, None);
        assert!(two.starts_with("2 debug probes match"), "{two}");
        assert!(TWO.iter().all(|line| two.contains(line)), "{two}");
        // Part of both lines.
        assert!(
            refused(&TWO, Some("0041")).contains("--probe"),
            "no --probe in: {}",
            refused(&TWO, Some("0041"))
        );
        let wrong = refused(&TWO, Some("J-Link"));
        assert!(
            wrong.contains("`J-Link`") && wrong.contains(TWO[1]),
            "{wrong}"
        );
    }
}
