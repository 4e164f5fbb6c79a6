//! The machine that is served: its description on one line, and a model file to begin with.

use control::encoder::Interface;
use hal_sim::experiment::Setup;
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
            board.bus_v,
            1e3 * model.feed.lead_m,
            0.5e3 * installation.travel_m,
            model.feed.load_n,
            1e6 * board.sensors.scale_count_m,
        )
    }
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

    #[test]
    fn the_example_is_the_coupled_machine() {
        let read = Model::parse(&example(), "example").unwrap();
        assert_eq!(read, Model::coupled());
    }
}
