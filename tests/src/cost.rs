//! What the interrupts cost: measured on the emulated drive, and bounded from the code.

use crate::bench::{Bench, READY, firmware, smooth_firmware};
use crate::chip::CORE_HZ;
use crate::chip::wiring::Wiring;
use crate::emulator::Cost;
use crate::graph::{Graph, LoopBound};
use crate::image::Image;
use crate::timing::{ENTRY, EXIT, MODEL_ERROR_PERCENT};
use link::codes::Demand;
use plant::machine::Coupling;
use plant::model::Model;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::f64::consts::TAU;
use std::path::PathBuf;
use std::rc::Rc;

/// The figures that the tests hold the firmware to, beside this package's manifest.
pub const BASELINE: &str = "cost-baseline.json";

/// How far a figure may rise above the baseline.
pub const RISE: f64 = 1.02;
/// How far it may fall below the baseline before that has to be renewed.
pub const FALL: f64 = 0.95;

/// Where the baseline is.
///
/// # Errors
/// This is no clone of the project.
pub fn baseline_path() -> Result<PathBuf, String> {
    let root = xtask::tools::root().map_err(|error| format!("{error:#}"))?;
    Ok(root.join("tests").join(BASELINE))
}

/// The baseline's figures.
///
/// # Errors
/// The file cannot be read, or is no JSON.
pub fn baseline() -> Result<Value, String> {
    let path = baseline_path()?;
    let read = || -> std::io::Result<Value> {
        Ok(serde_json::from_str(&std::fs::read_to_string(&path)?)?)
    };
    read().map_err(|error| format!("{}: {error}", path.display()))
}

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

/// Rounds in which an alignment is copied. On this computer it is no smaller than on the chip.
const ALIGNMENT_ROUNDS: u64 = size_of::<control::alignment::Alignment>() as u64 / 16 + 1;

/// Loops in the interrupts' code.
pub const LOOPS: [LoopBound; 8] = [
    LoopBound {
        function: "SpeedTask::judge",
        rounds: 4,
        because: "one for each of those who find faults",
    },
    LoopBound {
        function: "control::speed::compensation",
        rounds: 8,
        because: "the orders of a motor: `control::compensation::TORQUES`",
    },
    LoopBound {
        function: "control::speed::alignment",
        rounds: 0,
        because: "while it aligns the drive does nothing else; what its steps take is measured in tests/alignment.rs",
    },
    LoopBound {
        function: "SpeedTask::compute_alignment",
        rounds: 0,
        because: "the same",
    },
    LoopBound {
        function: "SpeedTask::align",
        rounds: 0,
        because: "the same",
    },
    LoopBound {
        function: "__aeabi_memclr",
        rounds: 8,
        because: "the speed task clears its coordinator while the drive stands: less than 128 bytes, 16 a round",
    },
    LoopBound {
        function: "memcpy",
        rounds: ALIGNMENT_ROUNDS,
        because: "the speed task begins an alignment anew while the current zeros are measured: 16 bytes a round",
    },
    LoopBound {
        function: "memmove",
        rounds: ALIGNMENT_ROUNDS,
        because: "the same",
    },
];

/// Exceptions that can interrupt one another, one of each line: failing clock, hung loop, current loops, speed task, time queue, tasks, and a
/// fault on top.
const NESTING: [&[&str]; 8] = [
    &["NonMaskableInt"],
    &["TIM7"],
    &["ADC1_2", "ADC4"],
    &["FMAC"],
    &["SysTick"],
    &["CRS"],
    &["RNG"],
    &["HardFault"],
];

/// Of these, what the start cannot mask.
const UNMASKED: [&str; 2] = ["NonMaskableInt", "HardFault"];

/// What runs when nothing else does.
const IDLE: &str = "firmware::app::idle";

/// Stack that an exception's entry takes: eight words, and one to align it.
const FRAME: u32 = 36;

/// Cost of one interrupt.
#[derive(Clone, Debug)]
pub struct Row {
    /// Which.
    pub interrupt: Interrupt,
    /// Median over the runs with the drive at work.
    pub typical: Cost,
    /// Largest of each over all runs.
    pub worst: Cost,
    /// Cycles of the longest way through the code.
    pub bound: u64,
}

