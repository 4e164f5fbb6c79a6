//! Puts the fast code where it runs: CCM SRAM, on the core's own buses, without wait states.
//!
//! `__pre_init` is what the runtime calls before anything else. It copies the code from flash in assembly, because Rust
//! code may not run before RAM is initialised, and because the compiler's own `memcpy` is part of what it copies.
//! `memory.x` aligns both ends to words and gives the CCM region to nothing else; r0 to r3 are free to use, and the two
//! barriers make what was written as data visible to instruction fetches.

core::arch::global_asm!(
    ".section .text.__pre_init, \"ax\"",
    ".global __pre_init",
    ".type __pre_init, %function",
    ".thumb_func",
    "__pre_init:",
    "ldr r0, =__sccm",
    "ldr r1, =__eccm",
    "ldr r2, =__siccm",
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
