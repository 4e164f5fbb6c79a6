//! One function: its instructions, and the longest way through them.

use crate::image::Image;
use crate::timing::{Decoder, Flow, Instruction, REFILL_MAX};
use std::collections::{BTreeMap, BTreeSet};

/// How often the loops of a function go round at most, and why.
#[derive(Clone, Copy, Debug)]
pub struct LoopBound {
    /// Part of the function's name.
    pub function: &'static str,
    /// Rounds of each of its loops; 0: the function is left out of the longest way.
    pub rounds: u64,
    /// Why no more.
    pub because: &'static str,
}

/// A function's code.
#[derive(Clone, Debug)]
pub struct Body {
    /// Its name.
    pub name: String,
    /// Bytes of stack that it takes itself.
    pub stack: u32,
    /// Indirect calls or jumps: where, and as text.
    pub indirect: Vec<(u32, String)>,
    /// Instructions of the float unit.
    pub float: Vec<(u32, String)>,
    start: u32,
    end: u32,
    instructions: BTreeMap<u32, Instruction>,
}

impl Body {
    /// Reads the function at `address`.
    pub(super) fn read(image: &Image, decoder: &Decoder, address: u32) -> Result<Self, String> {
        let (name, start, end) = match image.functions.get(&address) {
            Some(f) => (f.name.clone(), f.address, f.address + f.size),
            // A linker's veneer has no symbol: three instructions at most.
            None => (format!("veneer at {address:#010x}"), address, address + 16),
        };
        let mut body = Self {
            name,
            stack: 0,
            indirect: Vec::new(),
            float: Vec::new(),
            start,
            end,
            instructions: BTreeMap::new(),
        };
        let mut open = vec![start];
        while let Some(at) = open.pop() {
            // Behind a call that does not come back there may be data.
            let code = (start..end).contains(&at) && image.data_end(at).is_none();
            if body.instructions.contains_key(&at) || !code {
                continue;
            }
            let run = body.run(image, decoder, at)?;
            for mut instruction in run {
                if let Some(targets) = table(image, &instruction) {
                    instruction.flow = Flow::Table(targets);
                }
                let next = instruction.address + instruction.size;
                match instruction.flow {
                    Flow::Table(ref targets) => open.extend(targets),
                    Flow::Branch { to, conditional } => {
                        open.push(to);
                        if conditional {
                            open.push(next);
                        }
                    }
                    Flow::Call(_) | Flow::Return { conditional: true } | Flow::Next => {
                        open.push(next)
                    }
                    Flow::Indirect if comes_back(&instruction) => open.push(next),
                    Flow::Return { conditional: false } | Flow::Indirect => {}
                }
                body.note(&instruction);
                body.instructions.insert(instruction.address, instruction);
            }
        }
        body.resolve_veneer();
        Ok(body)
    }

    /// A linker's veneer puts an address into a register, in two halves, and goes there.
    fn resolve_veneer(&mut self) {
        let list: Vec<&Instruction> = self.instructions.values().collect();
        let [low, high, jump] = list[..] else { return };
        let half = |i: &Instruction, name| {
            let value = i.text.strip_prefix(name)?.rsplit('#').next()?;
            u32::from_str_radix(value.strip_prefix("0x")?, 16).ok()
        };
        let (Some(low), Some(high)) = (half(low, "movw"), half(high, "movt")) else {
            return;
        };
        let (at, to) = (jump.address, (high << 16 | low) & !1);
        if let Some(jump) = self.instructions.get_mut(&at) {
            jump.flow = Flow::Branch {
                to,
                conditional: false,
            };
            self.indirect.clear();
        }
    }

    /// Straight code from `at` to the first instruction that may go elsewhere.
    fn run(&self, image: &Image, decoder: &Decoder, at: u32) -> Result<Vec<Instruction>, String> {
        // Behind a call that does not come back there may be data.
        let room = image
            .data_after(at)
            .map_or(self.end, |data| data.min(self.end))
            - at;
        let code = image
            .bytes(at, room)
            .ok_or_else(|| format!("{} at {at:#010x} is not in the image", self.name))?;
        let mut list = decoder.decode_straight(code, at)?;
        if list.is_empty() {
            // The disassembler keeps the state of an IT block over its calls: a new one begins outside of any.
            list = Decoder::new().decode_straight(code, at)?;
        }
        if list.is_empty() {
            return Err(format!("{}: no instruction at {at:#010x}", self.name));
        }
        // Not beyond what is known already.
        let known = list
            .iter()
            .position(|i| self.instructions.contains_key(&i.address))
            .unwrap_or(list.len());
        list.truncate(known);
        Ok(list)
    }

