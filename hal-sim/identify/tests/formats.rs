//! Logs as other tools write them, each through its mapping in `mappings/` or through none.

use identify::records::{How, Machine, Mapping, OnFault, Record, load};
use std::f64::consts::{PI, TAU};
use std::path::Path;

fn mapping(name: &str) -> Mapping {
    let path = Path::new("mappings").join(name);
    Mapping::load(&path).expect("a mapping of the project")
}

fn how(mapping: &Mapping) -> How<'_> {
    How {
        mapping,
        on_fault: OnFault::Refuse,
        declared_hz: None,
    }
}

/// The record of a file of given bytes.
fn read(name: &str, bytes: &[u8], mapping: &Mapping) -> Result<Record, String> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).expect("a temporary file");
    load(&path, how(mapping), &mut |_| ()).map_err(|error| error.to_string())
}

/// A motor's log of 3 s at 500 Hz: time, angle (2 rad/s), current.
fn rows() -> impl Iterator<Item = [f64; 3]> {
    (0..1500).map(|k| {
        let t = f64::from(k) * 2e-3;
        [t, 2.0 * t + 0.25, 0.3 + 0.1 * (12.0 * t).sin()]
    })
}

fn motor(more: &str) -> Mapping {
    let columns = "[columns]\nt_s = { number = 0 }\nposition_rad = { number = 1 }\ncurrent_a = { number = 2 }\n";
    let text = format!("machine = \"motor\"\n{more}{columns}");
    Mapping::parse(&text, "mapping.toml").expect("a mapping")
}

/// That it is the log of [`rows`], to half a unit of the last digit.
fn is_the_log(record: &Record, off: f64) {
    assert_eq!(record.len(), 1500);
    assert!((record.rate - 500.0).abs() < 0.01, "{}", record.rate);
    for (k, [_, angle, current]) in rows().enumerate() {
        assert!(
            (record.channel("position_rad")[k] - angle).abs() < off,
            "row {k}"
        );
        assert!(
            (record.channel("current_a")[k] - current).abs() < off,
            "row {k}"
        );
    }
}

fn said(record: &Record, word: &str) -> bool {
    record.quality.notes.iter().any(|note| note.contains(word))
}

fn text(separator: &str, cell: impl Fn(f64) -> String) -> String {
    rows()
        .map(|row| row.map(&cell).join(separator) + "\n")
        .collect()
}

#[test]
fn any_separator_and_a_decimal_comma() {
    let point = |v: f64| format!("{v:.6}");
    let comma = |v: f64| format!("{v:.6}").replace('.', ",");
    for (separator, spelled) in [
        (",", ""),
        (";", "`;`"),
        ("\t", "a tab"),
        ("|", "`|`"),
        ("  ", "spaces"),
    ] {
        let log = format!("t{separator}angle{separator}Iq\n{}", text(separator, point));
        let record = read("log.csv", log.as_bytes(), &motor("")).expect("a log");
        is_the_log(&record, 1e-6);
        assert!(
            spelled.is_empty() || said(&record, spelled),
            "{separator:?}: {:?}",
            record.quality.notes
        );
    }
    for separator in [";", "\t", " "] {
        let log = format!("t{separator}angle{separator}Iq\n{}", text(separator, comma));
        let record = read("log.csv", log.as_bytes(), &motor("")).expect("a log");
        is_the_log(&record, 1e-6);
        assert!(said(&record, "decimal comma"));
    }
    // A comma between the cells too: quotes tell them apart.
    let quoted = |v: f64| format!("\"{}\"", comma(v));
    let log = format!("t,angle,Iq\n{}", text(",", quoted));
    is_the_log(
        &read("log.csv", log.as_bytes(), &motor("separator = \",\"\n")).expect("quotes"),
        1e-6,
    );
}

