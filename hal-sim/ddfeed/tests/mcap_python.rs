//! `record --mcap` as others read it: the Python packages `mcap` and `mcap-ros2-support`. Where they are not installed the test is
//! ignored by name; `cargo xtask test` installs them into the target folder.

mod served;

use plant::recording::{COLUMNS, Recording};
use served::Served;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Prints a line for each message: topic, log time, stamp and columns.
const SCRIPT: &str = "
import sys
from mcap_ros2.reader import read_ros2_messages
names = sys.argv[2:]
for read in read_ros2_messages(sys.argv[1]):
    message, stamp = read.ros_msg, read.ros_msg.header.stamp
    values = [getattr(message, name) for name in names]
    print(read.channel.topic, read.log_time_ns, stamp.sec * 10**9 + stamp.nanosec, *map(repr, values))
";

fn python_reads_the_recordings_values(environment: &Path) {
    let served = Served::new(&[]);
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display().to_string();
    served.printed(&["record", &out, "--mcap", "--arm", "--hold", "2.5,300,1.2"]);
    let recording = Recording::load(&folder.path().join("record.csv.gz")).unwrap();
    let output = Command::new(environment.join("bin/python"))
        .args(["-c", SCRIPT])
        .arg(folder.path().join("record.mcap"))
        .args(COLUMNS)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    let text = String::from_utf8(output.stdout).unwrap();
    let start_s = recording.time_s[0];
    for (line, row) in text.lines().zip(recording.samples()) {
        let words: Vec<_> = line.split(' ').collect();
        let time_ns = ((row.time_s - start_s) * 1e9).round().to_string();
        assert_eq!(words[..3], ["/drive", &*time_ns, &*time_ns]);
        let values = words[3..]
            .iter()
            .map(|word| word.parse::<f64>().unwrap().to_bits());
        let expected = (0..COLUMNS.len()).map(|column| row.column(column).to_bits());
        assert!(values.eq(expected), "{line} of {row:?}");
    }
    assert_eq!(text.lines().count(), recording.len());
    assert!(recording.len() > 5000, "a second and more");
}

/// The Python environment with the packages, in the target folder.
fn environment() -> Option<PathBuf> {
    Path::new(env!("CARGO_BIN_EXE_ddfeed"))
        .ancestors()
        .map(|folder| folder.join("mcap-reader"))
        .find(|environment| {
            let python = Command::new(environment.join("bin/python"))
                .args(["-c", "import mcap_ros2"])
                .output();
            python.is_ok_and(|output| output.status.success())
        })
}

fn main() {
    given::run([given::Test::new(
        "the Python packages mcap and mcap-ros2-support, which `cargo xtask test` installs"
            .to_owned(),
        environment(),
        "python_reads_the_recordings_values",
        python_reads_the_recordings_values,
    )])
}
