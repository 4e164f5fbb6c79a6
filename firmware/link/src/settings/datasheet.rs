//! Other ways in which datasheets print what a motor's settings say.
//!
//! # The convention
//!
//! The control code uses the power-invariant transformation: its vectors are `sqrt(3/2)` times as long as the amplitude of
//! a phase, so that `p = u_d i_d + u_q i_q` and the torque is `pole_pairs * flux * i_q` with no factor 3/2. For sinusoidal
//! phases with the rms current `I` in each lead, `i_q = sqrt(3) I`, and the rms voltage between two leads is
//! `pole_pairs * flux * omega`. So, with `w = 1000 * 2 pi / 60 rad/s`:
//!
//! | printed | is |
//! | --- | --- |
//! | Ke, V rms between leads per 1000 rpm | `pole_pairs * flux * w` |
//! | Ke, V peak between leads per 1000 rpm | `sqrt(2) * pole_pairs * flux * w` |
//! | Kt, N m per A rms in each lead | `sqrt(3) * pole_pairs * flux` |
//! | Kt, N m per A peak in each lead | `sqrt(3/2) * pole_pairs * flux` |
//! | R, L between two leads | twice those of a phase |
//!
//! `Kt = sqrt(3) * 60 / (2 pi) * Ke` of a sinusoidal motor is what manufacturers say too: Kollmorgen (AKD User Guide,
//! `MOTOR.KT`: `Kt = 60 * sqrt(3) * Ui / (2 * pi * n)`, and its Motor Data Legend: `KTrms` in N m/A rms, `KE` as the rms
//! value between two terminals per 1000 rpm, resistance and inductance phase to phase) and FANUC (B-65262EN, 3: `Kt = 3 Kv`
//! with `Kv` the rms voltage of a phase). A datasheet of a brushless motor for six-step drives may mean a direct current
//! through two leads by "A": its Kt in N m/A is its Ke in V s/rad, peak between leads; give it that one.

use super::{PER_KRPM, Setting, Settings};

/// Another spelling of a motor's setting.
#[derive(Clone, Copy, Debug)]
pub struct Spelling {
    /// Its name within the group of a motor. Its end is the unit.
    pub name: &'static str,
    /// The setting that it stands for.
    pub setting: &'static str,
    /// What it is multiplied by.
    pub factor: f64,
}

const SQRT_2: f64 = core::f64::consts::SQRT_2;
const SQRT_3: f64 = 1.732_050_807_568_877_2;

/// All of them.
pub const SPELLINGS: [Spelling; 7] = [
    Spelling {
        name: "torque_constant_nm_per_a_rms",
        setting: "voltage_constant_v_rms_per_krpm",
        factor: PER_KRPM / SQRT_3,
    },
    Spelling {
        name: "torque_constant_nm_per_a_peak",
        setting: "voltage_constant_v_rms_per_krpm",
        factor: PER_KRPM * SQRT_2 / SQRT_3,
    },
    Spelling {
        name: "voltage_constant_v_peak_per_krpm",
        setting: "voltage_constant_v_rms_per_krpm",
        factor: 1.0 / SQRT_2,
    },
    Spelling {
        name: "resistance_phase_ohm",
        setting: "resistance_line_to_line_ohm",
        factor: 2.0,
    },
    Spelling {
        name: "inductance_phase_mh",
        setting: "inductance_line_to_line_mh",
        factor: 2.0,
    },
    Spelling {
        name: "inertia_kg_m2",
        setting: "inertia_kg_cm2",
        factor: 1e4,
    },
    Spelling {
        name: "rated_current_a_peak",
        setting: "rated_current_a_rms",
        factor: 1.0 / SQRT_2,
    },
];

/// The setting that a name means, and what its value is to be multiplied by.
#[must_use]
pub fn spelled(name: &str) -> Option<(Setting, f64)> {
    if let Some(setting) = Setting::named(name) {
        return Some((setting, 1.0));
    }
    let (group, name) = name.split_once('.')?;
    if group != "screw" && group != "nut" {
        return None;
    }
    let spelling = SPELLINGS.iter().find(|spelling| spelling.name == name)?;
    let setting = Settings::all()
        .find(|setting| setting.group() == group && setting.is_called(spelling.setting))?;
    Some((setting, spelling.factor))
}

/// All spellings of both motors: the full name, the setting, and what a value is multiplied by to be that setting's.
#[cfg(feature = "host")]
pub fn spellings() -> impl Iterator<Item = (String, Setting, f64)> {
    ["screw", "nut"].into_iter().flat_map(|group| {
        SPELLINGS.iter().filter_map(move |spelling| {
            let name = format!("{group}.{}", spelling.name);
            let (setting, factor) = spelled(&name)?;
            Some((name, setting, factor))
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Kt of Ke by the manufacturer's own equation, at any speed.
    #[test]
    fn torque_and_voltage_constants_are_those_of_the_manufacturer_s_equation() {
        let (volts, rpm) = (51.0, 1000.0);
        let kt = 60.0 * SQRT_3 * volts / (core::f64::consts::TAU * rpm);
        let (setting, factor) = spelled("nut.torque_constant_nm_per_a_rms").unwrap();
        assert!(setting.is_called("voltage_constant_v_rms_per_krpm"));
        assert!(
            (kt * factor - volts).abs() < 1e-9,
            "{kt} N m/A make {} V/krpm, expected {volts}",
            kt * factor
        );
    }

    #[test]
    fn each_spelling_stands_for_a_setting_and_only_a_motor_has_them() {
        extern crate std;
        for spelling in SPELLINGS {
            let name = std::format!("screw.{}", spelling.name);
            assert!(spelled(&name).is_some(), "{name}");
            assert!(spelled(&std::format!("feed.{}", spelling.name)).is_none());
        }
        assert!(spelled("screw.nothing").is_none());
        assert!(spelled("").is_none());
    }
}
