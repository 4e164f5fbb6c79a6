//! What the chip's pins are joined to.

/// What a bridge does from the top of its timer's counter on, for one PWM period.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bridge {
    /// Compare values of phases a, b, c, timer counts.
    pub compare: [u16; 3],
    /// The outputs follow the compare values; otherwise all six switches are open.
    pub enabled: bool,
}

/// What the sensors of a motor give at the top of its timer's counter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sensors {
    /// Shunts of phases a, b, c, ADC counts.
    pub current: [u16; 3],
    /// Bus voltage, ADC counts.
    pub bus: u16,
    /// Encoder, its raw word: counts, or an absolute one's frame.
    pub encoder: u32,
    /// The encoder has passed its index since the last sample.
    pub index: bool,
    /// Heat sink, ADC counts.
    pub temperature: u16,
}

/// A motor, and so its timer and its sensors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Motor {
    /// On TIM1.
    Screw = 0,
    /// On TIM8.
    Nut = 1,
}

/// The machine at the pins.
pub trait Machine {
    /// The counter of `motor`'s timer is at its top at `time`, in core cycles since the reset: the sensors are
    /// sampled, and `bridge` holds from here to the next top.
    fn top(&mut self, motor: Motor, time: u64, bridge: Bridge) -> Sensors;

    /// What is at the sensors of `motor` while its bridge is off and nothing has been sampled yet.
    fn still(&self, motor: Motor) -> Sensors;

    /// The frame of the absolute encoder of `motor`, latched at `time`.
    fn frame(&mut self, motor: Motor, time: u64) -> u32;

    /// The table's scale, counts.
    fn scale(&mut self) -> u32;

    /// The bridge of `motor` was opened between two tops: by its break input, or by the code.
    fn stopped(&mut self, motor: Motor);

    /// Both bridges stand open for so many cycles, while a debugger halts their timers with the core.
    fn coast(&mut self, cycles: u64);

    /// The timers, and with them the bridges, go on after a halt.
    fn driven_again(&mut self);

    /// The chip was reset: both bridges are open, and the next top comes when the firmware has started again.
    fn reset(&mut self);
}

/// A machine that stands still: no current, a full bus, no motion.
#[derive(Clone, Copy, Debug, Default)]
pub struct AtRest;

impl Machine for AtRest {
    fn top(&mut self, motor: Motor, _time: u64, _bridge: Bridge) -> Sensors {
        self.still(motor)
    }

    fn still(&self, _motor: Motor) -> Sensors {
        Sensors {
            current: [2048; 3],
            bus: 2818,
            encoder: 0,
            index: false,
            temperature: 1000,
        }
    }

    fn frame(&mut self, _motor: Motor, _time: u64) -> u32 {
        0
    }

    fn scale(&mut self) -> u32 {
        0
    }

    fn stopped(&mut self, _motor: Motor) {}

    fn coast(&mut self, _cycles: u64) {}

    fn driven_again(&mut self) {}

    fn reset(&mut self) {}
}
