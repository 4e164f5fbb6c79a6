//! What a fault does to an input.
//!
//! | input | span | offset | noise, standard deviation | late by |
//! | --- | --- | --- | --- | --- |
//! | current | the ADC's | a tenth of the span | 3 % of the span | 4 periods |
//! | bus | the ADC's | a tenth of the span | 3 % of the span | 4 periods |
//! | temperature | the ADC's | a tenth of the span | 10 % of the span | 20 looks |
//! | encoder | a turn | 45 electrical degrees | half a mechanical degree | 4 periods |
//! | scale | 1 m | 10 mm | 1 mm | 20 steps |
//! | contacts | | | closed or open at random, anew each 0.4 ms | 20 ms |
//! | controller's supply | 2.85 V is its low end | -0.35 V of 3.3 V | 3 % of 3.3 V | |
//! | demand | rest, reset | | another each 20 ms | |
//! | reset | held | | | |
//! | clock | | fast by 1.5 % | each period anew, as much | slow by 1.5 % |
//!
//! The figures are ours: large enough to do harm, small enough not to be seen at once.

use super::cell::{Defect, Input};
use control::supervisor::Demand;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use std::collections::VecDeque;

/// An input and what is wrong with it.
#[derive(Clone, Debug)]
pub(super) struct Spoiled {
    pub(super) input: Input,
    pub(super) defect: Defect,
    /// From now on.
    pub(super) on: bool,
    random: Xoshiro256PlusPlus,
    held: Option<f64>,
    line: VecDeque<f64>,
    noise: (u32, f64),
}

/// A reading and what can become of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reading {
    pub(super) now: f64,
    /// What a torn wire reads.
    pub(super) missing: f64,
    /// The ends of its range.
    pub(super) span: [f64; 2],
    pub(super) offset: f64,
    pub(super) sigma: f64,
    /// Readings that it is late by.
    pub(super) late: usize,
    pub(super) neighbour: f64,
}

impl Spoiled {
    pub(super) fn new(input: Input, defect: Defect, seed: u64) -> Self {
        Self {
            input,
            defect,
            on: false,
            random: Xoshiro256PlusPlus::seed_from_u64(seed),
            held: None,
            line: VecDeque::new(),
            noise: (0, 0.0),
        }
    }

    /// What is read instead.
    pub(super) fn read(&mut self, reading: Reading) -> f64 {
        let Reading {
            now,
            missing,
            span: [low, high],
            offset,
            sigma,
            late,
            neighbour,
        } = reading;
        self.line.push_back(now);
        let old = if self.line.len() > late {
            self.line.pop_front().unwrap_or(now)
        } else {
            now
        };
        if !self.on {
            self.held = Some(now);
            return now;
        }
        match self.defect {
            Defect::Missing => missing,
            Defect::Frozen => *self.held.get_or_insert(now),
            Defect::StuckLow => low,
            Defect::StuckHigh => high,
            Defect::Offset => now + offset,
            Defect::Noisy => {
                let unit: f64 = StandardNormal.sample(&mut self.random);
                now + unit * sigma
            }
            Defect::Late => old,
            Defect::WrongSign => -now,
            Defect::Swapped => neighbour,
            // A supply's: see `controller.rs`.
            Defect::Dips | Defect::Falls => now,
        }
    }

    /// What a contact reads that is open or not, asked each step of the speed task.
    pub(super) fn contact(&mut self, open: bool, neighbour: bool) -> bool {
        let level = |open: bool| f64::from(u8::from(open));
        if self.on && self.defect == Defect::Noisy {
            // Bounces: a new level every other step.
            if self.noise.0.is_multiple_of(2) {
                self.noise.1 = level(self.random.next_u32() & 1 == 1);
            }
            self.noise.0 += 1;
            return self.noise.1 > 0.5;
        }
        if self.on && self.defect == Defect::WrongSign {
            return !open;
        }
        self.read(Reading {
            now: level(open),
            missing: 1.0,
            span: [0.0, 1.0],
            offset: 0.0,
            sigma: 0.0,
            late: 100,
            neighbour: level(neighbour),
        }) > 0.5
    }

    /// What is demanded instead.
    pub(super) fn demand(&mut self, demand: Demand) -> Demand {
        match self.defect {
            Defect::StuckLow => Demand::Rest,
            Defect::StuckHigh => Demand::Reset,
            Defect::Noisy => {
                // Another each 20 ms.
                if self.noise.0.is_multiple_of(100) {
                    self.noise.1 = f64::from(self.random.next_u32() % 4);
                }
                self.noise.0 += 1;
                Demand::of_word(self.noise.1 as u32)
            }
            _ => demand,
        }
    }

    /// The value from before the fault, or this one.
    pub(super) fn held(&mut self, now: f64) -> f64 {
        *self.held.get_or_insert(now)
    }

    /// A number evenly from -1 to 1.
    pub(super) fn random(&mut self) -> f64 {
        f64::from(self.random.next_u32().cast_signed()) / 2f64.powi(31)
    }
}
