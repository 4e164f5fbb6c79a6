//! A simulated drive with its machine. Time passes only when the caller lets it.

use anyhow::{Context, Result, bail};
use hal_sim::boards::BoardKind;
use hal_sim::experiment::Setup;
use hal_sim::served::{LineId, Serving, SimulatedDrive};
use hal_sim::start::Start;
use plant::Axis;
use plant::effects::EffectModel;
use plant::machine::Coupling;
use plant::model::Model;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Most milliseconds in one call.
const LONGEST_MS: u32 = 60_000;

/// A simulated drive and the lines to it.
#[derive(Debug)]
pub struct Simulated {
    setup: Setup,
    declared: Model,
    serving: Serving,
    lines: BTreeMap<u32, LineId>,
    next: u32,
}

/// The set-up of a board as it ships; `paper` is the paper's machine with good sensors.
fn setup(board: &str) -> Result<Setup> {
    let model = Model::coupled();
    Ok(match board {
        "mains" => Setup::shipped(BoardKind::Mains, &model, Coupling::Coupled),
        "nucleo" => Setup::shipped(BoardKind::Nucleo, &model, Coupling::Coupled),
        "paper" => Setup::ideal(Model::paper(), Coupling::Lumped),
        other => bail!("the board is `{other}`, but mains, nucleo and paper are possible"),
    })
}

/// The effects of a TOML text with `[[effects]]` tables.
fn effects(text: &str) -> Result<Vec<EffectModel>> {
    let mut model = Model::coupled();
    model.effects.clear();
    // The effects come first, so that an error's line is the caller's.
    let text = format!("{text}\n{}", model.to_toml());
    Ok(Model::parse(&text, "the effect")?.effects)
}

impl Simulated {
    /// A drive that has just been switched on. `cold`: it does not know its rotor angles.
    ///
    /// # Errors
    /// There is no such board, or `added` is no list of effects.
    pub fn new(board: &str, cold: bool, added: &str) -> Result<Self> {
        let mut setup = setup(board)?;
        let declared = setup.model.clone();
        setup.model.effects.extend(effects(added)?);
        let drive = if cold {
            SimulatedDrive::cold(&Start::anywhere(&setup))
        } else {
            SimulatedDrive::new(&setup)
        };
        let drive = drive.with_context(|| format!("no drive fits the board {board}"))?;
        Ok(Self {
            setup,
            declared,
            serving: Serving::new(drive),
            lines: BTreeMap::new(),
            next: 0,
        })
    }

    /// A client connects: the number of its line.
    pub fn open(&mut self) -> u32 {
        self.next += 1;
        self.lines.insert(self.next, self.serving.open());
        self.next
    }

    /// A client has gone.
    pub fn close(&mut self, line: u32) {
        if let Some(id) = self.lines.remove(&line) {
            self.serving.close(id);
        }
    }

    /// Bytes of a client. What exceeds the line's room is lost, as on a serial port.
    pub fn receive(&mut self, line: u32, bytes: &[u8]) {
        if let Some(&id) = self.lines.get(&line) {
            let room = self.serving.room(id).min(bytes.len());
            self.serving.receive(id, &bytes[..room]);
        }
    }

    /// Takes what the drive has sent to a client.
    pub fn outgoing(&mut self, line: u32) -> Vec<u8> {
        let Some(&id) = self.lines.get(&line) else {
            return Vec::new();
        };
        let bytes = self.serving.outgoing(id).to_vec();
        self.serving.sent(id, bytes.len());
        bytes
    }

    /// Simulates so many milliseconds: at most a minute.
    pub fn advance(&mut self, ms: u32) {
        for _ in 0..ms.min(LONGEST_MS) {
            self.serving.millisecond();
        }
    }

    /// Milliseconds since the drive was switched on.
    #[must_use]
    pub fn ms(&self) -> u64 {
        self.serving.ms()
    }

    /// The model file of the machine without the effects that were added.
    #[must_use]
    pub fn declared(&self) -> String {
        self.declared.to_toml()
    }

    /// The machine as it is, not as its sensors show it.
    #[must_use]
    pub fn machine(&self) -> Value {
        let served = self.serving.drive();
        let machine = &served.drive().board.machine;
        let turns = |axis| machine.motor(axis).theta / TAU;
        let contacts = served.contacts();
        json!({
            "table_mm": 1e3 * served.travel_from_start_m(),
            "velocity_mm_s": 1e3 * machine.table_velocity(),
            "screw_turns": turns(Axis::Screw),
            "nut_turns": turns(Axis::Nut),
            "travel_mm": 1e3 * self.setup.model.installation.travel_m,
            "brake_holds": served.braked(),
            "end_forward": contacts.end_forward,
            "end_backward": contacts.end_backward,
            "load_n": self.setup.model.feed.load_n,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_board_or_an_effect_that_is_none_is_refused_with_a_sentence() {
        let board = Simulated::new("none", false, "").unwrap_err();
        assert_eq!(
            board.to_string(),
            "the board is `none`, but mains, nucleo and paper are possible"
        );
        let effect = Simulated::new(
            "mains",
            false,
            "[[effects]]\nkind = \"none\"\nwhere = \"screw\"",
        )
        .unwrap_err();
        assert!(
            effect.to_string().starts_with("the effect, line 2"),
            "{effect}"
        );
    }

    #[test]
    fn time_passes_only_in_advance() {
        let mut simulated = Simulated::new("mains", true, "").unwrap();
        simulated.advance(5);
        assert_eq!(simulated.ms(), 5);
        assert_eq!(simulated.machine()["brake_holds"], true);
    }
}