/// Lines before the header, as an oscilloscope writes them, a row of units, and a unit with a name.
#[test]
fn a_scope_file() {
    let by_name = "machine = \"motor\"\n[columns]\nt_s = { name = \"TIME\" }\nposition_rad = { name = \"CH1\" }\n\
                   current_a = { name = \"CH2\" }\n";
    let by_name = Mapping::parse(by_name, "mapping.toml").expect("a mapping");
    let body: String = rows()
        .map(|[t, angle, current]| {
            let (ms, degrees, milli) = (1e3 * t, angle * 180.0 / PI, 1e3 * current);
            format!("{ms:.3},{degrees:.5},{milli:.4}\n")
        })
        .collect();
    let scope = format!(
        "Model,MDO3014\nFirmware Version,1.28\n\nWaveform Type,ANALOG\nRecord Length,1500\nLabel,,\n\nTIME,CH1,CH2\nms,deg,mA\n{body}"
    );
    let record = read("scope.csv", scope.as_bytes(), &by_name).expect("a scope's file");
    is_the_log(&record, 1e-6);
    assert!(
        said(&record, "row of units") && said(&record, "5 lines before"),
        "{:?}",
        record.quality.notes
    );
    let named = format!("TIME (ms),CH1 [deg],CH2 [mA]\n{body}");
    is_the_log(
        &read("scope.csv", named.as_bytes(), &by_name).expect("units in names"),
        1e-6,
    );
    // In the code page of a Windows logger, with a degree sign.
    let mut latin = b"Messger\xe4t 7\nTIME (ms),CH1 (\xb0),CH2 (mA)\n".to_vec();
    latin.extend(body.as_bytes());
    is_the_log(
        &read("scope.csv", &latin, &by_name).expect("Windows-1252"),
        1e-6,
    );
    let wide: Vec<u8> = std::iter::once(0xfeff)
        .chain(scope.encode_utf16())
        .flat_map(u16::to_le_bytes)
        .collect();
    is_the_log(&read("scope.csv", &wide, &by_name).expect("UTF-16"), 1e-6);
}

#[test]
fn a_column_twice_and_a_wrong_unit_are_told() {
    let log = format!("t,Iq,Iq\n{}", text(",", |v| v.to_string()));
    let twice = "machine = \"motor\"\n[columns]\nt_s = { name = \"t\" }\nposition_rad = { name = \"Iq\" }\ncurrent_a = { number = 2 }\n";
    let twice = Mapping::parse(twice, "mapping.toml").expect("a mapping");
    let error = read("log.csv", log.as_bytes(), &twice).unwrap_err();
    assert!(error.contains("there twice"), "{error}");
    let log = format!("t (s),angle (mm),Iq (A)\n{}", text(",", |v| v.to_string()));
    let error = read("log.csv", log.as_bytes(), &motor("")).unwrap_err();
    assert!(error.contains("mm") && error.contains("rad"), "{error}");
}

#[test]
fn rows_and_scales_of_one_file() {
    let log = text(",", |v| v.to_string());
    let mapping = "machine = \"motor\"\n[columns]\nt_s = { number = 0 }\nposition_rad = { number = 1 }\ncurrent_a = { number = 2 }\n\
                   [files.\"check*\"]\nrows = { from_s = 0.5, to_s = 2.9 }\n[files.\"check*\".columns]\ncurrent_a = { number = 2, scale = 2.0 }\n";
    let mapping = Mapping::parse(mapping, "mapping.toml").expect("a mapping");
    is_the_log(
        &read("fit.csv", log.as_bytes(), &mapping).expect("a log"),
        1e-9,
    );
    let check = read("check_1.csv", log.as_bytes(), &mapping).expect("a log");
    assert_eq!(check.len(), 1201);
    let current = rows().nth(250).expect("rows")[2];
    assert!((check.channel("current_a")[0] - 2.0 * current).abs() < 1e-9);
}

