//! A drive's telemetry as a folder of the format of the shared recordings: `NAME.csv.gz` and `model.toml`.

use crate::output::Folder;
use crate::trigger::Gate;
use anyhow::{Context, Result, bail, ensure};
use commission::{Estimate, electrical::MotorElectrical};
use link::host::{Count, Decoder, MotorRow, Row};
use link::message::Aligned;
use link::settings::Settings;
use link::telemetry::{Header, Request};
use plant::model::{EncoderKind, MeasuredFeed, MeasuredModel, MeasuredMotor, Model, SensingModel};
use plant::recording::{AxisSample, RecordingWriter, Sample};
use std::f64::consts::TAU;
use std::fmt;

/// What a recording became.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// How the stream went.
    pub count: Count,
    /// From the first row to the last, s.
    pub seconds: f64,
    /// From row to row, s.
    pub interval_s: f64,
    /// The longest stretch without a gap, s.
    pub whole_s: f64,
    /// Bytes that came.
    pub bytes: u64,
}

/// Takes a stream's bytes and writes its rows.
pub struct Recorder {
    writer: RecordingWriter,
    decoder: Option<Decoder>,
    encoders: [EncoderFrame; 2],
    bus_v: f64,
    rate_hz: f64,
    bytes: u64,
    first_s: Option<f64>,
    last_s: f64,
    whole_from_s: f64,
    whole_s: f64,
    gate: Option<Gate>,
    /// When the gate opened.
    opened_s: Option<f64>,
    /// Rows that were written.
    written: u64,
}

impl Recorder {
    /// How the stream went so far.
    #[must_use]
    pub fn count(&self) -> Count {
        self.decoder
            .as_ref()
            .map_or_else(Count::default, Decoder::count)
    }

    /// Seconds from the first row to the last.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.first_s.map_or(0.0, |first| self.last_s - first)
    }

    fn new(writer: RecordingWriter, rate_hz: f64) -> Self {
        Self {
            writer,
            decoder: None,
            encoders: [EncoderFrame::default(); 2],
            bus_v: 0.0,
            rate_hz,
            bytes: 0,
            first_s: None,
            last_s: 0.0,
            whole_from_s: 0.0,
            whole_s: 0.0,
            gate: None,
            opened_s: None,
            written: 0,
        }
    }

    /// Nothing is written until `gate` opens.
    pub fn wait_for(&mut self, gate: Gate) {
        self.gate = Some(gate);
    }

    /// Seconds since the stream's first row, written or not.
    #[must_use]
    pub fn streamed_s(&self) -> f64 {
        self.last_s
    }

    /// Seconds since the gate opened, if it has.
    #[must_use]
    pub fn since_trigger_s(&self) -> Option<f64> {
        self.opened_s.map(|opened| self.last_s - opened)
    }

    /// The gate that is waited for; `None` once it has opened.
    pub fn gate(&mut self) -> Option<&mut Gate> {
        self.gate.as_mut()
    }

    /// The stream of `request` is to come.
    pub fn start(&mut self, request: Request) {
        self.decoder = Some(Decoder::new(request));
    }

    /// How the encoders of screw and nut lead to their rotors' angles, which are written.
    pub fn align(&mut self, encoders: [EncoderFrame; 2]) {
        self.encoders = encoders;
    }

    /// The supply that the drive read before the stream, V.
    pub fn supplied(&mut self, bus_v: f64) {
        self.bus_v = bus_v;
    }

    /// Takes what came, in pieces of any length.
    ///
    /// # Errors
    /// The rows cannot be written, or come at another rate than asked.
    pub fn take(&mut self, bytes: &[u8]) -> Result<()> {
        let Self {
            writer,
            decoder,
            encoders,
            first_s,
            last_s,
            whole_from_s,
            whole_s,
            gate,
            opened_s,
            written,
            ..
        } = self;
        let Some(decoder) = decoder else {
            return Ok(());
        };
        self.bytes += bytes.len() as u64;
        let known = decoder.header().is_some();
        decoder.take(bytes, |header, row| {
            if first_s.is_none() || row.lost > 0 {
                *whole_from_s = row.time_s;
            }
            first_s.get_or_insert(row.time_s);
            *last_s = row.time_s;
            *whole_s = whole_s.max(row.time_s - *whole_from_s);
            let sample = sample(header, row, *encoders);
            let Some(waiting) = gate else {
                *written += 1;
                return writer.write(&sample);
            };
            if !waiting.take(sample) {
                return Ok(());
            }
            let rows = gate.take().map(Gate::into_rows).unwrap_or_default();
            *opened_s = Some(row.time_s);
            *first_s = rows.front().map(|first| first.time_s);
            *whole_from_s = whole_from_s.max(first_s.unwrap_or_default());
            *whole_s = row.time_s - *whole_from_s;
            *written = rows.len() as u64;
            rows.iter().try_for_each(|sample| writer.write(sample))
        })?;
        if let (false, Some(interval)) = (known, decoder.interval_s()) {
            let rate = 1.0 / interval;
            ensure!(
                (rate / self.rate_hz - 1.0).abs() < 0.01,
                "this drive sends {rate:.0} samples a second when asked for {:.0}: its speed task has another rate; ask \
                 for a rate that divides it",
                self.rate_hz
            );
        }
        Ok(())
    }
}