    fn note(&mut self, instruction: &Instruction) {
        let text = &instruction.text;
        if instruction.float {
            self.float.push((instruction.address, text.clone()));
        }
        if instruction.flow == Flow::Indirect {
            self.indirect.push((instruction.address, text.clone()));
        }
        let registers = || text.matches(',').count() as u32 + 1;
        let immediate = || {
            text.rsplit('#')
                .next()
                .and_then(|n| match n.strip_prefix("0x") {
                    Some(hex) => u32::from_str_radix(hex, 16).ok(),
                    None => n.parse().ok(),
                })
        };
        if text.starts_with("push") || text.starts_with("stmdb sp!") {
            self.stack += 4 * registers();
        } else if text.starts_with("vpush") {
            self.stack += 8 * registers();
        } else if text.starts_with("sub") && text.contains(" sp, ") {
            self.stack += immediate().unwrap_or(0);
        } else if text.starts_with("str") && text.contains("[sp, #-") {
            self.stack += immediate().unwrap_or(0).max(4);
        }
    }

    /// Where it traps (`UDF`) by a branch or by going on. A table's entry for what cannot be is not counted: the compiler
    /// knows that no way leads there.
    pub(super) fn traps(&self) -> impl Iterator<Item = u32> {
        let goes_to = |trap: u32| {
            self.instructions.values().any(|i| {
                let next = i.address + i.size == trap;
                match i.flow {
                    Flow::Branch { to, conditional } => to == trap || conditional && next,
                    Flow::Return { conditional: true } | Flow::Next | Flow::Call(_) => next,
                    Flow::Return { conditional: false } | Flow::Table(_) | Flow::Indirect => false,
                }
            })
        };
        let traps = self.instructions.values().filter(|i| i.traps());
        traps.map(|i| i.address).filter(move |&at| goes_to(at))
    }

    /// The functions that it calls, or ends in.
    #[must_use]
    pub fn calls(&self) -> BTreeSet<u32> {
        self.instructions
            .values()
            .filter_map(|i| self.leaves_to(i))
            .collect()
    }

    fn leaves_to(&self, instruction: &Instruction) -> Option<u32> {
        match instruction.flow {
            Flow::Call(to) => Some(to),
            Flow::Branch { to, .. } if !(self.start..self.end).contains(&to) => Some(to),
            _ => None,
        }
    }

    /// Cycles of the longest way through, with those of its calls; `by_register`: of the longest that a register can call.
    pub(super) fn longest(
        &self,
        calls: &BTreeMap<u32, u64>,
        by_register: u64,
        bound: Option<&LoopBound>,
    ) -> Result<u64, String> {
        let mut search = Search {
            body: self,
            calls,
            by_register,
            bound,
            done: BTreeMap::new(),
            path: Vec::new(),
        };
        search.from(self.start)
    }
}

/// Where a table branch goes: `tbb` and `tbh` have their offsets, in halfwords, right after them, up to the end of the data there,
/// or where that is not known to the first instruction that one of them leads to.
fn table(image: &Image, instruction: &Instruction) -> Option<Vec<u32>> {
    let width = match instruction.text.split_once(' ') {
        Some(("mov", operands)) if operands.starts_with("pc,") => {
            return Some(branches(image, instruction.address + instruction.size));
        }
        Some(("tbb", operands)) if operands.starts_with("[pc") => 1,
        Some(("tbh", operands)) if operands.starts_with("[pc") => 2,
        _ => return None,
    };
    let base = instruction.address + 4;
    let mut targets: Vec<u32> = Vec::new();
    let mut at = base;
    let end = image.data_end(base);
    while end.is_none_or(|end| at < end) && targets.iter().min().is_none_or(|&first| at < first) {
        let bytes = image.bytes(at, width)?;
        let offset = bytes
            .iter()
            .rev()
            .fold(0, |value, &byte| value << 8 | u32::from(byte));
        targets.push(base + 2 * offset);
        at += width;
    }
    // Padding may stand between the table and the code: a byte, or a `NOP`.
    const NOP: u32 = 0xBF00;
    if width == 1 && at > base + 1 {
        targets.retain(|&to| to > base);
    } else {
        targets.retain(|&to| to != base + 2 * NOP);
    }
    Some(targets)
}

