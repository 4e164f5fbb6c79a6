//! The sizes are the whole image's, and it fits.

use tests::bench::firmware;
use tests::graph::Graph;
use tests::image::Image;
use tests::sizes::sizes;

#[test]
fn each_byte_is_counted_once_and_there_is_room() -> Result<(), String> {
    let image = Image::read(&firmware()?)?;
    let sizes = sizes(&image)?;
    let memory = |name: &str| {
        let found = sizes.memories.iter().find(|memory| memory.name == name);
        found.ok_or_else(|| format!("no memory {name}"))
    };
    let (flash, ram, ccm) = (memory("FLASH")?, memory("RAM")?, memory("CCM")?);
    let bank_2 = memory("BANK2")?;
    let loaded: usize = image.segments.iter().map(|(_, data)| data.len()).sum();
    // Between two sections lie a few bytes of alignment.
    assert!(
        ((flash.used + bank_2.used) as usize).abs_diff(loaded) < 64,
        "{flash:?} {bank_2:?} {loaded}"
    );
    assert_eq!(
        (flash.limit, ram.limit, ccm.limit),
        (256 << 10, 96 << 10, 32 << 10)
    );
    // The stack's guard lies on a multiple of its own 4 KiB.
    let besides = ram.limit.abs_diff(ram.used + sizes.stack_room);
    assert!(
        besides < 64 + 4096,
        "{besides} bytes are neither used nor stack, expected less than 4160: {ram:?}"
    );
    assert!(
        ram.symbols
            .iter()
            .any(|(name, _)| name.contains("_RTT_CHANNEL_BUFFER"))
    );
    let handler = image.symbol("ADC4")?;
    assert!(
        handler.wrapping_sub(ccm.start) < ccm.limit,
        "the current loop's handler lies at {handler:#x}, expected within the fast memory {ccm:?}"
    );
    for memory in &sizes.memories {
        assert!(memory.used > 0 && memory.used <= memory.limit, "{memory:?}");
    }
    assert!(sizes.stack_bound * 3 / 2 < sizes.stack_room);
    assert_eq!(
        sizes.json()["memories"][0]["used_bytes"].as_u64(),
        Some(u64::from(flash.used))
    );
    Ok(())
}

/// A fetch from the second bank waits while it is erased: 22 ms.
#[test]
fn nothing_that_an_interrupt_calls_lies_in_the_bank_that_is_written() -> Result<(), String> {
    let image = Image::read(&firmware()?)?;
    let memories = sizes(&image)?.memories;
    let bank_2 = memories.iter().find(|memory| memory.name == "BANK2");
    let bank_2 = bank_2.ok_or("no memory BANK2")?;
    let within = |at: u32| at.wrapping_sub(bank_2.start) < bank_2.limit;
    let mut graph = Graph::new(&image);
    let mut looked = 0;
    for (name, handler) in image.vectors()? {
        if handler == image.symbol("Reset")? & !1 {
            continue;
        }
        let functions = graph.reach(handler)?.functions;
        looked += functions.len();
        if let Some(&at) = functions.iter().find(|&&at| within(at)) {
            return Err(format!(
                "{name} calls {} in {}",
                graph.name(at),
                bank_2.name
            ));
        }
    }
    let configure = image.functions.keys().filter(|&&at| within(at)).count();
    assert!(
        looked > 100 && configure > 20,
        "{looked} functions looked at, {configure} in the second bank"
    );
    Ok(())
}
