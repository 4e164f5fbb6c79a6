//! What a person looks at: pages that stand alone, with charts as inline SVG, legible in the light, in the dark, on paper
//! and on a phone. The simulation's reports and those of the identification are made of it.
#![forbid(unsafe_code)]

pub mod axis;
pub mod chart;
pub mod check;
mod decimate;
pub mod document;
pub mod drawing;
mod labels;
pub mod markup;
mod scale;
pub mod table;
