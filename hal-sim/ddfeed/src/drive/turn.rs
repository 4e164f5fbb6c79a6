//! One motor turns, the other rests: a table velocity and a base speed, by the lead.

use super::connect::Drive;
use super::motion::{jog, travel};
use super::options::{JogOptions, LeadOptions, Motor, MoveOptions, TurnOptions};
use anyhow::Result;

/// Turns a motor at a speed until Ctrl-C, or the screw by an angle.
pub fn turn(drive: &mut Drive, options: &TurnOptions) -> Result<()> {
    let lead_mm = drive.settings()?.feed.lead_mm;
    // What the screw turns against the nut moves the table.
    let table_speed = options.rpm / 60.0 * lead_mm;
    let lead = |nut_rpm| LeadOptions {
        nut_rpm: Some(nut_rpm),
        arm: options.arm,
    };
    match (options.angle, options.motor) {
        (Some(degrees), _) => travel(
            drive,
            &MoveOptions {
                distance: Some(degrees / 360.0 * lead_mm),
                to: None,
                table_speed,
                lead: lead(0.0),
                json: false,
            },
        ),
        (None, Motor::Screw) => jog(
            drive,
            &JogOptions {
                table_speed,
                lead: lead(0.0),
                duration: options.duration,
            },
        ),
        (None, Motor::Nut) => jog(
            drive,
            &JogOptions {
                table_speed: -table_speed,
                lead: lead(options.rpm),
                duration: options.duration,
            },
        ),
    }
}
