//! The one way in: any log of a double drive, a feed axis, a motor or a PMSM, in any column layout that a [`Mapping`]
//! describes, as a [`Record`] in SI units. [`rules`] says what is done with faults.

mod data_quality;
mod derive;
mod error;
mod layout;
mod mapping;
pub mod quality;
mod record;
pub mod rules;
mod spikes;
mod split;
mod table;
mod units;
mod windows;

pub use data_quality::{DataQuality, Skipped};
pub use derive::speed_band_hz;
pub use error::LoadError;
pub use layout::{Layout, Machine, Need};
pub use mapping::{Clock, Constant, Differs, Mapping, Rows, Source};
pub use record::{Channel, Origin, Record};
pub use rules::OnFault;
pub use split::{Split, split};
pub use table::{Column, Progress, Table, TextLayout};
pub use units::names as unit_names;
pub(crate) use windows::windows;

use mapping::Found;
use plant::Axis;
use plant::recording::{AxisRecord, Recording};
use rules::{Raw, Timing, sift};
use std::collections::BTreeMap;
use std::path::Path;

/// How to load.
#[derive(Debug, Clone, Copy)]
pub struct How<'a> {
    /// The file's layout.
    pub mapping: &'a Mapping,
    /// What is done with a fault.
    pub on_fault: OnFault,
    /// Rate that the machine's model declares, Hz; a mapping's own comes first.
    pub declared_hz: Option<f64>,
}