/// All that the firmware costs.
#[derive(Clone, Debug)]
pub struct Report {
    /// The control interrupts.
    pub rows: Vec<Row>,
    /// Bytes of flash.
    pub flash_bytes: u32,
    /// Bytes of RAM, of both kinds, without the stack.
    pub ram_bytes: u32,
    /// Bytes of stack that all nested tasks can take at most.
    pub stack_bytes: u32,
    /// Bytes of stack that were used in the run.
    pub stack_seen: u32,
    /// Bytes of RAM that the stack has.
    pub stack_room: u32,
}

impl Report {
    /// Part of the core's time that the control interrupts take, %.
    #[must_use]
    pub fn load_percent(&self) -> f64 {
        let cycles: f64 = self
            .rows
            .iter()
            .map(|row| row.typical.cycles as f64 * row.interrupt.rate_hz)
            .sum();
        100.0 * cycles / CORE_HZ as f64
    }

    /// As JSON.
    #[must_use]
    pub fn json(&self) -> Value {
        let interrupts: Vec<Value> = self
            .rows
            .iter()
            .map(|row| {
                json!({
                    "name": row.interrupt.name,
                    "rate_hz": row.interrupt.rate_hz,
                    "instructions": {"typical": row.typical.instructions, "worst": row.worst.instructions},
                    "cycles": {"typical": row.typical.cycles, "worst": row.worst.cycles, "bound": row.bound},
                })
            })
            .collect();
        json!({
            "interrupts": interrupts,
            "load_percent": (self.load_percent() * 100.0).round() / 100.0,
            "flash_bytes": self.flash_bytes,
            "ram_bytes": self.ram_bytes,
            "stack_bytes": self.stack_bytes,
        })
    }
}

/// Runs the drive through rest, both modes, reversals, both limits and a stop, and measures.
///
/// # Errors
/// What the firmware did that the chip does not have, or why the code has no bound.
pub fn measure() -> Result<Report, String> {
    measure_on(Bench::new(&Model::paper(), Coupling::Lumped)?)
}

/// [`measure`] of the firmware that compensates ripple: eight orders a motor, both encoders and the lead, all learning.
///
/// # Errors
/// As [`measure`].
pub fn measure_smooth() -> Result<Report, String> {
    let elf = smooth_firmware()?;
    let board = Wiring::Nucleo;
    measure_on(Bench::with(&elf, board, &Model::paper(), Coupling::Lumped)?)
}

fn measure_on(mut bench: Bench) -> Result<Report, String> {
    bench.emulator.profile().keep = true;
    bench.wait_for(READY, 0.2)?;
    bench.start(2.5e-3, 0.0)?;
    bench.pass(0.3)?;
    let script = [
        (2.5e-3, 800.0),
        (-50e-3, 300.0),
        (50e-3, -2000.0),
        (2.5e-3, 300.0),
    ];
    for (velocity, rpm) in script {
        bench.start(velocity, rpm * TAU / 60.0)?;
        bench.pass(0.5)?;
    }
    // Telemetry at its full rate, which the speed task pays for.
    bench.record(1)?;
    bench.demand(Demand::Rest)?;
    bench.pass(0.5)?;
    let image = Rc::clone(&bench.image);
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
    let (ram, stack_room) = image.ram()?;
    Ok(Report {
        rows,
        flash_bytes: image
            .segments
            .iter()
            .map(|(_, data)| data.len() as u32)
            .sum(),
        ram_bytes: ram,
        stack_bytes: stack_bound(&image, &mut graph)?,
        stack_seen: bench.emulator.stack_used()?,
        stack_room,
    })
}

/// Cycles of the longest way through the handler that opens the bridges when a current loop hangs.
///
/// # Errors
/// The firmware does not build, or why the code has no bound.
pub fn hung_loop_cycles() -> Result<u64, String> {
    // Six accesses to timers, of two cycles each on their bus.
    const BUS: u64 = 12;
    let image = Image::read(&firmware()?)?;
    let start = image.symbol("TIM7")? & !1;
    Ok(Graph::new(&image).longest(start, &LOOPS)? + ENTRY + EXIT + BUS)
}

