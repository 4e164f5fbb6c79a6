//! A recording as an MCAP file, which PlotJuggler and Foxglove read.

pub(crate) mod message;

use anyhow::Result;
use mcap::WriteOptions;
use mcap::records::{MessageHeader, Metadata};
use plant::recording::RecordingReader;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

/// The channel's topic; viewers print it before the name of a column.
pub const TOPIC: &str = "/drive";
/// The name of the metadata record.
pub const ABOUT: &str = "recording";

/// Writes each row of `recording` into `file`, and what `about` says of the recording. A message's time is the row's, from the
/// first row on. The rows are read from the file, so both files have the same digits.
///
/// # Errors
/// The recording cannot be read, or the file cannot be written.
pub fn write(recording: &Path, file: &Path, about: BTreeMap<String, String>) -> Result<()> {
    let output = BufWriter::new(File::create(file)?);
    let mut writer = WriteOptions::new().compression(None).create(output)?;
    writer.write_metadata(&Metadata {
        name: ABOUT.to_owned(),
        metadata: about,
    })?;
    let schema = writer.add_schema(message::NAME, "ros2msg", message::definition().as_bytes())?;
    let channel_id = writer.add_channel(schema, TOPIC, "cdr", &BTreeMap::new())?;
    let mut start_s = None;
    for (sequence, sample) in (0..).zip(RecordingReader::open(recording)?) {
        let sample = sample?;
        let since_s = sample.time_s - *start_s.get_or_insert(sample.time_s);
        let time_ns = (since_s * 1e9).round() as u64;
        let header = MessageHeader {
            channel_id,
            sequence,
            log_time: time_ns,
            publish_time: time_ns,
        };
        writer.write_to_known_channel(&header, &message::encode(&sample, time_ns)?)?;
    }
    writer.finish()?;
    let output = writer.into_inner().into_inner();
    output
        .map_err(std::io::IntoInnerError::into_error)?
        .sync_all()?;
    Ok(())
}
