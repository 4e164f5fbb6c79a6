//! The emulated chip's tops compared with the drive on the host, period by period.

use crate::chip::Top;
use crate::pins::Motor;
use control::current_loop::PwmCommand;
use hal_sim::drive::Drive;
use plant::Axis;

/// The tops of each motor's timer: screw, nut.
#[must_use]
pub fn by_motor(tops: &[Top]) -> [Vec<&Top>; 2] {
    [Motor::Screw, Motor::Nut].map(|motor| tops.iter().filter(|top| top.motor == motor).collect())
}

/// In this period the host's drive, just stepped, has sampled what the chip has, and writes the compare values that stand
/// on the chip's timers at the next top.
///
/// # Panics
/// If it is not so; `what` says on what board and machine.
pub fn assert_period(what: &str, period: usize, streams: &[Vec<&Top>; 2], drive: &Drive) {
    for (axis, stream) in Axis::ALL.into_iter().zip(streams) {
        let (sampled, next) = (stream[period].sensors, stream[period + 1].bridge);
        let host = drive.sample(axis);
        assert_eq!(
            (sampled.current, sampled.bus, sampled.encoder),
            (host.current, host.bus, host.encoder),
            "{what}: sample {period} of the {axis:?}"
        );
        let emulated = PwmCommand {
            compare: next.compare,
            enable: next.enabled,
        };
        assert_eq!(
            emulated,
            drive.compare(axis),
            "{what}: compare values {period} of the {axis:?}"
        );
    }
}
