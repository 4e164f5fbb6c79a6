//! The board and machine of `hal-sim` at the emulated chip's pins.

use crate::chip::CORE_HZ;
use crate::pins::{Bridge, Machine, Motor, Sensors};
use control::current_loop::PwmCommand;
use hal_sim::board::{Board, BoardConfig};
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;

/// The machine of `hal-sim`, stepped by the tops of the emulated timers.
pub struct Joint {
    /// The board's sensors, and the machine behind them.
    pub board: Board,
    /// ADC counts of the heat sinks: screw, nut.
    pub temperatures: [u16; 2],
    last: Option<(Motor, u64)>,
    half_period: u64,
    restarted: bool,
    /// Cycles that the machine has coasted through beyond its last whole step.
    coasted: u64,
}

/// How far apart the two tops may be from half a period, core cycles: the timers start one count apart.
const STAGGER: u64 = 4;

impl Joint {
    /// A machine at rest, with heat sinks at these counts.
    #[must_use]
    pub fn new(
        model: &Model,
        coupling: Coupling,
        config: BoardConfig,
        temperatures: [u16; 2],
    ) -> Self {
        Self {
            board: Board::new(model, coupling, config),
            temperatures,
            last: None,
            half_period: u64::from(config.period()),
            restarted: false,
            coasted: 0,
        }
    }

    fn axis(motor: Motor) -> Axis {
        match motor {
            Motor::Screw => Axis::Screw,
            Motor::Nut => Axis::Nut,
        }
    }
}

impl Machine for Joint {
    /// # Panics
    /// If the tops do not alternate half a period apart, screw first: the machine's steps would not be time's.
    fn top(&mut self, motor: Motor, time: u64, bridge: Bridge) -> Sensors {
        match self.last {
            None => assert_eq!(
                motor,
                Motor::Screw,
                "the first top that is sampled is the screw's"
            ),
            Some((last, before)) => {
                let passed = time - before;
                let halves = if self.restarted {
                    // The machine coasts while the chip starts; its steps are half periods.
                    assert_eq!(
                        motor,
                        Motor::Screw,
                        "the first top that is sampled is the screw's"
                    );
                    (passed + self.half_period / 2) / self.half_period
                } else {
                    assert_ne!(motor, last, "the tops alternate");
                    let expected = self.half_period;
                    assert!(
                        passed.abs_diff(expected) <= STAGGER,
                        "{motor:?}: {passed} cycles since the other top, not {expected}",
                    );
                    1
                };
                for _ in 0..halves {
                    self.board.advance();
                }
            }
        }
        self.restarted = false;
        self.last = Some((motor, time));
        let axis = Self::axis(motor);
        if !bridge.enabled {
            // The latch is the chip's: what the board's own opened is closed when the chip closes it.
            self.board.clear_break(axis);
        }
        self.board.write(
            axis,
            PwmCommand {
                compare: bridge.compare,
                enable: bridge.enabled,
            },
        );
        let sample = self.board.turn(axis);
        Sensors {
            current: sample.current,
            bus: sample.bus,
            encoder: sample.encoder,
            index: self.board.take_index_passed(axis),
            temperature: self.temperatures[axis.index()],
        }
    }

    fn still(&self, motor: Motor) -> Sensors {
        let axis = Self::axis(motor);
        let config = self.board.config();
        let sensors = &config.sensors;
        let counts = |value: f64, most: u32| {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            let counts = value.round().clamp(0.0, f64::from(most - 1)) as u16;
            counts
        };
        Sensors {
            current: [counts(sensors.current.zero, sensors.current.counts); 3],
            bus: counts(config.bus_v / sensors.bus.per_count, sensors.bus.counts),
            encoder: self.board.encoder_word(axis, 0.0),
            index: false,
            temperature: self.temperatures[axis.index()],
        }
    }

    fn frame(&mut self, motor: Motor, time: u64) -> u32 {
        // The machine stands where it was at the last top, half a period before the one that the frame is for; its speed
        // takes it from there.
        let axis = Self::axis(motor);
        let age = self.board.config().sensors.encoders[axis.index()].age_s;
        if let Some((_, last)) = self.last {
            let lead = self.half_period - (age * CORE_HZ as f64).round() as u64;
            let since = time - last;
            assert!(
                self.restarted || since.abs_diff(lead) <= STAGGER,
                "{motor:?}: a frame is latched {since} cycles after the other top, not {lead}"
            );
        }
        let half_period_s = self.half_period as f64 / CORE_HZ as f64;
        self.board.encoder_word(axis, half_period_s)
    }

    fn scale(&mut self) -> u32 {
        // Without noise: what the sensors draw is drawn in the host's order.
        let metres = self.board.machine.table_position();
        let counts = metres / self.board.config().sensors.scale_count_m;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let counts = counts.round() as i64 as u32;
        counts
    }

    fn stopped(&mut self, motor: Motor) {
        self.board.trip_break(Self::axis(motor));
    }

    fn coast(&mut self, cycles: u64) {
        let Some((_, last)) = &mut self.last else {
            return;
        };
        // The top that comes next is as far away as it was.
        *last += cycles;
        self.coasted += cycles;
        while self.coasted >= self.half_period {
            self.coasted -= self.half_period;
            self.board.advance();
        }
    }

    fn driven_again(&mut self) {
        for axis in [Axis::Screw, Axis::Nut] {
            self.board.clear_break(axis);
        }
    }

    fn reset(&mut self) {
        for axis in [Axis::Screw, Axis::Nut] {
            // Opens the bridge now; the latch of the timer's break is cleared by the reset itself.
            self.board.trip_break(axis);
            self.board.clear_break(axis);
        }
        self.restarted = true;
    }
}