/// Records into `folder`, at `rate_hz`: `stream` starts the drive's telemetry, tells the recorder its request, and feeds
/// what comes. Whatever ends it, what came before is kept; its own error is given back beside it.
///
/// # Errors
/// Nothing could be recorded: `stream`'s error if it has one, or a file that cannot be written.
pub fn save(
    folder: &Folder,
    name: &str,
    rate_hz: f64,
    stream: impl FnOnce(&mut Recorder) -> Result<()>,
) -> Result<(Summary, Result<()>)> {
    let mut ended = None;
    folder.put(&format!("{name}.csv.gz"), |path| {
        let mut recorder = Recorder::new(RecordingWriter::create(path)?, rate_hz);
        let outcome = stream(&mut recorder);
        let seconds = recorder.seconds();
        let count = Count {
            rows: recorder.written,
            ..recorder.count()
        };
        recorder.writer.finish()?;
        let bus_v = recorder.bus_v;
        let decoder = recorder.decoder.filter(|_| count.rows > 0);
        let known = decoder.and_then(|d| Some((*d.header()?, d.interval_s()?)));
        let Some((header, interval_s)) = known else {
            outcome?;
            ensure!(
                recorder.gate.is_none(),
                "the trigger did not fire, and nothing was written"
            );
            bail!("the drive sent no telemetry: does the firmware run? `cargo xtask attach` shows its state");
        };
        let summary = Summary {
            count,
            seconds,
            interval_s,
            whole_s: recorder.whole_s,
            bytes: recorder.bytes,
        };
        ended = Some((summary, outcome, header, bus_v));
        Ok(())
    })?;
    let (summary, outcome, header, bus_v) = ended.context("the recording did not end")?;
    let path = folder.path("model.toml");
    let kept = std::fs::read_to_string(&path);
    if kept.is_ok_and(|text| !is_as_written(&text)) {
        eprintln!(
            "{} is a person's own or was corrected, and stays as it is",
            path.display()
        );
    } else {
        let model = model_file(&header, summary.interval_s, bus_v);
        folder.put_text("model.toml", &model)?;
        eprintln!(
            "load and friction of {} are guesses: correct them, or take the model of a commissioning",
            path.display()
        );
    }
    Ok((summary, outcome))
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Count {
            rows,
            lost,
            gaps,
            damaged,
        } = self.count;
        let each = self.bytes as f64 / rows as f64;
        write!(
            f,
            "{rows} samples over {:.2} s, {:.0} a second of {each:.1} bytes ({:.0} kB/s)",
            self.seconds,
            1.0 / self.interval_s,
            each / self.interval_s / 1e3
        )?;
        if lost == 0 && damaged == 0 {
            return write!(f, "; none lost");
        }
        write!(
            f,
            "; {lost} lost in {gaps} gaps, {damaged} damaged. The longest stretch without a gap is {:.2} s; `identify` \
             refuses gaps: record again at a lower --rate, or with less else on the computer",
            self.whole_s
        )
    }
}

/// What stands above the model that a recording comes with.
const ABOUT: &str = "\
# Motors, lead, sensing and the scale's count are the drive's own plate; the supply is as the drive measured it.
# What a drive does not know before a commissioning is of the size of common feed axes: load, friction, the table's mass, stiffness and
# guideway, travel, brake, and the sensors' noise. Put your machine's own figures in before you trust what an identification makes of
# them, or commission the drive.
";

/// Before the check sum of all that follows it.
const CHECK_SUM: &str =
    "# By this check sum of the rest a new recording knows that nobody corrected it: ";

