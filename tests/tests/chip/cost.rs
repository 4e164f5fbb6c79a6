//! Cycles, flash, RAM and stack of this firmware stay near the baseline. The baseline is this project's own measurement: it shows a
//! change, and no more. `published_cycles` compares the cycle model with figures of others.

use serde_json::Value;
use tests::bench::firmware_of;
use tests::chip::wiring::Wiring;
use tests::cost::{
    FALL, RISE, Report, baseline, hung_loop_cycles, measure, measure_smooth, responses,
};
use tests::image::Image;
use tests::timing::MODEL_ERROR_PERCENT;

/// Instructions that each interrupt may run from flash: `SpeedTask::press`, of a motor at its torque limit, and `SpeedTask::limits`, for
/// the view, in one step of 64. CCM has no room for them on the mains board.
/// The bounds include its wait states.
const FROM_FLASH: [u64; 3] = [0, 0, 400];

#[test]
fn costs_are_those_of_the_baseline() -> Result<(), String> {
    let kept = baseline()?;
    let report = measure()?;
    let now = report.json();
    let mut figures = Vec::new();
    for k in 0..report.rows.len() {
        for figure in ["typical", "worst", "bound"] {
            figures.push(format!("/interrupts/{k}/cycles/{figure}"));
        }
    }
    figures.extend(["/flash_bytes", "/ram_bytes", "/stack_bytes"].map(String::from));
    for figure in figures {
        let of = |value: &Value| {
            value
                .pointer(&figure)
                .and_then(Value::as_f64)
                .ok_or(format!("no figure {figure}"))
        };
        let (kept, now) = (of(&kept)?, of(&now)?);
        assert!(now <= kept * RISE, "{figure} rose from {kept} to {now}");
        assert!(
            now >= kept * FALL,
            "{figure} fell from {kept} to {now}: keep it, with `cargo xtask cost --keep`"
        );
    }
    for (row, allowed) in report.rows.iter().zip(FROM_FLASH) {
        assert!(
            row.worst.from_flash <= allowed,
            "the {} runs {} instructions from flash, expected at most {allowed}: mark its functions \
             `link_section = \".ccm\"`",
            row.interrupt.name,
            row.worst.from_flash
        );
        assert!(
            row.worst.cycles <= row.bound,
            "the {}'s bound is below what was seen",
            row.interrupt.name
        );
    }
    let [screw, nut, speed] = &report.rows[..] else {
        return Err("three interrupts".into());
    };
    // The two current loops are half a period apart and have one priority: each ends before the other begins.
    for (row, rate_hz) in [(screw, 40e3), (nut, 40e3)] {
        let half = 170e6 / rate_hz / 2.0;
        let longest = row.bound as f64 * (1.0 + MODEL_ERROR_PERCENT / 100.0);
        assert!(
            longest < half,
            "the {}'s longest path takes {longest:.0} cycles with the model's error, expected less than {half:.0}, half a \
             period at 40 kHz",
            row.interrupt.name
        );
    }
    // It ends before it is due again, with both current loops in between, eight times each at 40 kHz.
    let period = 170e6 / speed.interrupt.rate_hz;
    let loops = 8.0 * (screw.bound + nut.bound) as f64;
    assert!(
        speed.bound as f64 + loops < period,
        "the speed task's longest path takes {} cycles and {loops} of current loops in between at 40 kHz, expected less than \
         {period} together",
        speed.bound
    );
    assert_takes(&report, 786, 12.2);
    assert!(
        f64::from(report.stack_bytes) * 1.5 < f64::from(report.stack_room),
        "half as much stack again is there"
    );
    assert!(report.stack_seen <= report.stack_bytes);
    Ok(())
}

/// With everything that makes the table smooth: eight orders a motor, both encoders, the lead, all learning.
#[test]
fn the_compensation_leaves_the_core_its_time() -> Result<(), String> {
    let report = measure_smooth()?;
    let [screw, nut, speed] = &report.rows[..] else {
        return Err("three interrupts".into());
    };
    println!(
        "both current loops {} cycles, the speed task {}, {:.1} % of the core",
        screw.typical.cycles + nut.typical.cycles,
        speed.typical.cycles,
        report.load_percent()
    );
    assert_takes(&report, 1000, 15.2);
    Ok(())
}

/// Both current loops take at most so many cycles, all control interrupts so much of the core, %, and at 40 kHz, where both
/// current loops' longest ways come within a period and the speed task's beside them, the core is left some time.
fn assert_takes(report: &Report, both_most: u64, load_most: f64) {
    let [screw, nut, speed] = &report.rows[..] else {
        panic!("{} interrupts, expected three", report.rows.len());
    };
    let both = screw.typical.cycles + nut.typical.cycles;
    assert!(
        both <= both_most,
        "both current loops take {both} cycles together, expected at most {both_most}"
    );
    assert!(
        report.load_percent() <= load_most,
        "the control takes {} % of the core, expected at most {load_most}",
        report.load_percent()
    );
    let period = 170e6 / 40e3;
    let load = (screw.bound + nut.bound) as f64 / period
        + speed.bound as f64 / 170e6 * speed.interrupt.rate_hz;
    assert!(
        load < 0.9,
        "at 40 kHz the longest ways take {load} of the core"
    );
}

/// The longest way of every task, the time queue's wakers and the dispatchers included, with all that interrupts it.
#[test]
fn every_task_ends_before_its_deadline_on_its_longest_way() -> Result<(), String> {
    for board in [Wiring::Nucleo, Wiring::Mains] {
        let image = Image::read(&firmware_of(board)?)?;
        for task in responses(&image)? {
            println!(
                "{board:?}: {:<20} longest way {:>6} cycles, ended after {:>6} of {:>7}",
                task.name, task.longest, task.response, task.deadline
            );
            assert!(
                task.response <= task.deadline,
                "{board:?}: the {} takes {} cycles on its longest way and {} with what interrupts it, expected at most {}",
                task.name,
                task.longest,
                task.response,
                task.deadline
            );
        }
    }
    Ok(())
}

/// After a debugger's halt the outputs may follow old compare values until this handler has opened the bridges
/// (`firmware/src/hw/protection.rs` says under 1 us).
#[test]
fn the_bridges_are_open_within_a_microsecond_of_a_hung_loop() -> Result<(), String> {
    let cycles = hung_loop_cycles()?;
    println!("TIM7's handler: at most {cycles} cycles");
    assert!(
        cycles <= 170,
        "TIM7's handler takes up to {cycles} cycles to its end, expected at most 170, 1 us"
    );
    Ok(())
}
