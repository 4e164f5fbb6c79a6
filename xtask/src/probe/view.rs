//! The debug view of a running drive: the firmware's `debug_view` module says what its words are.

use anyhow::{Result, ensure};
use std::fmt;

/// `DDFV`, little-endian: the view's first word.
const MAGIC: u32 = u32::from_le_bytes(*b"DDFV");
/// The layout that this reads.
const LAYOUT: u32 = 2;
/// Words before the first motor, and words of a motor.
const HEAD: usize = 14;
const MOTOR: usize = 8;

/// Something that memory can be read of: a chip, or a test's stand-in.
pub trait Memory {
    /// Reads words from `address` on.
    fn words(&mut self, address: u32, words: &mut [u32]) -> Result<()>;
}

/// A drive at one look.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    state: &'static str,
    fault: u32,
    uptime_ms: u32,
    speed_missed: u32,
    motors: [MotorView; 2],
}

#[derive(Clone, Debug, PartialEq)]
struct MotorView {
    i_d: f64,
    i_q: f64,
    omega_e: f64,
    missed: u32,
    cycles: u32,
    cycles_max: u32,
}

impl View {
    /// Reads the view at `address`.
    pub fn read(memory: &mut impl Memory, address: u32) -> Result<Self> {
        let mut words = [0; HEAD + 2 * MOTOR];
        memory.words(address, &mut words)?;
        ensure!(
            words[0] == MAGIC && words[1] == LAYOUT,
            "at {address:#010x} the chip has {:#010x}, layout {}, and not the view of this firmware: flash it first",
            words[0],
            words[1]
        );
        const STATES: [&str; 6] = [
            "off",
            "calibrating",
            "ready",
            "running",
            "stopping",
            "fault",
        ];
        let motor = |index: usize| MotorView::new(&words[HEAD + index * MOTOR..]);
        Ok(Self {
            state: STATES.get(words[2] as usize).copied().unwrap_or("unknown"),
            fault: words[3],
            uptime_ms: words[5],
            speed_missed: words[7],
            motors: [motor(0), motor(1)],
        })
    }
}

impl MotorView {
    fn new(words: &[u32]) -> Self {
        let fixed = |word: u32, fraction: i32| f64::from(word.cast_signed()) / 2f64.powi(fraction);
        Self {
            i_d: fixed(words[0], 20),
            i_q: fixed(words[1], 20),
            omega_e: fixed(words[2], 16),
            missed: words[5],
            cycles: words[6],
            cycles_max: words[7],
        }
    }
}

impl fmt::Display for View {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{:9.3} s  {}",
            f64::from(self.uptime_ms) / 1000.0,
            self.state
        )?;
        if self.fault != 0 {
            write!(f, " {}", self.fault)?;
        }
        for (name, motor) in ["screw", "nut"].iter().zip(&self.motors) {
            let MotorView {
                i_d,
                i_q,
                omega_e,
                missed,
                cycles,
                cycles_max,
            } = motor;
            write!(
                f,
                "  {name}: i_d {i_d:+.3} A, i_q {i_q:+.3} A, omega_e {omega_e:+.2} rad/s, {cycles} cycles (at most \
                 {cycles_max}, {missed} late)"
            )?;
        }
        write!(f, "  speed task: {} late", self.speed_missed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Fake(Vec<u32>);

    impl Memory for Fake {
        fn words(&mut self, address: u32, words: &mut [u32]) -> Result<()> {
            assert_eq!(address, 0x2000_0100);
            words.copy_from_slice(&self.0);
            Ok(())
        }
    }

    fn running() -> Fake {
        let mut words = vec![0; HEAD + 2 * MOTOR];
        words[0] = MAGIC;
        words[1] = LAYOUT;
        words[2] = 3;
        words[5] = 1250;
        words[HEAD + MOTOR + 1] = (-(3 << 19) as i32).cast_unsigned();
        words[HEAD + MOTOR + 2] = 157 << 16;
        words[HEAD + MOTOR + 7] = 801;
        Fake(words)
    }

    #[test]
    fn a_running_drive_is_shown_in_units() {
        let text = View::read(&mut running(), 0x2000_0100).unwrap().to_string();
        assert!(text.contains("1.250 s  running"), "{text}");
        assert!(
            text.contains("nut: i_d +0.000 A, i_q -1.500 A, omega_e +157.00 rad/s"),
            "{text}"
        );
        assert!(text.contains("at most 801, 0 late"), "{text}");
    }

    #[test]
    fn another_firmware_is_not_read() {
        let mut other = running();
        other.0[1] = 3;
        let error = View::read(&mut other, 0x2000_0100).unwrap_err().to_string();
        assert!(error.contains("flash it first"), "{error}");
    }
}
