//! Puts the fast code where it runs: CCM SRAM, on the core's own buses, without wait states.

/// Copies the fast code from flash. Must run before any of it is called: first thing in `init`.
pub(crate) fn load_fast_code() {
    unsafe extern "C" {
        // From memory.x: addresses, not objects.
        static mut __sccm: u32;
        static mut __eccm: u32;
        static __siccm: u32;
    }
    // SAFETY: memory.x aligns both ends to a word and gives the CCM region to nothing else; nothing in it runs yet,
    // as all interrupts are off.
    unsafe {
        let start = &raw mut __sccm;
        let words = (&raw mut __eccm).offset_from_unsigned(start);
        core::ptr::copy_nonoverlapping(&raw const __siccm, start, words);
    }
    // What was written as data is fetched as instructions.
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}
