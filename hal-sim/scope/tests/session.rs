//! A client as the page has it, against a simulated drive: frames only.

use scope::analysis::ripple;
use scope::client::Client;
use scope::identification::{identify, operating_points};
use scope::signals::COLUMNS;
use scope::simulated::Simulated;
use serde_json::Value;

struct Page {
    drive: Simulated,
    line: u32,
    client: Client,
    rows: Vec<f64>,
}

impl Page {
    fn new(cold: bool) -> Self {
        Self::with("mains", cold, "")
    }

    fn with(board: &str, cold: bool, effects: &str) -> Self {
        let mut drive = Simulated::new(board, cold, effects).unwrap();
        let line = drive.open();
        let mut page = Self {
            drive,
            line,
            client: Client::new(),
            rows: Vec::new(),
        };
        assert_eq!(
            page.ask(r#"{"command":"hello"}"#)["hello"]["simulated"],
            true
        );
        page
    }

    /// Some milliseconds with a heartbeat each 20 ms.
    fn advance(&mut self, ms: u32) -> Vec<Value> {
        let mut messages = Vec::new();
        for _ in 0..ms / 20 {
            let beat = self.client.request(r#"{"command":"heartbeat"}"#).unwrap();
            self.drive.receive(self.line, &beat);
            messages.extend(self.step(20));
        }
        messages
    }

    fn step(&mut self, ms: u32) -> Vec<Value> {
        self.drive.advance(ms);
        let bytes = self.drive.outgoing(self.line);
        let messages = self.client.push(&bytes);
        self.rows.extend(self.client.rows());
        messages
    }

    fn ask(&mut self, request: &str) -> Value {
        let bytes = self.client.request(request).unwrap();
        let sequence = self.client.sequence();
        self.drive.receive(self.line, &bytes);
        let messages = self.step(5);
        let mut replies = messages.into_iter().map(|message| message["reply"].clone());
        replies
            .find(|reply| reply["sequence"] == sequence)
            .unwrap_or_else(|| panic!("no answer to {request}"))
    }

    fn read_settings(&mut self) {
        let mut from = 0;
        loop {
            let some = self.ask(&format!(r#"{{"command":"settings","from":{from}}}"#));
            let Some(last) = some["settings"].as_array().unwrap().last() else {
                return;
            };
            from = last["id"].as_u64().unwrap() + 1;
        }
    }

    fn state(&mut self) -> String {
        let status = self.ask(r#"{"command":"status"}"#);
        status["status"]["state"].as_str().unwrap().to_owned()
    }
}

#[test]
fn a_page_arms_runs_plots_and_stops() {
    let mut page = Page::new(false);
    page.advance(400);
    assert_eq!(page.state(), "ready");
    assert_eq!(page.ask(r#"{"command":"arm"}"#)["done"], true);
    let run = r#"{"command":"run","velocity_mm_s":2.5,"common_speed_rpm":500}"#;
    assert_eq!(page.ask(run)["done"], true);
    page.advance(3000);
    assert_eq!(
        page.ask(r#"{"command":"record","divider":5}"#)["done"],
        true
    );
    page.advance(1000);
    let rows = page.rows.len() / COLUMNS;
    assert!(
        (995..=1015).contains(&rows),
        "{rows} rows in a second at 1 kHz"
    );
    let table: Vec<f64> = page
        .rows
        .chunks(COLUMNS)
        .map(|row| 1e-3 * row[17])
        .collect();
    let velocity = ripple(&table, 1e-3).unwrap();
    let mean = velocity["mean_mm_s"].as_f64().unwrap();
    assert!((mean - 2.5).abs() < 0.02, "{mean} mm/s, expected 2.5");
    assert_eq!(page.client.counts()["lost"], 0);
    assert_eq!(page.ask(r#"{"command":"stop"}"#)["done"], true);
    page.advance(2000);
    assert_eq!(page.state(), "ready");
}

#[test]
fn a_page_that_ceases_its_heartbeat_leaves_the_drive_at_rest() {
    let mut page = Page::new(false);
    page.advance(400);
    page.ask(r#"{"command":"arm"}"#);
    page.ask(r#"{"command":"run","velocity_mm_s":2.5,"common_speed_rpm":500}"#);
    page.advance(1000);
    assert_eq!(page.state(), "running");
    page.step(2500);
    assert_ne!(page.state(), "running");
}

#[test]
fn a_cold_drive_does_not_move_before_it_is_armed() {
    let mut page = Page::new(true);
    page.advance(500);
    assert_eq!(page.state(), "unaligned");
    let run = r#"{"command":"run","velocity_mm_s":2.5,"common_speed_rpm":500}"#;
    let refused = page.ask(run)["refused"]["name"].clone();
    assert!(
        refused == "unaligned" || refused == "not armed",
        "{refused}"
    );
}

#[test]
fn a_request_that_is_none_is_a_sentence() {
    let mut client = Client::new();
    for (request, part) in [
        ("{}", "no request"),
        (r#"{"command":"fly"}"#, "no request"),
        (
            r#"{"command":"run","velocity_mm_s":1e9,"common_speed_rpm":0}"#,
            "table speed",
        ),
        (
            r#"{"command":"draft","name":"feed.led","value":"5"}"#,
            "feed.lead_mm",
        ),
        (
            r#"{"command":"inject","fault":"bus","motor":0,"amount":-1}"#,
            "0 to 1000 V",
        ),
    ] {
        let error = format!("{:#}", client.request(request).unwrap_err());
        assert!(error.contains(part), "{request}: {error}");
    }
}

#[test]
fn another_client_may_stop_what_it_does_not_command() {
    let mut page = Page::new(false);
    page.advance(400);
    page.ask(r#"{"command":"arm"}"#);
    page.ask(r#"{"command":"run","velocity_mm_s":2.5,"common_speed_rpm":500}"#);
    let (line, mut other) = (page.drive.open(), Client::new());
    for request in [r#"{"command":"hello"}"#, r#"{"command":"stop"}"#] {
        let bytes = other.request(request).unwrap();
        page.drive.receive(line, &bytes);
        page.advance(20);
        let bytes = page.drive.outgoing(line);
        other.push(&bytes);
    }
    page.advance(2000);
    assert_eq!(page.state(), "ready");
}

impl Page {
    /// Runs through operating points of table velocity and common speed, recorded at the full rate.
    fn record(&mut self, points: &Value, held_s: f64) -> Vec<f64> {
        self.client.begin_recording();
        for point in points.as_array().unwrap() {
            let run = format!(
                r#"{{"command":"run","velocity_mm_s":{},"common_speed_rpm":{}}}"#,
                point[0], point[1]
            );
            assert_eq!(self.ask(&run)["done"], true, "{run}");
            self.advance((1e3 * held_s) as u32);
        }
        self.client.take_recording()
    }

    /// Ripple of 2 s at 2.5 mm/s and 500 rpm, %.
    fn ripple(&mut self) -> f64 {
        let run = r#"{"command":"run","velocity_mm_s":2.5,"common_speed_rpm":500}"#;
        assert_eq!(self.ask(run)["done"], true);
        self.advance(3000);
        self.rows.clear();
        self.advance(2000);
        let table: Vec<f64> = self
            .rows
            .chunks(COLUMNS)
            .map(|row| 1e-3 * row[17])
            .collect();
        ripple(&table, 2e-4).unwrap()["vrf_percent"]
            .as_f64()
            .unwrap()
    }
}

/// The first visit: an unknown cogging torque is recorded, named and compensated.
#[test]
fn a_cogging_torque_is_recorded_named_and_compensated() {
    let cogging = "[[effects]]\nkind = \"cogging\"\nwhere = \"screw\"\norder = 12\namplitude = 0.03\nphase = 0.4\n";
    let mut page = Page::with("mains", false, cogging);
    page.advance(400);
    page.read_settings();
    page.ask(r#"{"command":"arm"}"#);
    page.ask(r#"{"command":"record","divider":1}"#);
    page.ask(r#"{"command":"status"}"#);
    let before = page.ripple();
    let points = operating_points();
    let held_s = points["held_s"].as_f64().unwrap() + 0.25;
    let fit = page.record(&points["fit"], held_s);
    let check = page.record(&points["check"], held_s);
    page.ask(r#"{"command":"stop"}"#);
    let found = identify(&page.drive.declared(), &fit, &check).unwrap();
    println!("{}", found["report"]["summary"]);
    let effects = found["report"]["effects"].as_array().unwrap();
    let names: Vec<String> = effects
        .iter()
        .map(|one| {
            format!(
                "{} {} {} {}",
                one["kind"], one["where"], one["order"], one["parameters"]
            )
        })
        .collect();
    println!("{names:#?}");
    assert!(
        effects.iter().any(|effect| effect["kind"] == "cogging"
            && effect["where"] == "screw"
            && effect["order"]
                .as_f64()
                .is_some_and(|order| (order - 12.0).abs() < 0.05)),
        "{names:#?}"
    );
    let settings = page
        .client
        .compensation(found["model"].as_str().unwrap())
        .unwrap();
    for (name, value) in settings["settings"].as_object().unwrap() {
        let draft = format!(r#"{{"command":"draft","name":"{name}","value":{value}}}"#);
        assert_eq!(page.ask(&draft)["done"], true, "{draft}");
    }
    page.advance(2000);
    assert_eq!(page.ask(r#"{"command":"commit"}"#)["done"], true);
    page.advance(1000);
    assert_eq!(
        page.ask(r#"{"command":"hello"}"#)["hello"]["simulated"],
        true
    );
    page.advance(1000);
    page.ask(r#"{"command":"arm"}"#);
    page.ask(r#"{"command":"record","divider":1}"#);
    // The tables are checked against the machine before they act in full.
    page.ripple();
    let after = page.ripple();
    println!("ripple before {before} %, after {after} %");
    assert!(after < 0.3 * before, "{before} % before, {after} % after");
}

/// The page's own commands, from arming to rows.
#[test]
fn a_page_arms_a_burst_and_reads_every_period_around_its_trigger() {
    let mut page = Page::new(false);
    page.advance(400);
    page.read_settings();
    assert_eq!(page.ask(r#"{"command":"arm"}"#)["done"], true);
    page.ask(r#"{"command":"run","velocity_mm_s":2.5,"common_speed_rpm":300}"#);
    page.advance(600);
    let none = page.ask(r#"{"command":"burst_samples","from":0}"#);
    assert_eq!(none["refused"]["name"], "no burst");
    let wrong = r#"{"command":"burst","motor":1,"trigger":"ia>3","before_percent":50,"divider":1}"#;
    let error = page.client.request(wrong).unwrap_err();
    assert!(format!("{error:#}").contains("no signal `ia`"), "{error:#}");
    let asked =
        r#"{"command":"burst","motor":1,"trigger":"ia_a<0","before_percent":50,"divider":1}"#;
    assert_eq!(page.ask(asked)["done"], true);
    let waits = page.ask(r#"{"command":"burst_status"}"#);
    assert!(waits["burst"]["state"] != "none", "{waits}");
    page.advance(200);
    let status = page.ask(r#"{"command":"burst_status"}"#)["burst"].clone();
    assert_eq!(
        (&status["state"], &status["motor"]),
        (&"complete".into(), &1.into())
    );
    assert_eq!(status["interval_s"], 50e-6);
    assert!(page.client.burst_rows().is_empty());
    let mut read = 0;
    while read < 512 {
        // An answer that was lost is asked for again.
        for _ in 0..2 {
            let reply = page.ask(&format!(r#"{{"command":"burst_samples","from":{read}}}"#));
            let count = reply["samples"].as_u64().unwrap();
            assert!(count > read && count <= read + 6, "{reply}");
        }
        read = page.ask(&format!(r#"{{"command":"burst_samples","from":{read}}}"#))["samples"]
            .as_u64()
            .unwrap();
    }
    let rows = page.client.burst_rows();
    assert_eq!(rows.len(), 512 * 8);
    let rows = rows.as_chunks::<8>().0;
    let before = usize::try_from(status["before"].as_u64().unwrap()).unwrap();
    assert_eq!(rows[before][0], 0.0);
    assert!((rows[511][0] - (511 - before) as f64 * 50e-6).abs() < 1e-12);
    assert!(rows[before][1] <= 0.0 && rows[before - 1][1] >= 0.0);
    let mean = rows.iter().map(|row| row[7]).sum::<f64>() / 512.0;
    assert!((mean - 300.0).abs() < 15.0, "{mean} rpm");
    assert_eq!(scope::burst::signals().as_array().unwrap().len(), 7);
    page.ask(r#"{"command":"end_burst"}"#);
    let ended = page.ask(r#"{"command":"burst_status"}"#);
    assert_eq!(ended["burst"]["state"], "none");
    assert!(page.client.burst_rows().is_empty());
}

/// Half a minute and more of a drive's time, in the steps of the page's worker.
#[test]
fn a_page_commissions_a_cold_drive() {
    let mut page = Page::new(true);
    let wanted = r#"{"travel_mm":10,"margin_deg":45,"response_only":false}"#;
    page.client.commission(wanted).unwrap();
    let mut ms = 0.0;
    while page.client.commissioning()["running"] == true {
        let bytes = page.client.poll_commissioning(ms).unwrap();
        page.drive.receive(page.line, &bytes);
        page.step(5);
        ms += 5.0;
        assert!(ms < 120e3, "{}", page.client.commissioning());
    }
    let report = page.client.commissioning();
    assert_eq!(report["error"], Value::Null, "{report}");
    let done = report["done"].as_array().unwrap();
    let names: Vec<_> = done
        .iter()
        .map(|done| done["name"].as_str().unwrap())
        .collect();
    assert_eq!(
        names,
        [
            "start",
            "electrical",
            "mechanical",
            "tuning",
            "angle",
            "response"
        ]
    );
    println!("{ms} ms");
    let model = plant::model::Model::parse(&page.drive.declared(), "the machine").unwrap();
    let value = |step: usize, name: &str| {
        let quantities = done[step]["quantities"].as_array().unwrap();
        let found = quantities.iter().find(|one| one["name"] == name).unwrap();
        found["estimate"]["value"].as_f64().unwrap()
    };
    for (motor, truth) in [("screw", &model.screw), ("nut", &model.nut)] {
        for (name, expected) in [
            ("resistance, line to line", 2.0 * truth.resistance_ohm),
            ("inductance, line to line", 2e3 * truth.inductance_h),
        ] {
            let measured = value(1, &format!("{motor}: {name}"));
            println!("{motor} {name}: {measured} of {expected}");
            assert!((measured / expected - 1.0).abs() < 0.01);
        }
    }
    assert_eq!(page.state(), "ready");
    // What it measured is the model that a recording is identified with.
    assert_eq!(
        page.ask(r#"{"command":"record","divider":5}"#)["done"],
        true
    );
    page.advance(100);
    let text = page.client.declared().unwrap();
    let declared = plant::model::Model::parse(&text, "the measured model").unwrap();
    assert!(declared.measured.is_some(), "{text}");
    for (motor, truth) in [(&declared.screw, &model.screw), (&declared.nut, &model.nut)] {
        let inertia = motor.inertia_kg_m2 / truth.inertia_kg_m2;
        assert!((inertia - 1.0).abs() < 0.05, "{text}");
    }
}

#[test]
fn a_stop_ends_a_commissioning_at_once() {
    let mut page = Page::new(false);
    page.client
        .commission(r#"{"travel_mm":10,"margin_deg":45,"response_only":true}"#)
        .unwrap();
    let mut ms = 0.0;
    while page.state() != "running" {
        let bytes = page.client.poll_commissioning(ms).unwrap();
        page.drive.receive(page.line, &bytes);
        page.step(5);
        ms += 10.0;
        assert!(ms < 10e3, "{}", page.client.commissioning());
    }
    page.client.stop_commissioning();
    assert_eq!(page.ask(r#"{"command":"stop"}"#)["done"], true);
    for _ in 0..400 {
        assert!(page.client.poll_commissioning(ms).unwrap().is_empty());
        page.advance(20);
    }
    assert_eq!(page.client.commissioning()["error"], "It was stopped.");
    assert_eq!(page.state(), "ready");
}