/// A drive's log whose time jitters, and one without position.
#[test]
fn uneven_times_and_speed_only() {
    let mut log = String::from("t,speed\tis not,Iq\n");
    let mut t = 0.0;
    for k in 0..2000 {
        t += 2e-3 * (1.0 + 0.8 * (f64::from(k) * 12.9898).sin());
        log += &format!("{t:.6},{},{}\n", 60.0 / TAU * 2.0, 0.3);
    }
    let mapping = "machine = \"motor\"\nseparator = \",\"\n[columns]\nt_s = { number = 0 }\nspeed_rad_s = { number = 1, unit = \"rpm\" }\n\
                   current_a = { number = 2 }\n";
    let mapping = Mapping::parse(mapping, "mapping.toml").expect("a mapping");
    let record = read("log.csv", log.as_bytes(), &mapping).expect("a log");
    assert!(
        said(&record, "uneven") && said(&record, "integral"),
        "{:?}",
        record.quality.notes
    );
    let angle = record.channel("position_rad");
    let turned = angle[angle.len() - 1] - angle[0];
    let seconds = (angle.len() - 1) as f64 / record.rate;
    assert!(
        (turned - 2.0 * seconds).abs() < 1e-6,
        "{turned} in {seconds} s"
    );
}

/// MATLAB's element of a type: tag, data, padding.
fn element(kind: u32, data: &[u8]) -> Vec<u8> {
    let mut bytes = [kind.to_le_bytes(), (data.len() as u32).to_le_bytes()].concat();
    bytes.extend(data);
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    bytes
}

fn array(class: u32, sides: [u32; 2], name: &str, rest: &[Vec<u8>]) -> Vec<u8> {
    let words = |words: [u32; 2]| words.map(u32::to_le_bytes).concat();
    let mut body = element(6, &words([class, 0]));
    body.extend(element(5, &words(sides)));
    body.extend(element(1, name.as_bytes()));
    rest.iter().for_each(|part| body.extend(part));
    element(14, &body)
}

fn doubles(values: impl Iterator<Item = f64>) -> Vec<u8> {
    element(9, &values.flat_map(f64::to_le_bytes).collect::<Vec<_>>())
}

fn mat(variables: &[Vec<u8>]) -> Vec<u8> {
    let mut file = vec![b' '; 124];
    file[..10].copy_from_slice(b"MATLAB 5.0");
    file.extend([0x00, 0x01, b'I', b'M']);
    variables.iter().for_each(|variable| file.extend(variable));
    file
}

#[test]
fn matlab_matrices_structs_and_arrays_of_structs() {
    let mapping = |of: [&str; 3]| {
        let [t, angle, current] = of.map(|path| format!("{{ name = \"{path}\" }}"));
        let text = format!(
            "machine = \"motor\"\n[columns]\nt_s = {t}\nposition_rad = {angle}\ncurrent_a = {current}\n"
        );
        Mapping::parse(&text, "mapping.toml").expect("a mapping")
    };
    let column = |k: usize| doubles(rows().map(move |row| row[k]));
    let vector = |k: usize| array(6, [1500, 1], "", &[column(k)]);
    // Channels in the rows of a matrix: MATLAB lays its columns one behind the other.
    let wide = array(6, [3, 1500], "data", &[doubles(rows().flatten())]);
    let record = read(
        "log.mat",
        &mat(&[wide]),
        &mapping(["data.0", "data.1", "data.2"]),
    )
    .expect("a matrix");
    is_the_log(&record, 1e-12);
    assert!(said(&record, "rows are taken as channels"));
    let mut names = Vec::new();
    for name in ["t", "theta", "iq"] {
        let mut field = name.as_bytes().to_vec();
        field.resize(8, 0);
        names.extend(field);
    }
    let fields = [element(5, &8u32.to_le_bytes()), element(1, &names)];
    let one = array(
        2,
        [1, 1],
        "log",
        &[&fields[..], &[vector(0), vector(1), vector(2)]].concat(),
    );
    let paths = ["log.t", "log.theta", "log.iq"];
    is_the_log(
        &read("log.mat", &mat(std::slice::from_ref(&one)), &mapping(paths)).expect("a struct"),
        1e-12,
    );
    // The same, compressed, as `save -v7` does.
    let mut zip = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut zip, &one).expect("memory");
    let data = zip.finish().expect("memory");
    let mut packed = [15u32.to_le_bytes(), (data.len() as u32).to_le_bytes()].concat();
    packed.extend(&data);
    is_the_log(
        &read("log.mat", &mat(&[packed]), &mapping(paths)).expect("compressed"),
        1e-12,
    );
    // Two records in an array of structs.
    let several = array(
        2,
        [1, 2],
        "data",
        &[
            &fields[..],
            &[
                vector(2),
                vector(2),
                vector(2),
                vector(0),
                vector(1),
                vector(2),
            ],
        ]
        .concat(),
    );
    let paths = ["data.1.t", "data.1.theta", "data.1.iq"];
    is_the_log(
        &read("log.mat", &mat(&[several]), &mapping(paths)).expect("structs"),
        1e-12,
    );
    // A struct a row.
    let number = |v: f64| array(6, [1, 1], "", &[doubles(std::iter::once(v))]);
    let each: Vec<Vec<u8>> = rows().flatten().map(number).collect();
    let row_by_row = array(2, [1, 1500], "s", &[fields.to_vec(), each].concat());
    let paths = ["s.t", "s.theta", "s.iq"];
    is_the_log(
        &read("log.mat", &mat(&[row_by_row]), &mapping(paths)).expect("a struct a row"),
        1e-12,
    );
    let error = read("log.mat", b"MATLAB 7.3 MAT-file", &mapping(paths)).unwrap_err();
    assert!(error.contains("-v7"), "{error}");
}