/// Places of the branches that follow a jump into them: a table where a function is too long for offsets of two bytes.
fn branches(image: &Image, after: u32) -> Vec<u32> {
    // Encoding T4 of B (ARM DDI 0403E, A7.7.12).
    let is_branch = |at: u32| {
        let Some(&[a, b, c, d]) = image.bytes(at, 4) else {
            return false;
        };
        let (first, second) = (u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d]));
        first & 0xF800 == 0xF000 && second & 0xD000 == 0x9000
    };
    let first = (after + 3) & !3;
    (first..)
        .step_by(4)
        .take_while(|&at| is_branch(at))
        .collect()
}

/// A call by register: it goes on after it.
fn comes_back(instruction: &Instruction) -> bool {
    instruction.text.starts_with("blx")
}

struct Search<'a> {
    body: &'a Body,
    calls: &'a BTreeMap<u32, u64>,
    by_register: u64,
    bound: Option<&'a LoopBound>,
    done: BTreeMap<u32, u64>,
    /// In the order of the way.
    path: Vec<u32>,
}

impl Search<'_> {
    /// Cycles of the longest way from the instruction at `at` to the function's end.
    fn from(&mut self, at: u32) -> Result<u64, String> {
        if let Some(&cycles) = self.done.get(&at) {
            return Ok(cycles);
        }
        let Some(instruction) = self.body.instructions.get(&at) else {
            return Err(format!("the way leaves the function's code at {at:#010x}"));
        };
        self.path.push(at);
        let next = instruction.address + instruction.size;
        let called = self
            .body
            .leaves_to(instruction)
            .and_then(|to| self.calls.get(&to))
            .copied()
            .unwrap_or(0);
        let own = instruction.cycles;
        let cycles = match instruction.flow.clone() {
            Flow::Next => own + self.go(at, next)?,
            // A call at the end does not come back.
            Flow::Call(_) if next >= self.body.end => own + REFILL_MAX + called,
            Flow::Call(_) => own + REFILL_MAX + called + self.go(at, next)?,
            Flow::Return { conditional } => {
                let on = if conditional { self.go(at, next)? } else { 0 };
                own + REFILL_MAX.max(on)
            }
            Flow::Branch { to, conditional } => {
                let inside = (self.body.start..self.body.end).contains(&to);
                let taken = REFILL_MAX + if inside { self.go(at, to)? } else { called };
                let on = if conditional { self.go(at, next)? } else { 0 };
                own + taken.max(on)
            }
            Flow::Table(ref targets) => {
                let mut longest = 0;
                for &to in targets {
                    longest = longest.max(self.go(at, to)?);
                }
                own + REFILL_MAX + longest
            }
            Flow::Indirect if comes_back(instruction) && next < self.body.end => {
                own + REFILL_MAX + self.by_register + self.go(at, next)?
            }
            Flow::Indirect => own + REFILL_MAX + self.by_register,
        };
        self.path.pop();
        self.done.insert(at, cycles);
        Ok(cycles)
    }

    /// On from `from` to `to`. A way back into the path is a loop: all of the function's code between its ends, wherever it is
    /// entered, is then taken `rounds` times, which is more than it can be.
    fn go(&mut self, from: u32, to: u32) -> Result<u64, String> {
        let Some(entered) = self.path.iter().position(|&at| at == to) else {
            return self.from(to);
        };
        let round = self.path.iter().skip(entered);
        let (first, last) = round.fold((from, from), |(first, last), &at| {
            (first.min(at), last.max(at))
        });
        let bound = self.bound.ok_or_else(|| {
            format!("a loop from {from:#010x} back to {to:#010x} without a bound")
        })?;
        let round: u64 = self
            .body
            .instructions
            .range(first..=last)
            .map(|(_, i)| {
                let called = self
                    .body
                    .leaves_to(i)
                    .and_then(|to| self.calls.get(&to))
                    .copied()
                    .unwrap_or(0);
                let by_register = match i.flow {
                    Flow::Indirect => self.by_register,
                    _ => 0,
                };
                let refill = if i.flow == Flow::Next { 0 } else { REFILL_MAX };
                i.cycles + called + by_register + refill
            })
            .sum();
        Ok(round * bound.rounds)
    }
}