/// Loops of the handlers below the control, and where their ways end.
const BELOW: [LoopBound; 19] = [
    LoopBound {
        function: "control::watch::guard",
        rounds: 4,
        because: "four tasks, two motors",
    },
    LoopBound {
        function: "control::drive::journal",
        rounds: 48,
        because: "fewer faults than that",
    },
    LoopBound {
        function: "supervision::Supervision",
        rounds: 48,
        because: "the same, and two motors",
    },
    LoopBound {
        function: "codes_of_one_period",
        rounds: 2,
        because: "what the second reading gives is whole",
    },
    LoopBound {
        function: "memcpy",
        rounds: 16,
        because: "a frame of telemetry, a log's words: less than 256 bytes, 16 a round",
    },
    LoopBound {
        function: "sys_reset",
        rounds: 0,
        because: "the chip resets",
    },
    LoopBound {
        function: "panic",
        rounds: 0,
        because: "opens the bridges and resets",
    },
    LoopBound {
        function: "crash",
        rounds: 0,
        because: "the same",
    },
    LoopBound {
        function: "SysTick",
        rounds: 4,
        because: "two tasks wait for it, one pass finds nothing due, and its count may have to be stored again",
    },
    LoopBound {
        function: "delay_until",
        rounds: 4,
        because: "the same: the queue has two links",
    },
    LoopBound {
        function: "CRS",
        rounds: 1,
        because: "a step of the supervision, which then waits",
    },
    LoopBound {
        function: "RNG",
        rounds: 1,
        because: "a step of the telemetry, which then waits",
    },
    LoopBound {
        function: "UpChannel",
        rounds: 3,
        because: "up to the buffer's end, on from its start, and what is left",
    },
    LoopBound {
        function: "_defmt_write",
        rounds: 8,
        because: "a log's index, its time and each of its words have eight bytes at most",
    },
    LoopBound {
        function: "serialize_field",
        rounds: 5,
        because: "a word has five bytes of seven bits",
    },
    LoopBound {
        function: "Serialize for link::telemetry::Real",
        rounds: 8,
        because: "a number's eight bytes",
    },
    LoopBound {
        function: "varint",
        rounds: 5,
        because: "a word has five bytes of seven bits",
    },
    LoopBound {
        function: "ser::impls",
        rounds: 5,
        because: "the same",
    },
    LoopBound {
        function: "Frame::encode",
        rounds: 64,
        because: "fewer fields and bytes than that",
    },
];

/// Cycles that the peripherals' buses add to a handler at most: two each of thirty accesses.
const BUS: u64 = 60;

/// A task and when it must have ended.
#[derive(Clone, Debug)]
pub struct Response {
    /// As in the firmware's schedule.
    pub name: &'static str,
    /// Longest way through its handler, cycles, with what the model may be off by.
    pub longest: u64,
    /// From when it is due until it has ended, cycles, with all that interrupts it on its longest way.
    pub response: u64,
    /// When it must have, cycles.
    pub deadline: u64,
}

/// The tasks of the schedule by priority, the highest first: name, handler, rate, Hz, deadline, s. What happens once and ends
/// the drive (TIM7, NMI, faults) is not among them.
const TASKS: [(&str, &str, f64, f64); 6] = [
    ("screw current loop", "ADC1_2", 20e3, 25e-6),
    ("nut current loop", "ADC4", 20e3, 25e-6),
    ("speed task", "FMAC", 5e3, 200e-6),
    ("time queue", "SysTick", 1e3, 1e-3),
    ("supervision", "CRS", 1e3, 1e-3),
    ("telemetry", "RNG", 1e3, 12.8e-3),
];

/// How long each task takes at most, with all that interrupts it: the smallest `r` with `r = c + sum(ceil(r / t) * c)` over those
/// above it (Joseph and Pandya, The Computer Journal 29, 390, 1986). The current loops have one priority and half a period each.
///
/// # Errors
/// The firmware cannot be read, or why its code has no bound.
pub fn responses(image: &Image) -> Result<Vec<Response>, String> {
    let below: Vec<LoopBound> = BELOW.iter().chain(&LOOPS).copied().collect();
    let mut graph = Graph::new(image);
    graph.find_wakers()?;
    let mut above: Vec<(u64, u64)> = Vec::new();
    let mut all = Vec::new();
    for (name, handler, rate_hz, deadline_s) in TASKS {
        let start = image.symbol(handler)? & !1;
        let control = INTERRUPTS.iter().any(|it| it.handler == handler);
        let loops: &[LoopBound] = if control { &LOOPS } else { &below };
        let cycles = graph.longest(start, loops)? + ENTRY + EXIT + BUS;
        let longest = (cycles as f64 * (1.0 + MODEL_ERROR_PERCENT / 100.0)).ceil() as u64;
        let deadline = (deadline_s * CORE_HZ as f64) as u64;
        let interrupting: &[(u64, u64)] = if handler == "ADC4" { &[] } else { &above };
        let mut response = longest;
        while response <= deadline {
            let more = interrupting.iter().map(|&(c, t)| response.div_ceil(t) * c);
            let next = longest + more.sum::<u64>();
            if next == response {
                break;
            }
            response = next;
        }
        all.push(Response {
            name,
            longest,
            response,
            deadline,
        });
        above.push((longest, (CORE_HZ as f64 / rate_hz) as u64));
    }
    Ok(all)
}

