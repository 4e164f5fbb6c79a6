//! The one way in: records from `.csv`, `.csv.gz`, Parquet and MATLAB 5 `.mat`, of a double drive, a feed axis or a motor,
//! in any column layout that a [`Mapping`] describes. [`rules`] says what is done with faults.

mod account;
mod error;
mod layout;
mod mapping;
pub mod rules;
mod table;

pub use account::{Account, Skipped};
pub use error::LoadError;
pub use layout::Machine;
pub use mapping::{Clock, Constant, Mapping, Source};
pub use rules::OnFault;
pub use table::{Progress, Table};

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

/// A record's columns, even in time, by our names.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// Time first, then as the machine's layout has them.
    columns: Vec<(&'static str, Vec<f64>)>,
    /// Numbers beside the columns.
    constants: BTreeMap<&'static str, f64>,
    /// Rows a second.
    pub rate: f64,
    /// What became of the file's rows.
    pub account: Account,
}

impl Loaded {
    /// Takes a column out. An empty one if the machine's layout does not have it.
    pub fn take(&mut self, name: &str) -> Vec<f64> {
        self.columns
            .iter_mut()
            .find(|(known, _)| *known == name)
            .map(|(_, values)| std::mem::take(values))
            .unwrap_or_default()
    }

    /// A constant; NaN if the machine's layout does not have it.
    pub fn constant(&self, name: &str) -> f64 {
        self.constants.get(name).copied().unwrap_or(f64::NAN)
    }
}

/// Reads a record.
///
/// # Errors
/// [`LoadError`]: what was read, where, and what is expected.
pub fn load(path: &Path, how: How, progress: &mut Progress) -> Result<Loaded, LoadError> {
    let mapping = how.mapping;
    let table = Table::read(path, mapping.separator(), progress)?;
    let keep = rows_that_count(&table, mapping)?;
    let timed = mapping.find(&table, "t_s").ok();
    if timed.is_none() && mapping.columns.contains_key("t_s") {
        mapping.find(&table, "t_s")?;
    }
    let rate = mapping.sample_hz.or(how.declared_hz).filter(|hz| *hz > 0.0);
    let rate = rate.ok_or_else(|| LoadError::Mapping {
        origin: table.origin.clone(),
        reason: "how fast it was sampled is not known; give sample_hz in the mapping file".into(),
    })?;
    let layout = mapping.machine.columns();
    let raw = |name: &'static str, most: f64, (column, scale, offset): (usize, f64, f64)| {
        let keep = &keep;
        let table = &table;
        Raw {
            name,
            most,
            values: values(table, column, keep)
                .map(|value| value * scale + offset)
                .collect(),
            text: Box::new(move |row| {
                let row = keep.as_ref().map_or(row, |rows| rows[row - 1] + 1);
                table.text(column, row)
            }),
        }
    };
    let mut names = Vec::new();
    let mut columns = Vec::new();
    if let Some(found) = timed {
        columns.push(raw("t_s", 1e6, found));
    }
    for column in &layout {
        let found = match mapping.find(&table, column.name) {
            Err(_) if column.optional => continue,
            found => found?,
        };
        names.push(column.name);
        columns.push(raw(column.name, column.most(), found));
    }
    let constants = mapping
        .machine
        .constants()
        .iter()
        .map(|name| Ok((*name, mapping.constant(&table, name)?)))
        .collect::<Result<_, LoadError>>()?;
    let mut account = Account {
        file: table.origin.clone(),
        ..Account::default()
    };
    let timing = Timing {
        rate,
        clock: mapping.clock,
        timed: timed.is_some(),
    };
    let mut sifted = sift(&columns, &timing, how.on_fault, &mut account)?.into_iter();
    let time = sifted.next().unwrap_or_default();
    let mut columns: Vec<_> = std::iter::once("t_s")
        .chain(names)
        .zip(std::iter::once(time).chain(sifted))
        .collect();
    for absent in layout.iter().filter(|c| c.optional) {
        if columns.iter().all(|(name, _)| *name != absent.name) {
            columns.push((absent.name, vec![0.0; account.used]));
        }
    }
    Ok(Loaded {
        columns,
        constants,
        rate,
        account,
    })
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
    let table = Table::read(path, mapping.separator(), progress)?;
    let column = |name: &str| {
        let (column, scale, offset) = mapping.find(&table, name)?;
        match table.columns[column].iter().position(|v| !v.is_finite()) {
            Some(row) => Err(LoadError::Cell {
                origin: table.origin.clone(),
                row: row + 1,
                column: name.to_owned(),
                text: table.text(column, row + 1),
            }),
            None => Ok(table.columns[column]
                .iter()
                .map(|v| v * scale + offset)
                .collect()),
        }
    };
    Ok([column("position_rad")?, column("current_a")?])
}

/// The rows that a mapping asks for; `None` is all.
fn rows_that_count(table: &Table, mapping: &Mapping) -> Result<Option<Vec<usize>>, LoadError> {
    let Some(rows) = &mapping.rows else {
        return Ok(None);
    };
    let flag = &table.columns[table.find(&rows.column)?];
    Ok(Some(
        (0..flag.len())
            .filter(|row| flag[*row] == rows.equals)
            .collect(),
    ))
}

fn values<'a>(
    table: &'a Table,
    column: usize,
    keep: &'a Option<Vec<usize>>,
) -> Box<dyn Iterator<Item = f64> + 'a> {
    let all = &table.columns[column];
    match keep {
        Some(rows) => Box::new(
            rows.iter()
                .map(|row| all.get(*row).copied().unwrap_or(f64::NAN)),
        ),
        None => Box::new(all.iter().copied()),
    }
}

/// A double drive's record.
///
/// # Errors
/// An angle that does not turn as its speed reference asks: one of the units is wrong.
pub fn double_drive(mut loaded: Loaded) -> Result<Recording, LoadError> {
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
                origin: loaded.account.file.clone(),
                column: format!("{}_angle_rad", ["screw", "nut"][which.index()]),
                turned,
                asked,
            });
        }
    }
    Ok(Recording {
        time_s: loaded.take("t_s"),
        axes,
        table_position_m: loaded.take("table_position_m"),
    })
}
