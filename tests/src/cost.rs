//! What the interrupts cost: measured on the emulated drive, and bounded from the code.

use crate::bench::{Bench, READY};
use crate::emulator::Cost;
use crate::graph::{Graph, LoopBound};
use crate::timing::{ENTRY, EXIT};
use plant::machine::Coupling;
use plant::model::Model;
use std::f64::consts::TAU;

/// An interrupt whose cost is of interest.
#[derive(Clone, Copy, Debug)]
pub struct Interrupt {
    /// As in the firmware's schedule.
    pub name: &'static str,
    /// Its handler's symbol.
    pub handler: &'static str,
    /// Its line.
    pub line: usize,
    /// How often, Hz.
    pub rate_hz: f64,
}

/// The control interrupts: the firmware's schedule has the same.
pub const INTERRUPTS: [Interrupt; 3] = [
    Interrupt {
        name: "screw current loop",
        handler: "ADC1_2",
        line: 18,
        rate_hz: 20_000.0,
    },
    Interrupt {
        name: "nut current loop",
        handler: "ADC4",
        line: 61,
        rate_hz: 20_000.0,
    },
    Interrupt {
        name: "speed task",
        handler: "FMAC",
        line: 101,
        rate_hz: 5_000.0,
    },
];

/// Loops in the interrupts' code.
pub const LOOPS: [LoopBound; 1] = [LoopBound {
    function: "__aeabi_memclr",
    rounds: 8,
    because: "the speed task clears its coordinator while the drive stands: less than 128 bytes, 16 a round",
}];

/// Cost of one interrupt.
#[derive(Clone, Debug)]
pub struct Row {
    /// Which.
    pub interrupt: Interrupt,
    /// Median over the runs with both bridges on.
    pub typical: Cost,
    /// Largest of each over all runs.
    pub worst: Cost,
    /// Cycles of the longest way through the code.
    pub bound: u64,
}

/// Runs the drive through rest, both modes, a reversal, both limits and a stop, and measures.
///
/// # Errors
/// What the firmware did that the chip does not have, or why the code has no bound.
pub fn measure() -> Result<(Vec<Row>, Bench), String> {
    let mut bench = Bench::new(&Model::paper(), Coupling::Lumped)?;
    bench.emulator.profile().keep = true;
    bench.wait_for(READY, 0.2)?;
    bench.ask(2.5e-3, 0.0)?;
    bench.run(1)?;
    bench.pass(0.3)?;
    let script = [
        (2.5e-3, 800.0),
        (-50e-3, 300.0),
        (50e-3, -2000.0),
        (2.5e-3, 300.0),
    ];
    for (velocity, rpm) in script {
        bench.ask(velocity, rpm * TAU / 60.0)?;
        bench.pass(0.5)?;
    }
    bench.run(0)?;
    bench.pass(0.5)?;
    let image = std::rc::Rc::clone(&bench.image);
    let mut graph = Graph::new(&image);
    let mut rows = Vec::new();
    for interrupt in INTERRUPTS {
        let runs = bench.emulator.profile().of_line(interrupt.line);
        let (typical, worst) = (median(runs), worst(runs));
        let start = image.symbol(interrupt.handler)? & !1;
        // The ways to the peripherals are straight: what the bus added at most is what it adds.
        let bound = graph.longest(start, &LOOPS)? + ENTRY + EXIT + worst.bus_wait;
        rows.push(Row {
            interrupt,
            typical,
            worst,
            bound,
        });
    }
    Ok((rows, bench))
}

fn median(runs: &[Cost]) -> Cost {
    let of = |field: fn(&Cost) -> u64| {
        let mut values: Vec<u64> = runs.iter().map(field).collect();
        values.sort_unstable();
        values.get(values.len() / 2).copied().unwrap_or(0)
    };
    Cost {
        instructions: of(|c| c.instructions),
        cycles: of(|c| c.cycles),
        from_flash: of(|c| c.from_flash),
        bus_wait: of(|c| c.bus_wait),
    }
}

fn worst(runs: &[Cost]) -> Cost {
    let of = |field: fn(&Cost) -> u64| runs.iter().map(field).max().unwrap_or(0);
    Cost {
        instructions: of(|c| c.instructions),
        cycles: of(|c| c.cycles),
        from_flash: of(|c| c.from_flash),
        bus_wait: of(|c| c.bus_wait),
    }
}
