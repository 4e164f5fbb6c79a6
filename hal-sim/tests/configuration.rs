//! The configuration of the drive stays the same, bit for bit, for settings that exist.
//!
//! A digest changes only with a formula or a format of the configuration. The commit that changes it says which.

mod digest;

use digest::Digest;
use hal_sim::boards::BoardKind;
use link::settings::{Setting, Settings, Value};
use std::fmt::Debug;

/// Digest of the values in a debug text. Names of types and fields do not count.
fn digest(of: &impl Debug) -> u64 {
    let text = format!("{of:?}");
    let words = text.split(|c: char| !(c.is_alphanumeric() || c == '-' || c == '.'));
    let is_value = |word: &&str| {
        word.starts_with(|c: char| c.is_ascii_digit() || c == '-')
            || ["true", "false", "None", "Some"].contains(word)
    };
    let bytes = words
        .filter(is_value)
        .flat_map(|word| word.bytes().chain([b' ']));
    let mut digest = Digest::EMPTY;
    digest.add(bytes);
    digest.0
}

#[test]
fn the_boards_configurations_stay() {
    let boards = [BoardKind::Nucleo, BoardKind::Nucleo40kHz, BoardKind::Mains];
    let measured = boards.map(|board| {
        let plate = board.plate();
        [
            digest(&plate.config().unwrap()),
            digest(&board.guards().config().unwrap()),
            digest(&plate.travel_config()),
        ]
    });
    let expected = [
        [
            0x4e6f_5c10_65c1_0f2b,
            0x4359_3a24_e95d_23dc,
            0xb629_1f5b_aef8_23e6,
        ],
        [
            0x28c4_8271_11d8_851b,
            0x4359_3a24_e95d_23dc,
            0xb629_1f5b_aef8_23e6,
        ],
        [
            0xf4af_3998_d152_6baa,
            0xb9d5_0739_5b6b_06b2,
            0xd80a_8929_da2b_4d92,
        ],
    ];
    assert_eq!(measured, expected, "measured {measured:#x?}");
}

/// SplitMix64 (Steele et al. 2014).
struct Random(u64);

impl Random {
    fn word(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn within(&mut self, least: f64, most: f64) -> f64 {
        least + (most - least) * (self.word() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn below(&mut self, end: u64) -> u64 {
        self.word() % end
    }
}

fn put(settings: &mut Settings, name: &str, value: Value) {
    let setting = Setting::named(name).unwrap();
    settings.set(setting.id, value).unwrap();
}

/// Settings near the defaults, with orders, a table of base speeds and soft limits in some of them.
fn drawn(random: &mut Random, board: BoardKind) -> Settings {
    let mut settings = Settings::DEFAULT;
    let real = |x: f64| Value::Real(x);
    // Of a bus, the voltage of the board's tests.
    for (name, part) in [
        ("bridge.bus_min_v", 0.1),
        ("bridge.brake_fade_from_v", 1.19),
        ("bridge.brake_fade_to_v", 1.23),
    ] {
        put(&mut settings, name, real(part * board.bus_v()));
    }
    for setting in Settings::all() {
        if random.below(4) > 0 {
            continue;
        }
        let value = match settings.get(setting.id).unwrap() {
            Value::Real(x) => real(x * random.within(0.97, 1.03)),
            Value::Whole(x) => Value::Whole(x + random.below(3) as u32),
            Value::Choice(_) => Value::Choice(random.below(2) as u8),
        };
        // A value beyond its range leaves the default.
        let _ = settings.set(setting.id, value);
    }
    for group in ["screw_torque", "nut_torque"] {
        for k in 1..=random.below(9) {
            let order = 1 + random.below(36);
            put(
                &mut settings,
                &format!("{group}.order_{k}"),
                real(order as f64),
            );
            put(
                &mut settings,
                &format!("{group}.re_{k}_a"),
                real(random.within(-0.1, 0.1)),
            );
            put(
                &mut settings,
                &format!("{group}.im_{k}_a"),
                real(random.within(-0.1, 0.1)),
            );
        }
    }
    for group in ["screw_encoder", "nut_encoder", "lead"] {
        for k in 1..=random.below(3) {
            put(&mut settings, &format!("{group}.order_{k}"), real(k as f64));
            put(
                &mut settings,
                &format!("{group}.re_{k}"),
                real(random.within(-0.01, 0.01)),
            );
            put(
                &mut settings,
                &format!("{group}.im_{k}"),
                real(random.within(-0.01, 0.01)),
            );
        }
    }
    let mut table = 0.0;
    for k in 1..=random.below(9) {
        table += random.within(0.1, 8.0);
        put(&mut settings, &format!("base.table_{k}_mm_s"), real(table));
        put(
            &mut settings,
            &format!("base.nut_{k}_rpm"),
            real(random.within(-900.0, 900.0)),
        );
    }
    for group in ["screw_friction", "nut_friction", "feed_friction"] {
        if random.below(2) == 0 {
            put(
                &mut settings,
                &format!("{group}.coulomb_nm"),
                real(random.within(0.001, 0.1)),
            );
            put(
                &mut settings,
                &format!("{group}.sticks_nm"),
                real(random.within(0.0, 0.05)),
            );
        }
    }
    for (name, most) in [
        ("rejection.notch_hz", 900.0),
        ("rejection.disturbance_rad_s", 80.0),
        ("compensation.learning_s", 2.0),
        ("travel.soft_most_mm", 300.0),
        ("bridge.dead_time_ns", 900.0),
        ("base.wander_rpm", 90.0),
    ] {
        if random.below(2) == 0 {
            put(&mut settings, name, real(random.within(0.3 * most, most)));
        }
    }
    settings
}

#[test]
fn the_configurations_of_drawn_settings_stay() {
    let measured = [BoardKind::Nucleo, BoardKind::Mains].map(|board| {
        let mut random = Random(29);
        let (mut draws, mut all, mut misfit) = (0, Vec::new(), None);
        while all.len() < 200 {
            draws += 1;
            let fitting = all.len();
            assert!(
                draws < 2000,
                "{fitting} of 200 drawn settings fit: {misfit:?}"
            );
            let settings = drawn(&mut random, board);
            let plate = settings.plate(&board.plate().board);
            match plate.config() {
                Ok(config) => {
                    let travel = plate.travel_config();
                    all.push([digest(&config), digest(&travel)]);
                }
                Err(why) => misfit = Some(why),
            }
        }
        digest(&all)
    });
    let expected = [0x2735_4305_7411_8fb5, 0x5cbb_d683_603e_c500];
    assert_eq!(measured, expected, "measured {measured:#x?}");
}
