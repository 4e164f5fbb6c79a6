//! Commissioning of simulated drives over their link, from cold.

use commission::{Session, electrical, mechanical};
use hal_sim::alignment::Start;
use hal_sim::served::{Serving, SimulatedDrive, Within};
use link::host::client::Client;
use std::cell::RefCell;
use std::f64::consts::TAU;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A session with the cold drive of `start`, within the program.
fn session(start: &Start) -> Session<Within> {
    let drive = SimulatedDrive::cold(start).unwrap();
    let serving = Rc::new(RefCell::new(Serving::new(drive)));
    let client = Client::open(Within::open(&serving)).unwrap();
    Session::open(client, Arc::new(AtomicBool::new(false))).unwrap()
}

/// A machine whose plate is wrong by a fifth in what is electrical, by a half in its inertia.
fn rough(seed: u64) -> Start {
    let mut start = Start::drawn(seed);
    for (k, motor) in start.plate.motors.iter_mut().enumerate() {
        motor.resistance_ohm *= [1.2, 0.8][k];
        motor.inductance_h *= [0.8, 1.2][k];
        motor.flux_wb *= [0.9, 1.1][k];
        motor.inertia_kg_m2 *= [1.5, 0.6][k];
    }
    start
}

#[test]
fn a_cold_drive_measures_its_machine_within_five_percent() {
    let start = rough(3);
    let mut session = session(&start);
    session.ready().unwrap();
    session.arm().unwrap();
    let electrical = electrical::measure(&mut session, 1e-4, &mut |_| ()).unwrap();
    let settings = electrical.applied(session.settings());
    session.configure(&settings).unwrap();
    session.arm().unwrap();
    let mechanical = mechanical::measure(&mut session, 10e-3, &mut |_| ()).unwrap();

    let model = &start.model;
    let r = model.feed.lead_m / TAU;
    let table = model.feed.table_mass_kg * r * r;
    for (k, (name, motor)) in [("screw", &model.screw), ("nut", &model.nut)]
        .into_iter()
        .enumerate()
    {
        let (found, moved) = (&electrical.motors[k], mechanical.moved_kg_m2()[k]);
        for (what, measured, truth) in [
            (
                "resistance, ohm",
                found.resistance_ohm,
                motor.resistance_ohm,
            ),
            ("inductance, H", found.inductance_h, motor.inductance_h),
            ("flux, Wb", found.flux_wb, motor.flux_wb),
            ("inertia, kg m^2", moved, motor.inertia_kg_m2 + table),
            (
                "Coulomb friction, N m",
                mechanical.motors[k].coulomb_nm,
                motor.coulomb_nm,
            ),
        ] {
            let off = measured.value / truth - 1.0;
            assert!(
                off.abs() < 0.05,
                "{name}: {what}: measured {measured:?}, true {truth}, {:.1} % off",
                1e2 * off
            );
        }
        let bound = electrical.current_a[k];
        assert!(bound.is_kept(), "{name}: current {bound:?}");
        let bound = mechanical.torque_nm[k];
        assert!(bound.is_kept(), "{name}: torque {bound:?}");
    }
    let off = mechanical.lead_m.value / model.feed.lead_m - 1.0;
    assert!(
        off.abs() < 0.01,
        "lead {:?}, true {}",
        mechanical.lead_m,
        model.feed.lead_m
    );
    for bound in [electrical.travel_m, mechanical.travel_m] {
        assert!(bound.is_kept(), "travel {bound:?}");
    }
}