/// Reads a record.
///
/// # Errors
/// [`LoadError`]: what was read, where, and what is expected.
pub fn load(path: &Path, how: How, progress: &mut Progress) -> Result<Record, LoadError> {
    let mapping = &how.mapping.of_file(path);
    let mut table = Table::read(path, &mapping.text_layout(), progress)?;
    let timed = match mapping.find(&table, "t_s") {
        Err(error) if mapping.columns.contains_key("t_s") => return Err(error),
        found => found.ok(),
    };
    let found = channels(mapping, &table)?;
    let mut quality = DataQuality {
        file: table.origin.clone(),
        notes: std::mem::take(&mut table.notes),
        ..DataQuality::default()
    };
    let mut constants = BTreeMap::new();
    for (name, _) in mapping.machine.constants() {
        if let Some(value) = mapping.constant(&table, name)? {
            constants.insert(*name, value);
        }
    }
    for name in mapping.columns.keys() {
        if !found.iter().any(|(known, _)| known == name) {
            quality.notes.push(format!(
                "`{name}` is mapped to a column that this file does not have; it is optional and taken as absent"
            ));
        }
    }
    let rows = rows_that_count(&table, mapping, timed)?;
    let time = timed.map(|t| ("t_s", t)).into_iter();
    let all: Vec<(&'static str, Found)> = time.chain(found.iter().copied()).collect();
    quality.notes.extend(units_of_file(&table, &all));
    // Rows of the file, where a row's number is a channel.
    let length = found
        .iter()
        .find_map(|(_, place)| Some(table.columns[place.column?].values.len()))
        .unwrap_or(0);
    let values = take_values(&mut table, &all, length, rows.as_deref());
    let columns = raw(&table, &all, values, rows.as_deref());
    let timing = Timing {
        rate: mapping.sample_hz.or(how.declared_hz).filter(|hz| *hz > 0.0),
        clock: mapping.clock,
        timed: timed.is_some(),
        rows: rows.clone(),
    };
    let grid = sift(columns, &timing, how.on_fault, &mut quality)?;
    let mut record = Record {
        machine: mapping.machine,
        rate: grid.rate,
        time: grid.time,
        channels: found
            .iter()
            .zip(grid.columns)
            .map(|((name, _), values)| Channel {
                name,
                values,
                origin: Origin::Measured,
            })
            .collect(),
        segments: grid.segments,
        measured: grid.measured,
        constants,
        quality,
    };
    for channel in &record.channels {
        record
            .quality
            .note_spikes(channel.name, &record.time, &channel.values);
    }
    derive::complete(&mut record, mapping.pole_pairs, mapping.amplitude_invariant);
    Ok(record)
}

/// Which channels have a unit by the file's own word, in sentences.
fn units_of_file(table: &Table, channels: &[(&'static str, Found)]) -> Vec<String> {
    let by_file = channels.iter().filter(|(_, place)| place.unit_of_file);
    by_file
        .map(|(name, place)| {
            let column = place.column.map(|column| &table.columns[column]);
            let path = column.map_or("", |column| column.path.as_str());
            let unit = column
                .and_then(|column| column.unit.as_deref())
                .unwrap_or_default();
            format!("`{name}` is taken to be in {unit}, as `{path}` says")
        })
        .collect()
}

/// Values of the channels in our unit, of the rows that count. Most columns leave the table, which saves a copy.
/// A row's number goes up to `length`.
fn take_values(
    table: &mut Table,
    channels: &[(&'static str, Found)],
    length: usize,
    rows: Option<&[usize]>,
) -> Vec<Vec<f64>> {
    let own = channels.iter().map(|(_, place)| {
        // A column may serve twice only where the mapping names neither.
        let same = channels.iter().filter(|(_, p)| p.column == place.column);
        let own = match place.column {
            Some(column) if same.count() > 1 => table.columns[column].values.clone(),
            Some(column) => std::mem::take(&mut table.columns[column].values),
            None => (0..length).map(|row| row as f64).collect(),
        };
        in_si(own, *place, rows)
    });
    own.collect()
}

/// The channels as the rules for faults read them.
fn raw<'a>(
    table: &'a Table,
    channels: &[(&'static str, Found)],
    values: Vec<Vec<f64>>,
    rows: Option<&'a [usize]>,
) -> Vec<Raw<'a>> {
    let columns = channels.iter().zip(values);
    columns
        .map(|(&(name, place), values)| Raw {
            name,
            most: layout::most(name),
            values,
            text: Box::new(move |row| {
                let row = rows.map_or(row, |rows| rows[row - 1] + 1);
                place
                    .column
                    .map_or_else(String::new, |column| table.text(column, row))
            }),
        })
        .collect()
}

/// Where the machine's channels stand in a file. Of each group of alternatives one must be whole.
fn channels(mapping: &Mapping, table: &Table) -> Result<Vec<(&'static str, Found)>, LoadError> {
    let layout = mapping.machine.channels();
    let mut found = Vec::new();
    for channel in &layout {
        match mapping.find(table, channel.name) {
            Ok(place) => found.push((channel.name, place)),
            Err(LoadError::Column { .. })
                // One mapping serves several files, of which some lack what is optional.
                if channel.need == Need::Optional
                    || channel.need != Need::Required
                        && !mapping.columns.contains_key(channel.name) => {}
            Err(error) => return Err(error),
        }
    }
    let has = |name: &str| found.iter().any(|(known, _)| *known == name);
    let mut groups: Vec<&'static str> = Vec::new();
    for channel in &layout {
        if let Need::OneOf(group, _) = channel.need
            && !groups.contains(&group)
        {
            groups.push(group);
        }
    }
    for group in groups {
        let mut alternatives: Vec<Vec<&str>> = Vec::new();
        for channel in &layout {
            if let Need::OneOf(of, alternative) = channel.need
                && of == group
            {
                alternatives.resize(
                    alternatives.len().max(usize::from(alternative) + 1),
                    Vec::new(),
                );
                alternatives[usize::from(alternative)].push(channel.name);
            }
        }
        // A motor's voltages may be missing: its mechanics are then looked at alone.
        let voltages = group == "voltages" && !alternatives.iter().flatten().any(|name| has(name));
        if voltages || alternatives.iter().any(|a| a.iter().all(|name| has(name))) {
            continue;
        }
        let expected: Vec<String> = alternatives.iter().map(|a| a.join(" and ")).collect();
        return Err(LoadError::Group {
            origin: table.origin.clone(),
            group,
            expected: expected.join(", or "),
            present: table
                .columns
                .iter()
                .take(40)
                .map(|c| c.path.clone())
                .collect(),
        });
    }
    Ok(found)
}

/// Values of a column, or the numbers of the rows.
fn numbers(table: &Table, place: Found) -> Vec<f64> {
    match place.column {
        Some(column) => table.columns[column].values.clone(),
        None => {
            let rows = table.columns.iter().map(|c| c.values.len()).max();
            (0..rows.unwrap_or(0)).map(|row| row as f64).collect()
        }
    }
}

/// Values of the rows that count, in our unit.
fn in_si(mut values: Vec<f64>, place: Found, keep: Option<&[usize]>) -> Vec<f64> {
    if let Some(period) = place.period {
        derive::unwrap(&mut values, period);
    }
    if let Some(rows) = keep {
        values = rows
            .iter()
            .map(|row| values.get(*row).copied().unwrap_or(f64::NAN))
            .collect();
    }
    if place.scale != 1.0 || place.offset != 0.0 {
        values
            .iter_mut()
            .for_each(|value| *value = *value * place.scale + place.offset);
    }
    values
}

/// Reads two columns of a motor's slow turn, which needs no time.
///
/// # Errors
/// As [`load`].
pub fn load_map(
    path: &Path,
    mapping: &Mapping,
    progress: &mut Progress,
) -> Result<[Vec<f64>; 2], LoadError> {
    let mapping = &mapping.of_file(path);
    let table = Table::read(path, &mapping.text_layout(), progress)?;
    let column = |name: &str| {
        let place = mapping.find(&table, name)?;
        let values = &numbers(&table, place);
        match values.iter().position(|v| !v.is_finite()) {
            Some(row) => Err(LoadError::Cell {
                origin: table.origin.clone(),
                row: row + 1,
                column: name.to_owned(),
                text: place
                    .column
                    .map_or_else(String::new, |column| table.text(column, row + 1)),
            }),
            None => Ok(in_si(values.clone(), place, None)),
        }
    };
    Ok([column("position_rad")?, column("current_a")?])
}

/// The rows that a mapping asks for; `None` is all.
fn rows_that_count(
    table: &Table,
    mapping: &Mapping,
    timed: Option<Found>,
) -> Result<Option<Vec<usize>>, LoadError> {
    let Some(rows) = &mapping.rows else {
        return Ok(None);
    };
    let fault = |reason: &str| LoadError::Mapping {
        origin: table.origin.clone(),
        reason: reason.to_owned(),
    };
    let flag = match &rows.column {
        Some(name) => Some(&table.columns[table.find(name)?].values),
        None if rows
            .equals
            .or(rows.not)
            .or(rows.at_least)
            .or(rows.at_most)
            .is_some() =>
        {
            return Err(fault("[rows] has a value but no column; name the column"));
        }
        None => None,
    };
    let windowed = rows.from_s.is_some() || rows.to_s.is_some();
    let time: Option<Vec<f64>> = match (windowed, timed, mapping.sample_hz) {
        (false, ..) => None,
        (true, Some(place), _) => Some(in_si(numbers(table, place), place, None)),
        (true, None, Some(rate)) => {
            let count = table.columns.iter().map(|c| c.values.len()).max();
            Some((0..count.unwrap_or(0)).map(|k| k as f64 / rate).collect())
        }
        (true, None, None) => {
            return Err(fault(
                "[rows] has a time, but the file has none; give sample_hz",
            ));
        }
    };
    let start = time
        .as_ref()
        .and_then(|time| time.iter().copied().find(|t| t.is_finite()))
        .unwrap_or(0.0);
    let count = flag
        .map(Vec::len)
        .or(time.as_ref().map(Vec::len))
        .unwrap_or(0);
    let counts = |row: &usize| {
        let flagged = flag.is_none_or(|flag| {
            let value = flag[*row];
            rows.equals.is_none_or(|equals| value == equals)
                && rows.not.is_none_or(|not| value != not)
                && rows.at_least.is_none_or(|least| value >= least)
                && rows.at_most.is_none_or(|most| value <= most)
        });
        let within = time.as_ref().is_none_or(|time| {
            let since = time.get(*row).map_or(f64::NAN, |t| t - start);
            // A row without a time is a fault, which the rules tell.
            !(rows.from_s.is_some_and(|from| since < from)
                || rows.to_s.is_some_and(|to| since > to))
        });
        flagged && within
    };
    if flag.is_none() && time.is_none() {
        return Ok(None);
    }
    Ok(Some((0..count).filter(counts).collect()))
}

/// A double drive's record; of several segments the longest.
///
/// # Errors
/// An angle that does not turn as its speed reference asks: one of the units is wrong.
pub fn double_drive(record: Record) -> Result<Recording, LoadError> {
    let mut loaded = record.longest();
    let mut axis = |name: &str| AxisRecord {
        angle_rad: loaded.take(&format!("{name}_angle_rad")),
        ia_a: loaded.take(&format!("{name}_ia_a")),
        ib_a: loaded.take(&format!("{name}_ib_a")),
        ud_v: loaded.take(&format!("{name}_ud_v")),
        uq_v: loaded.take(&format!("{name}_uq_v")),
        iq_ref_a: loaded.take(&format!("{name}_iq_ref_a")),
        speed_ref_rad_s: loaded.take(&format!("{name}_speed_ref_rad_s")),
    };
    let axes = [axis("screw"), axis("nut")];
    for which in Axis::ALL {
        let record = &axes[which.index()];
        let way = |values: &mut dyn Iterator<Item = f64>| values.map(f64::abs).sum::<f64>();
        let asked = way(&mut record.speed_ref_rad_s.iter().copied()) / loaded.rate;
        // Over a hundredth of a second, so that the encoder's counts at rest are no way.
        let step = ((0.01 * loaded.rate) as usize).max(1);
        let every: Vec<f64> = record.angle_rad.iter().copied().step_by(step).collect();
        let turned = way(&mut every.windows(2).map(|pair| pair[1] - pair[0]));
        if asked > std::f64::consts::TAU && !(0.5..2.0).contains(&(turned / asked)) {
            return Err(LoadError::Turned {
                origin: loaded.quality.file.clone(),
                column: format!("{}_angle_rad", ["screw", "nut"][which.index()]),
                turned,
                asked,
            });
        }
    }
    Ok(Recording {
        time_s: std::mem::take(&mut loaded.time),
        axes,
        table_position_m: loaded.take("table_position_m"),
    })
}