fn npy(sides: &str, values: impl Iterator<Item = f64>) -> Vec<u8> {
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {sides}, }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(values.flat_map(f64::to_le_bytes));
    bytes
}

#[test]
fn numpy_arrays_alone_and_zipped() {
    let tall = npy("(1500, 3)", rows().flatten());
    is_the_log(&read("log.npy", &tall, &motor("")).expect("rows"), 1e-12);
    let wide = npy(
        "(3, 1500)",
        (0..3).flat_map(|k| rows().map(move |row| row[k])),
    );
    // The first bytes tell the format, whatever the name.
    is_the_log(&read("log.bin", &wide, &motor("")).expect("columns"), 1e-12);
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (k, name) in ["t", "theta", "iq"].into_iter().enumerate() {
        let options = zip::write::SimpleFileOptions::default();
        zip.start_file(format!("{name}.npy"), options)
            .expect("memory");
        let member = npy("(1500,)", rows().map(|row| row[k]));
        std::io::Write::write_all(&mut zip, &member).expect("memory");
    }
    let bytes = zip.finish().expect("memory").into_inner();
    let text = "machine = \"motor\"\n[columns]\nt_s = { name = \"t\" }\nposition_rad = { name = \"theta\" }\ncurrent_a = { name = \"iq\" }\n";
    let named = Mapping::parse(text, "mapping.toml").expect("a mapping");
    is_the_log(&read("log.npz", &bytes, &named).expect("an npz"), 1e-12);
}

/// ODrive: a BulkCapture saved by numpy, of a current firmware and of one that counts.
#[test]
fn an_odrive_capture() {
    let counts = |angle: f64| (angle * 8192.0 / TAU).rem_euclid(8192.0);
    let capture = npy(
        "(1500, 3)",
        rows().flat_map(|[t, angle, i]| [t, counts(angle), i]),
    );
    is_the_log(
        &read("capture.npy", &capture, &mapping("odrive.toml")).expect("a capture"),
        1e-9,
    );
    // As numpy.savetxt writes it.
    let log: String = rows()
        .map(|[t, angle, i]| format!("{t:.18e} {:.18e} {i:.18e}\n", counts(angle)))
        .collect();
    is_the_log(
        &read("capture.txt", log.as_bytes(), &mapping("odrive.toml")).expect("a text"),
        1e-9,
    );
}

/// moteus: csv_output.py of its Python library. A mode is a number or a word.
#[test]
fn a_moteus_log() {
    let mut log = String::from(
        "time,MODE,POSITION,VELOCITY,TORQUE,Q_CURRENT,D_CURRENT,VOLTAGE,TEMPERATURE,FAULT\n",
    );
    for [t, angle, current] in rows() {
        log += &format!(
            "{t},10,{},{},0.02,{},{},24.0,31.5,0\n",
            angle / TAU,
            2.0 / TAU,
            current,
            -0.01
        );
    }
    let record = read("output.csv", log.as_bytes(), &mapping("moteus.toml")).expect("a log");
    assert_eq!(record.machine, Machine::Pmsm);
    for (k, [_, angle, current]) in rows().enumerate() {
        assert!((record.channel("angle_rad")[k] - angle).abs() < 1e-9);
        let invariant = 1.5f64.sqrt() * current;
        assert!((record.channel("iq_a")[k] - invariant).abs() < 1e-9);
        assert!((record.channel("speed_rad_s")[k] - 2.0).abs() < 1e-9);
    }
}

