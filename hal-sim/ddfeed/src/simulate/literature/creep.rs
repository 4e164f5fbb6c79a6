//! The lowest velocity at which the table moves and does not stick, by single and double drive, under LuGre friction.

use super::stick_slip::critical_velocity;
use anyhow::Result;
use hal_sim::experiment::{
    ExperimentError, OperatingPoint, RPM, Setup, driven, record_periods, settle_quietly,
    table_velocities,
};
use hal_sim::parallel::on_all_cores;
use hal_sim::plates::PAPER_TUNING;
use hal_sim::vrf::vrf_percent;
use plant::effects::{EffectModel, Place, StribeckFriction};
use plant::machine::Coupling;
use plant::model::Model;
use serde::Serialize;

/// Cutoff of a speed loop that friction can upset, rad/s.
const SLOW_RAD_S: f64 = 50.0;
/// Nut speeds, rpm.
const NUT_RPM: [f64; 4] = [0.0, 30.0, 100.0, 300.0];
/// Speed of the table at which what sticks has fallen to 1/e, m/s.
const STRIBECK_M_S: f64 = 2e-4;
/// Travel over which friction is elastic, m.
const PRESLIDING_M: f64 = 2e-6;
/// What sticks beyond Coulomb's friction, of it: at the bearings and at the guideway.
const STICKS: [f64; 2] = [1.0, 0.5];
/// Ripple of a motion that counts as stable, peak to peak, %.
const RIPPLE_PERCENT: f64 = 25.0;
/// Fastest velocity, m/s; how many to a decade; how many in all.
const FASTEST_M_S: f64 = 1e-2;
const A_DECADE: u32 = 5;
const VELOCITIES: u32 = 16;
/// Steps of the bisection between the last stable velocity and the first that is not.
const BISECTIONS: u32 = 5;

/// The lowest stable velocities.
#[derive(Debug, Serialize)]
pub struct CreepReport {
    /// Friction and tuning.
    pub friction: FrictionReport,
    /// Ripple that counts as stable, %.
    pub ripple_percent: f64,
    /// Velocity below which the single drive sticks and slips, mm/s, by the linearised loop; none if it does not.
    pub critical_mm_s: Option<f64>,
    /// The drives.
    pub cases: Vec<CreepCase>,
}

/// The friction of the machine.
#[derive(Debug, Serialize)]
pub struct FrictionReport {
    /// Coulomb level of each bearing, N m, and of the pair.
    pub bearing_nm: f64,
    /// The pair's, N m.
    pub pair_nm: f64,
    /// The guideway's, N.
    pub guideway_n: f64,
    /// What sticks beyond, of it: bearings, guideway.
    pub sticks: [f64; 2],
    /// Stribeck speed, mm/s of the table.
    pub stribeck_mm_s: f64,
    /// Presliding, um of the table.
    pub presliding_um: f64,
}

/// One drive.
#[derive(Debug, Serialize)]
pub struct CreepCase {
    /// Nut speed, rpm; 0 is CDFS.
    pub nut_rpm: f64,
    /// Cutoff of its speed loops, rad/s.
    pub speed_rad_s: f64,
    /// The lowest velocity above which all that were tried are stable, mm/s; none if the fastest is not.
    pub lowest_mm_s: Option<f64>,
    /// What was tried.
    pub points: Vec<CreepPoint>,
}

/// One velocity.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct CreepPoint {
    /// Asked velocity, mm/s.
    pub mm_s: f64,
    /// Ripple, peak to peak, %; none where the drive did not reach the velocity.
    pub vrf_percent: Option<f64>,
    /// The slowest of the record, mm/s.
    pub slowest_mm_s: Option<f64>,
    /// The table never stops, and ripples by less than the bound.
    pub stable: bool,
}

/// The coupled machine with friction that sticks and nothing else that ripples, without a load.
pub fn sticking() -> Model {
    let mut model = Model::coupled();
    model.screw.torque_harmonics.clear();
    model.nut.torque_harmonics.clear();
    let feed = &mut model.feed;
    feed.load_n = 0.0;
    feed.presliding_m = PRESLIDING_M;
    let [bearing, guideway] = STICKS;
    let at_motors = StribeckFriction {
        amplitude: bearing * model.screw.coulomb_nm,
        speed: STRIBECK_M_S / feed.travel_per_radian(),
    };
    let at_feed = StribeckFriction {
        amplitude: guideway * feed.guideway_coulomb_n,
        speed: STRIBECK_M_S,
    };
    model
        .effects
        .extend(EffectModel::new(Place::Both, at_motors));
    model.effects.extend(EffectModel::new(Place::Feed, at_feed));
    model
}

