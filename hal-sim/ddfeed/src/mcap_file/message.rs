//! A row as a ROS 2 message: its definition, and its bytes in CDR.

use byteorder::LittleEndian;
use plant::recording::{COLUMNS, Sample};
use serde::Serialize;
use std::array::from_fn;

/// The message's type.
pub const NAME: &str = "ddfeed_msgs/msg/Sample";

/// What stands before a message: plain CDR, little-endian, no options.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// The definitions of the types that a message is of.
const OTHERS: &str = "\
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
";

/// The fields, in the definition's order.
#[derive(Serialize)]
struct Message {
    sec: i32,
    nanosec: u32,
    frame_id: &'static str,
    columns: [f64; COLUMNS.len()],
}

/// The message's definition: a header, and a number for each column of a recording.
pub fn definition() -> String {
    let fields: String = COLUMNS.map(|name| format!("float64 {name}\n")).concat();
    format!("std_msgs/Header header\n{fields}{OTHERS}")
}

/// A row's message. A recording's file has no empty cells; a sample's NaN stays NaN.
///
/// # Errors
/// None that is known: it has no type that CDR lacks.
pub fn encode(sample: &Sample, time_ns: u64) -> cdr_encoding::Result<Vec<u8>> {
    let message = Message {
        sec: (time_ns / 1_000_000_000) as i32,
        nanosec: (time_ns % 1_000_000_000) as u32,
        frame_id: "",
        columns: from_fn(|column| sample.column(column)),
    };
    let mut bytes = ENCAPSULATION.to_vec();
    // Alignment counts from behind the encapsulation: the encoder starts at 0 there.
    bytes.extend(cdr_encoding::to_vec::<_, LittleEndian>(&message)?);
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_laid_out_as_cdr_says() {
        let sample = Sample {
            time_s: 2.5,
            table_position_m: f64::NAN,
            ..Sample::default()
        };
        let bytes = encode(&sample, 2_000_000_003).unwrap();
        let mut expected = vec![0, 1, 0, 0];
        expected.extend([2, 0, 0, 0, 3, 0, 0, 0]);
        // An empty text has its final zero; three bytes align the numbers to 8.
        expected.extend([1, 0, 0, 0, 0, 0, 0, 0]);
        expected.extend(2.5f64.to_le_bytes());
        expected.extend([0; 14 * 8]);
        expected.extend(f64::NAN.to_le_bytes());
        assert_eq!(bytes, expected);
    }
}