fn check_sum(text: &str) -> String {
    let mut sum = flate2::Crc::new();
    sum.update(text.as_bytes());
    format!("{:08x}", sum.sum())
}

/// Whether a model file is a recording's, and nobody has changed it since.
fn is_as_written(text: &str) -> bool {
    let rest = text
        .strip_prefix(ABOUT)
        .and_then(|text| text.strip_prefix(CHECK_SUM));
    let parts = rest.and_then(|rest| rest.split_once('\n'));
    parts.is_some_and(|(sum, model)| sum == check_sum(model))
}

/// The text of the `model.toml` of a drive on a supply of `bus_v`, whose recordings have a row each `interval_s`.
#[must_use]
pub fn model_file(header: &Header, interval_s: f64, bus_v: f64) -> String {
    let model = model(header, interval_s, bus_v).to_toml();
    format!("{ABOUT}{CHECK_SUM}{}\n{model}", check_sum(&model))
}

/// The model that the drive's plate declares on a supply of `bus_v`; what the plate does not have is of the size of common feed axes.
#[must_use]
pub fn model(header: &Header, interval_s: f64, bus_v: f64) -> Model {
    let mut model = Model::coupled();
    // A drive whose supply is off reads nothing.
    if bus_v > 0.0 {
        model.installation.bus_v = bus_v;
    }
    model.installation.scale_count_m = header.scale_count_m.get();
    model.feed.lead_m = header.lead_m.get();
    let travel = model.feed.travel_per_radian();
    let table = model.feed.table_mass_kg * travel * travel;
    let [screw, nut] = &header.motors;
    for (motor, plate) in [(&mut model.screw, screw), (&mut model.nut, nut)] {
        motor.resistance_ohm = plate.resistance_ohm.get();
        motor.inductance_h = plate.inductance_h.get();
        motor.pole_pairs = plate.pole_pairs;
        motor.flux_wb = plate.flux_wb.get();
        // The plate's inertia is all that the motor moves; the model has the table's part by itself.
        let moved = plate.inertia_kg_m2.get();
        motor.inertia_kg_m2 = if moved > table { moved - table } else { moved };
        motor.torque_harmonics.clear();
    }
    model.sensing.sample_hz = 1.0 / interval_s;
    model.sensing.control_hz = 1.0 / header.period_s.get();
    model.sensing.encoder_counts_per_turn = screw.encoder_counts;
    model.sensing.nut_encoder_counts_per_turn =
        Some(nut.encoder_counts).filter(|counts| *counts != screw.encoder_counts);
    model.sensing.current_lsb_a = header.current_lsb_a.get();
    set_encoder_kinds(&mut model.sensing, [screw.encoder, nut.encoder]);
    model
}

/// Sets what the encoders of screw and nut know when power comes up.
pub fn set_encoder_kinds(sensing: &mut SensingModel, encoders: [link::telemetry::EncoderKind; 2]) {
    use link::telemetry::EncoderKind::{Absolute, Incremental, Index};
    let [screw, nut] = encoders.map(|encoder| match encoder {
        Incremental => EncoderKind::Incremental,
        Index => EncoderKind::Index,
        Absolute => EncoderKind::Absolute,
    });
    (sensing.encoder, sensing.nut_encoder) = (screw, Some(nut).filter(|nut| *nut != screw));
}

/// What stands above the model of a commissioned drive.
const MEASURED: &str = "\
# Motors, friction, load, supply and the table's mass as a commissioning measured them; lead and sensing are the drive's own plate.
# Friction of ball pair and guideway was measured together and stands at the pair. Damping and the sensors' noise were not measured.
";
const STIFFNESS_MEASURED: &str =
    "# The stiffness is by the axial resonance that the scale showed.\n";
const STIFFNESS_GUESSED: &str =
    "# The stiffness is a guess: the scale showed no axial resonance. Correct it if you know it.\n";

