//! The machine: two motors, a ball screw between them, a table, and what disturbs them.
#![forbid(unsafe_code)]
