//! The chip has no double float unit: what computes in `f64` calls the compiler's routines, hundreds of cycles each. Only
//! configuration may.

use std::collections::BTreeSet;
use tests::bench::firmware;
use tests::graph::Graph;
use tests::image::Image;
use tests::sizes::sizes;

/// The compiler's routines of double and single floats, by the names of the ARM's run-time interface (IHI 0043, 4.1.2).
fn is_soft_float(name: &str) -> bool {
    let of_interface = ["__aeabi_d", "__aeabi_f", "__aeabi_cd", "__aeabi_cf"];
    let into_double = ["__aeabi_i2d", "__aeabi_ui2d", "__aeabi_l2d", "__aeabi_ul2d"];
    let into_single = ["__aeabi_i2f", "__aeabi_ui2f", "__aeabi_l2f", "__aeabi_ul2f"];
    let of_compiler = [
        "__adddf3", "__subdf3", "__muldf3", "__divdf3", "__fix", "__float",
    ];
    let mut all = of_interface
        .iter()
        .chain(&into_double)
        .chain(&into_single)
        .chain(&of_compiler);
    all.any(|start| name.starts_with(start)) || name.contains("compiler_builtins::float")
}

/// What the idle task computes in floats, by the beginning of its name: it makes, compares, says and stores settings, which
/// are numbers in their datasheet's units. No command of motion and no status is among it.
const CONFIGURES: [&str; 5] = [
    "<control::plate::settings::Settings as core::cmp::PartialEq>",
    "<control::plate::groups::TravelSettings as core::cmp::PartialEq>",
    "<control::plate::groups::WatchSettings as core::cmp::PartialEq>",
    "<A as core::slice::cmp::SlicePartialEq<B>>::equal_same_length",
    "application::server::learned",
];

#[test]
fn only_configuration_computes_in_soft_float() -> Result<(), String> {
    let image = Image::read(&firmware()?)?;
    let memories = sizes(&image)?.memories;
    let bank_2 = memories.iter().find(|memory| memory.name == "BANK2");
    let bank_2 = bank_2.ok_or("no memory BANK2")?;
    // What configures the drive lies in the second bank, apart from all that interrupts call.
    let configures = |at: u32, name: &str| {
        at.wrapping_sub(bank_2.start) < bank_2.limit
            || CONFIGURES.iter().any(|start| name.starts_with(start))
    };
    let mut graph = Graph::new(&image);
    let reset = image.symbol("Reset")? & !1;
    let mut tasks: Vec<u32> = image.vectors()?.into_iter().map(|(_, at)| at).collect();
    tasks.retain(|&at| at != 0 && at != reset);
    tasks.push(image.demangled("firmware::app::idle")? & !1);
    let (mut seen, mut floats) = (BTreeSet::new(), BTreeSet::new());
    let mut open = tasks;
    while let Some(at) = open.pop() {
        let name = graph.name(at);
        if !seen.insert(at) || configures(at, &name) {
            continue;
        }
        for to in graph.body(at)?.calls() {
            let called = graph.name(to);
            if is_soft_float(&called) {
                floats.insert(format!("{name} calls {called}"));
            } else {
                open.push(to);
            }
        }
    }
    // The routines are there, or their names have changed.
    let routines = image.functions.values().filter(|f| is_soft_float(&f.name));
    let routines = routines.count();
    assert!(
        seen.len() > 100 && routines > 10,
        "{} functions looked at, {routines} routines",
        seen.len()
    );
    let floats: Vec<_> = floats.into_iter().collect();
    assert!(
        floats.is_empty(),
        "soft float in a task:\n{}",
        floats.join("\n")
    );
    Ok(())
}