/// A drive of that machine with ideal sensors.
pub fn setup(seed: u64, speed_rad_s: f64) -> Setup {
    let mut setup = Setup::ideal(sticking(), Coupling::Coupled);
    setup.board.seed = seed;
    setup.tuning.speed_rad_s = speed_rad_s;
    setup
}

/// Searches all cases.
pub fn run(seed: u64) -> Result<CreepReport> {
    let slow = NUT_RPM.map(|nut_rpm| (nut_rpm, SLOW_RAD_S));
    let mut cases = slow.to_vec();
    cases.extend([0.0, 300.0].map(|nut_rpm| (nut_rpm, PAPER_TUNING.speed_rad_s)));
    let cases = on_all_cores(&cases, |&(nut_rpm, speed_rad_s)| {
        search(&setup(seed, speed_rad_s), nut_rpm)
    });
    let (model, critical) = (sticking(), critical_velocity(&setup(seed, SLOW_RAD_S)));
    Ok(CreepReport {
        friction: FrictionReport {
            bearing_nm: model.screw.coulomb_nm,
            pair_nm: model.feed.pair_coulomb_nm,
            guideway_n: model.feed.guideway_coulomb_n,
            sticks: STICKS,
            stribeck_mm_s: 1e3 * STRIBECK_M_S,
            presliding_um: 1e6 * PRESLIDING_M,
        },
        ripple_percent: RIPPLE_PERCENT,
        critical_mm_s: critical.map(|velocity| 1e3 * velocity),
        cases: cases.into_iter().collect::<Result<_, _>>()?,
    })
}

/// Goes down in velocity, then bisects the step in which the motion stops being stable.
fn search(setup: &Setup, nut_rpm: f64) -> Result<CreepCase, ExperimentError> {
    let mut points = Vec::new();
    for k in 0..VELOCITIES {
        let velocity = FASTEST_M_S * 10f64.powf(-f64::from(k) / f64::from(A_DECADE));
        points.push(point(setup, nut_rpm, velocity)?);
    }
    let first = points.iter().position(|point| !point.stable);
    let lowest_mm_s = match first {
        None => points.last().map(|point| point.mm_s),
        Some(0) => None,
        Some(first) => {
            let (mut stable, mut other) = (points[first - 1].mm_s, points[first].mm_s);
            for _ in 0..BISECTIONS {
                let middle = point(setup, nut_rpm, 1e-3 * (stable * other).sqrt())?;
                *(if middle.stable {
                    &mut stable
                } else {
                    &mut other
                }) = middle.mm_s;
                points.push(middle);
            }
            Some(stable)
        }
    };
    points.sort_by(|a, b| a.mm_s.total_cmp(&b.mm_s));
    Ok(CreepCase {
        nut_rpm,
        speed_rad_s: setup.tuning.speed_rad_s,
        lowest_mm_s,
        points,
    })
}

/// The motion at one velocity, m/s.
fn point(setup: &Setup, nut_rpm: f64, velocity: f64) -> Result<CreepPoint, ExperimentError> {
    let at = OperatingPoint {
        velocity,
        base: nut_rpm * RPM,
    };
    let none = CreepPoint {
        mm_s: 1e3 * velocity,
        vrf_percent: None,
        slowest_mm_s: None,
        stable: false,
    };
    match velocities(setup, at) {
        Ok(velocities) => {
            let ripple = vrf_percent(&velocities, velocity);
            let slowest = velocities.iter().copied().fold(f64::INFINITY, f64::min);
            Ok(CreepPoint {
                vrf_percent: Some(ripple),
                slowest_mm_s: Some(1e3 * slowest),
                stable: slowest > 0.0 && ripple < RIPPLE_PERCENT,
                ..none
            })
        }
        Err(ExperimentError::NotSteady { .. } | ExperimentError::Faulted { .. }) => Ok(none),
        Err(error) => Err(error),
    }
}

/// True table velocities once the bristles have slid many times their length: a slow drive takes seconds to break away.
fn velocities(setup: &Setup, at: OperatingPoint) -> Result<Vec<f64>, ExperimentError> {
    let mut drive = setup.drive()?;
    settle_quietly(&mut drive, at)?;
    let slides = PRESLIDING_M / at.velocity;
    let periods = record_periods(&setup.board);
    let mut run =
        |seconds: f64| table_velocities(&mut drive, seconds, periods, |drive| driven(drive, at));
    run((50.0 * slides).clamp(1.0, 10.0))?;
    run((10.0 * slides).clamp(2.0, 4.0))
}
