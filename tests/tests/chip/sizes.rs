//! The sizes are the whole image's, and it fits.

use tests::bench::firmware;
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
    let loaded: usize = image.segments.iter().map(|(_, data)| data.len()).sum();
    // Between two sections lie a few bytes of alignment.
    assert!(
        (flash.used as usize).abs_diff(loaded) < 64,
        "{flash:?} {loaded}"
    );
    assert_eq!(
        (flash.limit, ram.limit, ccm.limit),
        (508 << 10, 96 << 10, 32 << 10)
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
