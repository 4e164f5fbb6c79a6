//! Disturbance observer, notch, and a base speed that wanders, on the machine with an elastic screw.

use bench::smooth::bench::{Change, robustness_with};
use bench::smooth::rejection::{LoadStep, Rejection, load_step, wandering};
use bench::smooth::reversal::{Reversal, reversal};
use hal_sim::parallel::on_all_cores;

/// A PI leaves the table pushed by the step's current over its integral gain; an observer is a second integrator, and brings it back.
#[test]
fn a_step_of_load_is_brought_back_and_does_not_ring() {
    for rpm in [0.0, 800.0] {
        let steps = on_all_cores(&Rejection::ALL, |&rejection| {
            load_step(rejection, rpm).unwrap()
        });
        for (rejection, step) in Rejection::ALL.iter().zip(&steps) {
            println!("nut {rpm} rpm, {}: {step:.5?}", rejection.name());
        }
        let [pi, notch, _, both]: [LoadStep; 4] = steps.clone().try_into().unwrap();
        assert!(
            both.pushed_um < 0.85 * pi.pushed_um && both.left_um.abs() < 0.2 * pi.left_um.abs(),
            "nut {rpm} rpm: with observer and notch the table is pushed by {:.1} um, {:.1} are left; with the PI by {:.1}, {:.1} \
             are left; expected less than 0.85 and 0.2 of them",
            both.pushed_um,
            both.left_um,
            pi.pushed_um,
            pi.left_um
        );
        // The observer's own stretching of the screw, slower than its mode, is in it.
        for (rejection, step) in Rejection::ALL.iter().zip(&steps) {
            assert!(
                step.ringing_mm_s < 0.01 * step.velocity_mm_s,
                "nut {rpm} rpm, {}: the screw is stretched by {} mm/s rms after a step of {} mm/s, expected less than 1 % of it",
                rejection.name(),
                step.ringing_mm_s,
                step.velocity_mm_s
            );
        }
        assert!(
            notch.ringing_mm_s < 0.8 * pi.ringing_mm_s,
            "nut {rpm} rpm: {} mm/s rms with a notch, {} without, expected less than 0.8 of it",
            notch.ringing_mm_s,
            pi.ringing_mm_s
        );
    }
}

/// Friction that nobody knows, or that was told wrongly, is found after the reversal; what is known need not be found.
#[test]
fn friction_that_is_not_known_is_observed() {
    for rpm in [0.0, 800.0] {
        let Reversal {
            pi,
            known,
            off,
            observed,
        } = reversal(rpm).unwrap();
        println!("nut {rpm} rpm: PI {pi:.2}, known {known:.2}, {off:.2?}, observed {observed:.2?}");
        let [unknown, less, right, more] = observed;
        for (what, with, without, part) in [
            ("unknown", unknown, pi, 0.85),
            ("told 30 % less", less, off[0], 0.7),
            ("told 30 % more", more, off[1], 0.7),
            ("known", right, known, 2.0),
        ] {
            assert!(
                with < part * without,
                "nut {rpm} rpm, friction {what}: {with:.1} % with an observer, {without:.1} % without; expected less than {part} of it"
            );
        }
    }
}

/// A wander takes the ripple off the resonance for most of the time, so its rms falls; its peaks come whenever it passes. With
/// the compensation there is nothing left to take away.
#[test]
fn a_wander_takes_the_rms_of_a_resonance_and_not_its_peaks() {
    let cases = [(0.0, false), (100.0, false), (0.0, true), (100.0, true)];
    // Order 30 of the nut on the table's resonance.
    let left = on_all_cores(&cases, |&(wander, ours)| {
        wandering(1006.0, wander, ours).unwrap()
    });
    for ((wander, ours), left) in cases.iter().zip(&left) {
        println!(
            "wander {wander} rpm, compensated {ours}: {:.2} %, rms {:.3} %",
            left.vrf, left.rms
        );
    }
    let [still, wanders, ours, both] = [0, 1, 2, 3].map(|k: usize| left[k]);
    assert!(
        wanders.rms < 0.85 * still.rms,
        "{:.2} % rms with a wander, {:.2} % without; expected less than 0.85 of it",
        wanders.rms,
        still.rms
    );
    assert!(
        both.vrf < 1.25 * ours.vrf,
        "{:.2} % with compensation and a wander, {:.2} % without the wander; expected less than 1.25 of it",
        both.vrf,
        ours.vrf
    );
}

#[test]
fn observer_and_notch_are_stable_where_the_drive_was_told_wrongly() {
    let changes = [
        Change::None,
        Change::Inertia(30),
        Change::Inertia(-30),
        Change::AxialMode,
    ];
    let results = on_all_cores(&changes, |&change| {
        robustness_with(change, Rejection::Both.plate())
    });
    for (change, [pi, ours]) in changes.iter().zip(results) {
        println!("{}: PI {pi:.2?} %, ours {ours:.2?} %", change.name());
        assert!(
            ours.is_some_and(|ours| ours < 1.0),
            "{}: {ours:.2?} % left, expected less than 1 %",
            change.name()
        );
    }
}
