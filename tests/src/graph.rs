//! The image's code as a graph: what calls what, how long the longest way through takes, how deep the stack goes.
//!
//! Functions are read from the ELF by following their instructions from the first, so data between them is never taken
//! for code. An address that only a register knows (an indirect call) is reported, never guessed.

mod function;

pub use function::{Body, LoopBound};

use crate::image::Image;
use crate::timing::Decoder;
use std::collections::{BTreeMap, BTreeSet};

/// What can be said of a function and all that it calls.
#[derive(Clone, Debug, Default)]
pub struct Reach {
    /// Functions that can run, by address.
    pub functions: BTreeSet<u32>,
    /// Indirect calls or jumps: where, and as text.
    pub indirect: Vec<(u32, String)>,
    /// Instructions of the float unit: where, and as text.
    pub float: Vec<(u32, String)>,
    /// Traps that a way leads to.
    pub traps: Vec<u32>,
}

/// The graph of an image.
pub struct Graph<'a> {
    image: &'a Image,
    decoder: Decoder,
    bodies: BTreeMap<u32, Body>,
    /// Stack of the deepest function that only a register can call.
    deepest_by_register: Option<u32>,
    /// What some functions can call by register: a part of their name, and where that is.
    targets: Vec<(&'static str, BTreeSet<u32>)>,
}

/// The table of the executor's wakers: clone, wake, wake by reference, drop.
const WAKERS: &str = "rtic::export::executor::WAKER_VTABLE";
/// Who calls by it: the time queue and the dispatchers.
const WAKING: [&str; 4] = ["SysTick", "CRS", "RNG", "rtic_time::"];
/// What a waker's wake goes on to: a closure that pends a dispatcher.
const WAKE: &str = "rtic::export::executor::waker_";
const PENDING: &str = "FnOnce::call_once";

/// How many calls by register can be under way in one another: formatting calls an argument's way to be shown, which
/// calls the way to write text.
const CALLS_BY_REGISTER: u32 = 3;

impl<'a> Graph<'a> {
    /// The graph of `image`; functions are read as they are needed.
    #[must_use]
    pub fn new(image: &'a Image) -> Self {
        Self {
            image,
            decoder: Decoder::new(),
            bodies: BTreeMap::new(),
            deepest_by_register: None,
            targets: Vec::new(),
        }
    }

    /// Reads what the executor's wakers can call: the functions of their table, and of those the closures that nothing calls by
    /// name.
    ///
    /// # Errors
    /// There is no such table, or a function cannot be read.
    pub fn find_wakers(&mut self) -> Result<(), String> {
        let table = self.image.demangled(WAKERS)?;
        let words = self
            .image
            .bytes(table, 16)
            .ok_or_else(|| format!("{WAKERS} at {table:#010x} is not in the image"))?;
        let (words, _) = words.as_chunks::<4>();
        let wakers: BTreeSet<u32> = words.iter().map(|w| u32::from_le_bytes(*w) & !1).collect();
        if let Some(odd) = wakers
            .iter()
            .find(|at| !self.image.functions.contains_key(at))
        {
            return Err(format!(
                "{WAKERS} has {odd:#010x}, where no function begins"
            ));
        }
        let pending = self.uncalled()?;
        let pending = pending
            .into_iter()
            .filter(|&at| self.name(at).ends_with(PENDING));
        let pending = pending.collect();
        self.targets = WAKING.iter().map(|&name| (name, wakers.clone())).collect();
        self.targets.push((WAKE, pending));
        Ok(())
    }

    /// What the function of that name can call by register, if that is known.
    fn by_register(&self, name: &str) -> Option<&BTreeSet<u32>> {
        let mut known = self.targets.iter();
        known.find_map(|(part, targets)| name.starts_with(part).then_some(targets))
    }

    /// The name of the function at `address`.
    #[must_use]
    pub fn name(&self, address: u32) -> String {
        self.image
            .function_at(address)
            .map_or_else(|| format!("{address:#010x}"), |f| f.name.clone())
    }