/// VESC Tool's header is of 54 names, each with a semicolon behind it, and so are its rows.
#[test]
fn a_vesc_log() {
    const NAMES: &str = "ms_today;input_voltage;temp_mos_max;temp_mos_1;temp_mos_2;temp_mos_3;temp_motor;current_motor;\
        current_in;d_axis_current;q_axis_current;erpm;duty_cycle;amp_hours_used;amp_hours_charged;watt_hours_used;\
        watt_hours_charged;tachometer;tachometer_abs;encoder_position;fault_code;vesc_id;d_axis_voltage;q_axis_voltage;\
        ms_today_setup;amp_hours_setup;amp_hours_charged_setup;watt_hours_setup;watt_hours_charged_setup;battery_level;\
        battery_wh_tot;current_in_setup;current_motor_setup;speed_meters_per_sec;tacho_meters;tacho_abs_meters;num_vescs;\
        ms_today_imu;roll;pitch;yaw;accX;accY;accZ;gyroX;gyroY;gyroZ;gnss_posTime;gnss_lat;gnss_lon;gnss_alt;gnss_gVel;\
        gnss_vVel;gnss_hAcc;gnss_vAcc;";
    let names: Vec<&str> = NAMES.trim_end_matches(';').split(';').collect();
    let mut log = format!("{NAMES}\n");
    for k in 0..150 {
        let t = f64::from(k) * 0.02;
        let angle = 2.0 * t + 0.25;
        for name in &names {
            let value = match *name {
                "ms_today" => 36_000_000.0 + 1e3 * t,
                "input_voltage" => 48.2,
                "erpm" => 7.0 * 2.0 * 60.0 / TAU,
                "encoder_position" => (angle * 180.0 / PI).rem_euclid(360.0),
                "q_axis_current" => 1.5,
                "q_axis_voltage" => 4.0,
                _ => 0.0,
            };
            log += &format!("{value};");
        }
        log += "\n";
    }
    let record = read("log.csv", log.as_bytes(), &mapping("vesc.toml")).expect("a log");
    assert_eq!(record.len(), 150);
    assert!((record.rate - 50.0).abs() < 0.01, "{}", record.rate);
    for k in 0..150 {
        let angle = 2.0 * 0.02 * k as f64 + 0.25;
        assert!((record.channel("angle_rad")[k] - angle).abs() < 1e-6);
        assert!((record.channel("speed_rad_s")[k] - 2.0).abs() < 1e-9);
        assert!((record.channel("uq_v")[k] - 4.0 * 1.5f64.sqrt()).abs() < 1e-9);
    }
}

/// SimpleFOC: what motor.monitor() prints after what its initialisation says; no header, no time.
#[test]
fn a_simplefoc_log() {
    let mut log = String::from(
        "MOT: Monitor enabled!\nMOT: Init\nMOT: Enable driver.\nMOT: Align sensor.\nMOT: sensor direction==CW\n\
         MOT: PP check: OK!\nMOT: Zero elec. angle: 4.28\nMOT: Ready.\n",
    );
    for k in 0..400 {
        let angle = 2.0 * f64::from(k) / 100.0;
        log += &format!("2.0000\t1.2000\t0.0300\t350.0000\t-4.0000\t2.0000\t{angle:.4}\r\n");
    }
    let record = read("monitor.txt", log.as_bytes(), &mapping("simplefoc.toml")).expect("a log");
    assert_eq!(record.len(), 400);
    assert!((record.channel("iq_a")[9] - 0.35 * 1.5f64.sqrt()).abs() < 1e-9);
    assert!((record.channel("angle_rad")[100] - 2.0).abs() < 1e-9);
    assert!(said(&record, "no header"), "{:?}", record.quality.notes);
}