/// Bytes of stack that all nested tasks can take at most: those of the start, which what cannot be masked alone interrupts (RTIC book,
/// "App initialization and the init task": it runs with interrupts disabled), or those of all that goes on afterwards.
///
/// # Errors
/// The code cannot be read, or has no bound.
pub fn stack_bound(image: &Image, graph: &mut Graph<'_>) -> Result<u32, String> {
    let (reset, idle) = (image.symbol("Reset")? & !1, image.demangled(IDLE)? & !1);
    let before = graph.stack_before(reset, idle)?;
    let before = before.ok_or_else(|| format!("nothing in the start calls {IDLE}"))?;
    let (mut start, mut run) = (graph.stack(reset)?, before + graph.stack(idle)?);
    for level in NESTING {
        let mut deepest = 0;
        for handler in level {
            deepest = deepest.max(graph.stack(image.symbol(handler)? & !1)?);
        }
        run += FRAME + deepest;
        if level.iter().any(|handler| UNMASKED.contains(handler)) {
            start += FRAME + deepest;
        }
    }
    Ok(start.max(run))
}

/// Why a handler could do what it must not: use the float unit, whose registers exceptions do not save; reach a panic; or
/// go where only a register knows. Empty if none can.
///
/// Whose end is a reset may say why with all that the library has: the faults' handlers, and that of interrupts that nobody
/// expects. The dispatchers of the async tasks, which run below all control, have the compiler's own check that a task that
/// has ended is not asked again; a panic there opens the bridges and resets. The time queue's tick, below the control too,
/// wakes a task by its waker's table, which is in a register: [`Graph::find_wakers`].
///
/// # Errors
/// The code cannot be read.
pub fn forbidden(image: &Image) -> Result<Vec<String>, String> {
    const ENDS: [&str; 3] = ["NonMaskableInt", "HardFault", "DefaultHandler"];
    const DISPATCHERS: [&str; 2] = ["CRS", "RNG"];
    let mut graph = Graph::new(image);
    let mut found = Vec::new();
    let handlers: BTreeSet<u32> = image.vectors()?.into_iter().map(|(_, at)| at).collect();
    for handler in handlers {
        let name = graph.name(handler);
        let reach = graph.reach(handler)?;
        let of = |list: &[&str]| list.iter().any(|end| name.starts_with(end));
        found.extend(
            reach
                .float
                .iter()
                .map(|(at, text)| format!("{name} uses floats at {at:#x}: {text}")),
        );
        if of(&ENDS) {
            continue;
        }
        if of(&DISPATCHERS) {
            continue;
        }
        let traps = reach.traps.iter();
        found.extend(traps.map(|at| format!("{name} traps at {at:#x}")));
        for function in reach.functions.iter().map(|&address| graph.name(address)) {
            if function.contains("panic") || function.contains("crash") {
                found.push(format!("{name} reaches {function}"));
            }
        }
        if name == "SysTick" {
            continue;
        }
        found.extend(
            reach
                .indirect
                .iter()
                .map(|(at, text)| format!("{name} goes on by register at {at:#x}: {text}")),
        );
    }
    Ok(found)
}

fn median(runs: &[Cost]) -> Cost {
    let of = |field: fn(&Cost) -> u64| {
        let mut values: Vec<u64> = runs.iter().map(field).collect();
        values.sort_unstable();
        values.get(values.len() / 2).copied().unwrap_or(0)
    };
    each(of)
}

fn worst(runs: &[Cost]) -> Cost {
    each(|field| runs.iter().map(field).max().unwrap_or(0))
}

fn each(of: impl Fn(fn(&Cost) -> u64) -> u64) -> Cost {
    Cost {
        instructions: of(|c| c.instructions),
        cycles: of(|c| c.cycles),
        from_flash: of(|c| c.from_flash),
        bus_wait: of(|c| c.bus_wait),
    }
}
