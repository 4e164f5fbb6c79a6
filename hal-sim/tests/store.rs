//! Settings in a simulated flash of the chip's geometry, with power cut anywhere.

use hal_sim::flash::SimulatedFlash;
use link::settings::store::{Loaded, SLOT, Store};
use link::settings::{Setting, Settings, Value};

/// Three slots.
const PAGES: usize = 6;

/// What a store holds over the defaults.
#[derive(Debug, PartialEq)]
struct Held {
    settings: Settings,
    loaded: Loaded,
}

/// The store on a flash, and what it holds.
fn open(flash: SimulatedFlash) -> (Store<SimulatedFlash>, Option<Held>) {
    let mut store = Store::open(flash);
    let mut settings = Settings::DEFAULT;
    let loaded = store.load(&mut settings);
    let held = loaded.map(|loaded| Held { settings, loaded });
    (store, held)
}

/// Settings that differ from each other in several values.
fn settings(k: u32) -> Settings {
    let mut settings = Settings::DEFAULT;
    for (name, value) in [
        ("feed.lead_mm", 1.0 + f64::from(k % 900)),
        ("screw.encoder_zero_deg", f64::from(k % 360)),
        ("nut.current_gain_c", 1.0 + f64::from(k % 100) * 1e-3),
        ("command.heartbeat_ms", 100.0 + f64::from(k % 9000)),
    ] {
        let id = Setting::named(name).unwrap().id;
        settings.set(id, Value::Real(value)).unwrap();
    }
    settings
}

#[test]
fn what_is_saved_holds_and_nothing_holds_in_an_erased_flash() {
    let (mut store, loaded) = open(SimulatedFlash::new(PAGES, 1));
    assert_eq!(loaded, None);
    for k in 0..7 {
        store.save(&settings(k)).unwrap();
        let (again, loaded) = open(store.release());
        let loaded = loaded.unwrap();
        assert_eq!(loaded.settings, settings(k));
        assert_eq!(loaded.loaded, Loaded::default());
        store = again;
    }
}

/// Power cut at each erase and each word of a save, after any number of saves; then again at any operation of the save that
/// follows. The old settings hold or the new, never others, and the next save holds.
#[test]
fn a_power_cut_at_any_moment_leaves_the_old_settings_or_the_new() {
    let (mut cuts, mut old, mut new) = (0u32, 0u32, 0u32);
    for before in 0..5u32 {
        let (mut store, _) = open(SimulatedFlash::new(PAGES, 7));
        for k in 0..before {
            store.save(&settings(k)).unwrap();
        }
        let start = store.flash().operations();
        let mut whole = store.clone();
        whole.save(&settings(before)).unwrap();
        let operations = whole.flash().operations() - start;
        for cut in 0..operations {
            // What a half operation leaves is drawn: some draws of each.
            for draw in 0..8u64 {
                let mut flash = SimulatedFlash::new(PAGES, u64::from(cut) << 8 | draw);
                let mut held = None;
                let (mut store, _) = open(flash);
                for k in 0..before {
                    store.save(&settings(k)).unwrap();
                    held = Some(settings(k));
                }
                store.flash().cut_after(cut);
                store.save(&settings(before)).unwrap_err();
                cuts += 1;

                flash = store.release();
                flash.power_up();
                let (mut store, loaded) = open(flash);
                let found = loaded.map(|loaded| loaded.settings);
                if found == held {
                    old += 1;
                } else {
                    assert_eq!(
                        found,
                        Some(settings(before)),
                        "{before} saves, cut {cut}, draw {draw}"
                    );
                    new += 1;
                }
                // And a second cut, in the save after the first.
                let second = (cut * 7 + draw as u32) % operations;
                store.flash().cut_after(second);
                store.save(&settings(700)).unwrap_err();
                let mut flash = store.release();
                flash.power_up();
                let (mut store, loaded) = open(flash);
                let after = loaded.map(|loaded| loaded.settings);
                assert!(
                    after == found || after == Some(settings(700)),
                    "{before} saves, cuts {cut} and {second}, draw {draw}: {after:?}"
                );
                store.save(&settings(800)).unwrap();
                let (_, loaded) = open(store.release());
                assert_eq!(loaded.unwrap().settings, settings(800));
            }
        }
    }
    println!(
        "{cuts} cuts, of which {old} left the old settings and {new} the new; and as many in the save after them"
    );
    assert!(cuts > 2000, "{cuts} cuts");
    assert!(old > 0 && new > 0, "old {old}, new {new} of {cuts}");
}

/// 10,000 erases are what a page bears (DS12288, flash memory endurance).
#[test]
fn ten_thousand_saves_wear_all_pages_evenly() {
    let (mut store, _) = open(SimulatedFlash::new(PAGES, 3));
    for k in 0..10_000 {
        store.save(&settings(k)).unwrap();
    }
    let erases = store.flash().erases().to_vec();
    let (least, most) = (erases.iter().min().unwrap(), erases.iter().max().unwrap());
    assert!(most - least <= 1, "{erases:?}");
    assert_eq!(erases.iter().sum::<u32>(), 20_000, "two pages a save");
    assert!(*most <= 10_000 / 3 + 1, "{erases:?}");
}

#[test]
fn any_content_is_read_as_settings_or_as_none() {
    let (mut store, _) = open(SimulatedFlash::new(PAGES, 5));
    store.save(&settings(1)).unwrap();
    store.save(&settings(2)).unwrap();
    let whole = store.release().bytes().to_vec();
    let mut found = [0u32; 3];
    // Each byte of the newer page changed: the older holds, or, past its end, the newer.
    for at in 0..2 * SLOT {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x5A;
        let (_, loaded) = open(SimulatedFlash::of_bytes(&bytes));
        let settings_found = loaded.map(|loaded| loaded.settings);
        let k = [Some(settings(1)), Some(settings(2)), None]
            .iter()
            .position(|known| *known == settings_found);
        found[k.expect("settings that were never saved")] += 1;
    }
    assert!(
        found[0] > 500 && found[1] > 2048 && found[2] == 0,
        "{found:?}"
    );
}
