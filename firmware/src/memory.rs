//! Memory before Rust runs: RAM is written after a power-on, and the fast code goes to where it runs.
//!
//! `__pre_init` is what the runtime calls before anything else. It is assembly, because Rust code may not run before RAM is
//! initialised, and because the compiler's own `memcpy` is part of what it copies. All registers are free to use.
//!
//! - The first access to each block of RAM may be lost after a reset (ES0430 2.2.7, quoted by others). So the first word of each is
//!   written once before it matters, with what it holds where a reset keeps it.
//! - Parity guards the first 32 KB of SRAM1 and all of CCM SRAM (ST's HAL, `OB_SRAM_PARITY_ENABLE`). A byte that was never written is
//!   a wrong bit when it is read, also by a probe or by a prefetch past the end of the code. After a power-on (RCC_CSR.BORRSTF) all of
//!   it is written, in 3 ms. Other resets keep it: the crash record, the journal and the request of a bring-up lie in it.
//! - The fast code is copied from flash to CCM SRAM, on the core's own buses, without wait states. `memory.x` aligns both ends to words
//!   and gives the CCM region to nothing else. The two barriers make what was written as data visible to instruction fetches.

core::arch::global_asm!(
    ".section .text.__pre_init, \"ax\"",
    ".global __pre_init",
    ".type __pre_init, %function",
    ".thumb_func",
    "__pre_init:",
    // The first words of SRAM1, SRAM2 and CCM SRAM.
    "ldr r0, =0x20000000",
    "ldr r1, =0x20014000",
    "ldr r2, =0x10000000",
    // RCC_CSR.BORRSTF, bit 27, as the sign.
    "ldr r3, =0x40021094",
    "ldr r3, [r3]",
    "lsls r3, r3, #4",
    "bmi 4f",
    "ldr r3, [r0]",
    "str r3, [r0]",
    "ldr r3, [r1]",
    "str r3, [r1]",
    "b 7f",
    // The pattern shows how deep the stack went.
    "4: ldr r3, =0xCDCDCDCD",
    "mov r4, r3",
    "mov r5, r3",
    "mov r6, r3",
    "str r3, [r0]",
    "str r3, [r1]",
    "str r3, [r2]",
    "ldr r1, =0x20008000",
    "5: stm r0!, {{r3, r4, r5, r6}}",
    "cmp r0, r1",
    "bne 5b",
    "ldr r1, =0x10008000",
    "6: stm r2!, {{r3, r4, r5, r6}}",
    "cmp r2, r1",
    "bne 6b",
    "7: ldr r0, =__sccm",
    "ldr r1, =__eccm",
    "ldr r2, =__siccm",
    // Lost or not: the copy writes it again.
    "str r0, [r0]",
    "2: cmp r0, r1",
    "beq 3f",
    "ldm r2!, {{r3}}",
    "stm r0!, {{r3}}",
    "b 2b",
    "3: dsb",
    "isb",
    "bx lr",
    ".size __pre_init, . - __pre_init",
);