/// The text of the `model.toml` of a drive that was commissioned.
#[must_use]
pub fn measured_model_file(
    header: &Header,
    interval_s: f64,
    machine: &commission::procedure::Machine,
    motors: &[MotorElectrical; 2],
    bus_v: f64,
) -> String {
    let mut model = model(header, interval_s, bus_v);
    let travel = model.feed.travel_per_radian();
    // A model has no friction and no mass below nothing, where a measurement's noise may be.
    let least = |value: f64| value.max(0.0);
    let table = machine.table_kg_m2.max(1e-9);
    for (k, (motor, plate)) in [&mut model.screw, &mut model.nut]
        .into_iter()
        .zip(&header.motors)
        .enumerate()
    {
        let moved = plate.inertia_kg_m2.get();
        motor.inertia_kg_m2 = if moved > table { moved - table } else { moved };
        motor.coulomb_nm = least(machine.coulomb_nm[k]);
        motor.viscous_nm_s = least(machine.viscous_nm_s[k]);
    }
    let inertias = [model.screw.inertia_kg_m2, model.nut.inertia_kg_m2];
    let [screw, nut] = [0, 1].map(|k| {
        let inertia = machine.inertia_plus_minus_kg_m2[k] / inertias[k];
        let part = |estimate: Estimate| estimate.plus_minus / estimate.value;
        MeasuredMotor {
            resistance: part(motors[k].resistance_ohm),
            inductance: part(motors[k].inductance_h),
            flux: part(motors[k].flux_wb),
            inertia,
        }
    });
    // Without the resonance the table's share of a torque is not known at any frequency.
    let feed = machine.axial_hz.map(|_| MeasuredFeed {
        table_mass: machine.table_plus_minus_kg_m2 / table,
    });
    model.measured = Some(MeasuredModel { screw, nut, feed });
    let feed = &mut model.feed;
    feed.table_mass_kg = table / (travel * travel);
    feed.pair_coulomb_nm = least(machine.feed_coulomb_nm);
    feed.guideway_coulomb_n = 0.0;
    feed.guideway_viscous_n_s_per_m = least(machine.feed_viscous_nm_s) / (travel * travel);
    feed.load_n = machine.load_nm / travel;
    let stiffness = match machine.axial_hz {
        Some(hz) => {
            feed.axial_stiffness_n_per_m = feed.table_mass_kg * (TAU * hz).powi(2);
            STIFFNESS_MEASURED
        }
        None => STIFFNESS_GUESSED,
    };
    format!("{MEASURED}{stiffness}{}", model.to_toml())
}

/// How an encoder's reading leads to the rotor's angle at the instant of the currents.
#[derive(Clone, Copy, Debug, Default)]
pub struct EncoderFrame {
    /// How the encoder lies to its rotor.
    pub aligned: Aligned,
    /// How much earlier than the currents it is read, s.
    pub age_s: f64,
}

impl EncoderFrame {
    /// Of both motors of a drive.
    #[must_use]
    pub fn both(aligned: [Aligned; 2], settings: &Settings) -> [Self; 2] {
        let ages = [&settings.screw, &settings.nut].map(|motor| 1e-6 * motor.encoder.age_us);
        [0, 1].map(|k| Self {
            aligned: aligned[k],
            age_s: ages[k],
        })
    }
}

/// A row as a recording has it, with the rotors' angles at the instant of their currents.
///
/// The nut's values are half a PWM period older than the screw's: its timer runs that much apart. The identification finds such lags.
#[must_use]
pub fn sample(header: &Header, row: &Row, encoders: [EncoderFrame; 2]) -> Sample {
    let angle = |k: usize, motor: &MotorRow| {
        let EncoderFrame { aligned, age_s } = encoders[k];
        // A motor follows its reference closely: the residual of a few microseconds is far below a count.
        aligned.rotor_angle(motor.angle_rad, header.motors[k].pole_pairs)
            + age_s * motor.speed_ref_rad_s
    };
    let axis = |k: usize, motor: &MotorRow| AxisSample {
        angle_rad: angle(k, motor),
        ia_a: motor.phases_a[0],
        ib_a: motor.phases_a[1],
        ud_v: motor.voltage_v[0],
        uq_v: motor.voltage_v[1],
        iq_ref_a: motor.i_q_ref_a,
        speed_ref_rad_s: motor.speed_ref_rad_s,
    };
    let [screw, nut] = &row.motors;
    Sample {
        time_s: row.time_s,
        axes: [axis(0, screw), axis(1, nut)],
        table_position_m: row.table_m,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_that_a_person_corrected_is_known() {
        let model = "[feed]\nload_n = 400.0\n";
        let written = format!("{ABOUT}{CHECK_SUM}{}\n{model}", check_sum(model));
        assert!(is_as_written(&written));
        for own in [
            written.replace("400", "123"),
            format!("{written}# mine\n"),
            format!("{ABOUT}{model}"),
            model.into(),
            String::new(),
        ] {
            assert!(!is_as_written(&own), "{own}");
        }
    }
}
