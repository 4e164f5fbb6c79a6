//! The machine that is served: its description on one line, and a model file to begin with.

use control::encoder::Interface;
use hal_sim::experiment::Setup;
use link::settings::{PER_KRPM, Settings};
use plant::Axis;
use plant::model::{Brake, Model};
use std::fmt;

/// Sensing, supply, travel, brake and scale of a served machine, on one line.
pub struct MachineLine<'a>(pub &'a Setup);

impl fmt::Display for MachineLine<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Setup { model, board, .. } = self.0;
        let installation = &model.installation;
        for axis in Axis::ALL {
            let encoder = &board.sensors.encoders[axis.index()];
            let kind = match encoder.interface {
                Interface::Incremental => "incremental without index",
                Interface::IncrementalWithIndex => "incremental with index",
                Interface::Mt6835 => "absolute",
            };
            let counts = encoder.counts_per_turn;
            write!(
                formatter,
                "{} encoder {kind}, {counts} counts a turn; ",
                axis.name()
            )?;
        }
        let current = &board.sensors.current;
        let brake = match installation.brake {
            Brake::Ideal => "a brake that acts at once",
            Brake::Fitted => "a brake with delays",
            Brake::None => "no brake",
        };
        write!(
            formatter,
            "current +-{:.3} A; bus {} V; lead {} mm; travel +-{} mm from here to the end switches; \
             load {} N; {brake}; scale {} um a count",
            0.5 * f64::from(current.counts) * current.per_count.abs(),
            (1e3 * board.bus_v).round() / 1e3,
            1e3 * model.feed.lead_m,
            0.5e3 * installation.travel_m,
            (1e3 * model.feed.load_n).round() / 1e3,
            1e6 * board.sensors.scale_count_m,
        )
    }
}

/// Part by which a flux of the settings may differ from the machine's: a datasheet's tolerance.
const FLUX_TOLERANCE: f64 = 0.2;

/// Where settings describe another motor or encoder than the machine has, in sentences. Such a drive ends in a fault.
pub fn differences(setup: &Setup, settings: &Settings) -> Vec<String> {
    let mut found = Vec::new();
    for (axis, plate) in Axis::ALL.into_iter().zip([&settings.screw, &settings.nut]) {
        let (motor, name) = (setup.model.motor(axis), axis.name());
        let mut differ = |setting: &str, is: f64, machine: f64, tolerance: f64| {
            if (is - machine).abs() > tolerance * machine {
                found.push(format!(
                    "{name}.{setting} = {is}, but the simulated machine has {machine}: settings do not change the machine, so give it \
                     a model of yours with --model"
                ));
            }
        };
        let encoder = &setup.board.sensors.encoders[axis.index()];
        let counts = f64::from(plate.encoder.counts_per_turn);
        let has = f64::from(encoder.counts_per_turn);
        differ("encoder_counts_per_turn", counts, has, 0.0);
        let pole_pairs = f64::from(motor.pole_pairs);
        differ("pole_pairs", f64::from(plate.pole_pairs), pole_pairs, 0.0);
        let constant = (motor.flux_wb * pole_pairs * PER_KRPM * 1e4).round() / 1e4;
        let is = plate.voltage_constant_v_rms_per_krpm;
        differ(
            "voltage_constant_v_rms_per_krpm",
            is,
            constant,
            FLUX_TOLERANCE,
        );
    }
    found
}

/// The coupled machine as a model file, with a comment on each section.
pub fn example() -> String {
    let mut text = String::from(
        "# A machine for `ddfeed serve --model`. Each key's unit is its ending. All keys, units and ranges: `ddfeed identify --reference`.\n\n",
    );
    for line in Model::coupled().to_toml().lines() {
        text.push_str(match line {
            "[screw]" => "# The motor of the screw. Flux: line-to-line V rms per krpm / (1000 rpm in rad/s) / pole pairs.\n",
            "[nut]" => "# The motor of the nut.\n",
            "[feed]" => "# Ball screw, table and guideway.\n",
            "[sensing]" => "# Encoders are incremental, index or absolute. The current range is 2048 current_lsb_a.\n",
            "[installation]" => "# The table begins in the middle of its travel. The brake is ideal, fitted or none.\n",
            _ => "",
        });
        text.push_str(line);
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use hal_sim::boards::BoardKind;
    use hal_sim::served::SimulatedDrive;
    use plant::machine::Coupling;

    #[test]
    fn settings_of_another_motor_are_told() {
        for kind in [BoardKind::Mains, BoardKind::Nucleo] {
            let setup = Setup::shipped(kind, &Model::coupled(), Coupling::Coupled);
            let drive = SimulatedDrive::new(&setup).unwrap();
            let mut settings = *drive.settings();
            assert_eq!(differences(&setup, &settings), [""; 0]);
            settings.nut.pole_pairs += 1;
            let found = differences(&setup, &settings);
            assert!(
                found.len() == 1 && found[0].starts_with("nut.pole_pairs = "),
                "{found:?}"
            );
        }
    }

    #[test]
    fn the_example_is_the_coupled_machine() {
        let read = Model::parse(&example(), "example").unwrap();
        assert_eq!(read, Model::coupled());
    }
}
