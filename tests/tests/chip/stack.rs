//! A stack that overflows is caught: the core runs into memory that the protection unit closes, and starts again.

use plant::machine::Coupling;
use plant::model::Model;
use tests::bench::{Bench, READY};
use tests::chip::Reset;
use tests::graph::Graph;

#[test]
fn a_stack_that_overflows_ends_in_a_reset_that_says_so() -> Result<(), String> {
    // At the guard's end the next interrupt's frame is in it; a little above, what its handler pushes.
    for left in [0, 40, 80] {
        let mut bench = Bench::new(&Model::paper(), Coupling::Lumped)?;
        bench.wait_for(READY, 0.2)?;
        bench.log()?;
        let guard = bench.image.symbol("__eguard")?;
        bench.settle_untold()?;
        bench.emulator.enforce_protection()?;
        bench.emulator.set_stack(guard + left)?;
        bench.pass(1e-3)?;
        assert_eq!(
            bench.emulator.resets,
            [Reset::Software],
            "{left} bytes left"
        );
        bench.wait_for(READY, 0.2)?;
        let log = bench.log()?.join("\n");
        assert!(
            log.contains("the stack overflowed"),
            "{left} bytes left: {log}"
        );
    }
    Ok(())
}

/// A frame larger than the guard could step over it.
#[test]
fn no_function_steps_over_the_guard() -> Result<(), String> {
    let bench = Bench::new(&Model::paper(), Coupling::Lumped)?;
    let size = bench.image.symbol("__eguard")? - bench.image.symbol("__sguard")?;
    let mut graph = Graph::new(&bench.image);
    let (largest, name) = graph.largest_frame()?;
    println!("{largest} bytes in {name}, of {size}");
    assert!(
        largest < size,
        "{name} takes {largest} bytes of stack at once, the guard has {size}"
    );
    Ok(())
}