    /// The function at `address`.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn body(&mut self, address: u32) -> Result<&Body, String> {
        if !self.bodies.contains_key(&address) {
            let body = Body::read(self.image, &self.decoder, address)?;
            self.bodies.insert(address, body);
        }
        Ok(&self.bodies[&address])
    }

    /// All that can run from the function at `start`.
    ///
    /// # Errors
    /// A function cannot be read.
    pub fn reach(&mut self, start: u32) -> Result<Reach, String> {
        let mut reach = Reach::default();
        let mut open = vec![start];
        while let Some(address) = open.pop() {
            if !reach.functions.insert(address) {
                continue;
            }
            let body = self.body(address)?;
            open.extend(body.calls());
            reach.indirect.extend(body.indirect.iter().cloned());
            reach.float.extend(body.float.iter().cloned());
            reach.traps.extend(body.traps());
        }
        Ok(reach)
    }

    /// Bytes of stack that the function at `start` and all that it calls can take. Where it calls what only a register
    /// knows, the deepest of the functions that nothing calls by name is taken, three times in one another.
    ///
    /// # Errors
    /// A function cannot be read, or calls itself.
    pub fn stack(&mut self, start: u32) -> Result<u32, String> {
        let named = self.deepest(start, &mut Vec::new())?;
        if self.reach(start)?.indirect.is_empty() {
            return Ok(named);
        }
        let by_register = match self.deepest_by_register {
            Some(known) => known,
            None => self.find_deepest_by_register()?,
        };
        Ok(named + CALLS_BY_REGISTER * by_register)
    }

    /// Bytes of stack that are taken when the function at `start` has come to the call of the one at `to`; `None` if it calls it
    /// never, by name.
    ///
    /// # Errors
    /// A function cannot be read, or calls itself.
    pub fn stack_before(&mut self, start: u32, to: u32) -> Result<Option<u32>, String> {
        if start == to {
            return Ok(Some(0));
        }
        if !self.reach(start)?.functions.contains(&to) {
            return Ok(None);
        }
        let body = self.body(start)?;
        let (own, calls) = (body.stack, body.calls());
        let mut most = None;
        for call in calls {
            most = most.max(self.stack_before(call, to)?);
        }
        Ok(most.map(|below| own + below))
    }

    /// The largest frame that a function takes at once, bytes, and the function's name.
    ///
    /// # Errors
    /// A function cannot be read.
    pub fn largest_frame(&mut self) -> Result<(u32, String), String> {
        let all: Vec<u32> = self.image.functions.keys().copied().collect();
        let mut largest = (0, 0);
        for function in all {
            largest = largest.max((self.body(function)?.stack, function));
        }
        Ok((largest.0, self.name(largest.1)))
    }

    /// Functions that nothing calls by name.
    fn uncalled(&mut self) -> Result<BTreeSet<u32>, String> {
        let all: BTreeSet<u32> = self.image.functions.keys().copied().collect();
        let mut called = BTreeSet::new();
        for &function in &all {
            called.extend(self.body(function)?.calls());
        }
        Ok(&all - &called)
    }

    fn find_deepest_by_register(&mut self) -> Result<u32, String> {
        // The runtime's own entries are called by the hardware.
        let by_hardware = |name: &str| !name.contains("::");
        let mut deepest = 0;
        for function in self.uncalled()? {
            if !by_hardware(&self.name(function)) {
                deepest = deepest.max(self.deepest(function, &mut Vec::new())?);
            }
        }
        self.deepest_by_register = Some(deepest);
        Ok(deepest)
    }

    fn deepest(&mut self, address: u32, path: &mut Vec<u32>) -> Result<u32, String> {
        if path.contains(&address) {
            return Err(format!(
                "{} calls itself: its stack has no bound",
                self.name(address)
            ));
        }
        path.push(address);
        let body = self.body(address)?;
        let (own, calls) = (body.stack, body.calls());
        let mut below = 0;
        for call in calls {
            below = below.max(self.deepest(call, path)?);
        }
        path.pop();
        Ok(own + below)
    }

    /// Cycles of the longest way through the function at `start` and all that it calls, its entry and exit as an
    /// exception not included. `loops` bounds the loops that it has.
    ///
    /// # Errors
    /// A function cannot be read, has a loop that `loops` does not bound, or an indirect call.
    pub fn longest(&mut self, start: u32, loops: &[LoopBound]) -> Result<u64, String> {
        let mut done = BTreeMap::new();
        self.longest_of(start, loops, &mut done)
    }

    fn longest_of(
        &mut self,
        address: u32,
        loops: &[LoopBound],
        done: &mut BTreeMap<u32, u64>,
    ) -> Result<u64, String> {
        if let Some(&cycles) = done.get(&address) {
            return Ok(cycles);
        }
        let name = self.name(address);
        let bound = loops.iter().find(|bound| name.contains(bound.function));
        if bound.is_some_and(|bound| bound.rounds == 0) {
            return Ok(0);
        }
        let body = self.body(address)?.clone();
        let mut by_register = 0;
        if let Some((at, text)) = body.indirect.first() {
            let targets = self.by_register(&name).cloned().ok_or_else(|| {
                format!("{name} goes where only a register knows, at {at:#010x}: {text}")
            })?;
            for target in targets {
                by_register = by_register.max(self.longest_of(target, loops, done)?);
            }
        }
        let mut calls = BTreeMap::new();
        for call in body.calls() {
            calls.insert(call, self.longest_of(call, loops, done)?);
        }
        let cycles = body
            .longest(&calls, by_register, bound)
            .map_err(|error| format!("{name}: {error}"))?;
        done.insert(address, cycles);
        Ok(cycles)
    }
}
