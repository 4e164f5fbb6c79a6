//! What the firmware takes of the chip's memories, and the residual.

use crate::cost::stack_bound;
use crate::graph::Graph;
use crate::image::Image;
use object::elf::SHF_ALLOC;
use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, SymbolKind};
use serde_json::{Value, json};

/// The linker script: it says how large the memories are.
const SCRIPT: &str = include_str!("../../memory.x");
/// Symbols that are listed for each memory.
const LISTED: usize = 8;

/// One of the chip's memories.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Memory {
    /// As in the linker script.
    pub name: String,
    /// Its first address.
    pub start: u32,
    /// Its bytes.
    pub limit: u32,
    /// Bytes that are taken; of the RAM, without the stack.
    pub used: u32,
    /// Sections in it: name and bytes; of the flash, also what is copied out of it.
    pub sections: Vec<(String, u32)>,
    /// Its largest symbols: name and bytes.
    pub symbols: Vec<(String, u32)>,
}

/// All of them, and the stack, which grows down from the RAM's end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// In the linker script's order.
    pub memories: Vec<Memory>,
    /// Bytes of stack that all nested tasks can take at most.
    pub stack_bound: u32,
    /// Bytes that are there for it.
    pub stack_room: u32,
}

/// Reads the sizes from the ELF.
///
/// # Errors
/// The ELF or the linker script is not as expected.
pub fn sizes(image: &Image) -> Result<Sizes, String> {
    type Elf<'a> = object::read::elf::ElfFile32<'a, object::Endianness>;
    let file = Elf::parse(&*image.file).map_err(|error| format!("the firmware: {error}"))?;
    let mut memories = regions(SCRIPT)?;
    for memory in &mut memories {
        let inside = |address: u32| address.wrapping_sub(memory.start) < memory.limit;
        for section in file.sections() {
            let SectionFlags::Elf { sh_flags, .. } = section.flags() else {
                continue;
            };
            #[allow(clippy::cast_possible_truncation)]
            let (address, size) = (section.address() as u32, section.size() as u32);
            if !sh_flags.contains(SHF_ALLOC) || size == 0 {
                continue;
            }
            let name = section.name().unwrap_or("?");
            let copied = !inside(address)
                && image
                    .segments
                    .iter()
                    .any(|(load, data)| inside(*load) && held(image, address, size, data));
            if inside(address) || copied {
                memory.sections.push((name.to_owned(), size));
            }
        }
        memory.used = memory.sections.iter().map(|(_, bytes)| bytes).sum();
        let mut symbols: Vec<(String, u32)> = file
            .symbols()
            .filter(|symbol| matches!(symbol.kind(), SymbolKind::Text | SymbolKind::Data))
            .filter(|symbol| inside(symbol.address() as u32))
            .map(|symbol| {
                let name = symbol.name().unwrap_or("?");
                #[allow(clippy::cast_possible_truncation)]
                let size = symbol.size() as u32;
                (format!("{:#}", rustc_demangle::demangle(name)), size)
            })
            .collect();
        symbols.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
        symbols.dedup();
        symbols.truncate(LISTED);
        memory.symbols = symbols;
    }
    let (_, stack_room) = image.ram()?;
    Ok(Sizes {
        memories,
        stack_bound: stack_bound(image, &mut Graph::new(image))?,
        stack_room,
    })
}

/// `data` is what the section at `address` starts with.
fn held(image: &Image, address: u32, size: u32, data: &[u8]) -> bool {
    image
        .bytes(address, size)
        .is_some_and(|section| data.starts_with(section))
}

/// The memories of a linker script.
fn regions(script: &str) -> Result<Vec<Memory>, String> {
    let number = |text: &str| {
        let text = text.trim();
        match (text.strip_prefix("0x"), text.strip_suffix('K')) {
            (Some(hex), _) => u32::from_str_radix(hex, 16).ok(),
            (None, Some(kib)) => kib.parse::<u32>().ok().map(|kib| kib * 1024),
            (None, None) => text.parse().ok(),
        }
    };
    let memories: Vec<Memory> = script
        .lines()
        .filter_map(|line| {
            let (name, rest) = line.split_once(": ORIGIN =")?;
            let (start, limit) = rest.split_once(", LENGTH =")?;
            Some(Memory {
                name: name.trim().to_owned(),
                start: number(start)?,
                limit: number(limit)?,
                used: 0,
                sections: Vec::new(),
                symbols: Vec::new(),
            })
        })
        .collect();
    if memories.is_empty() {
        return Err("the linker script memory.x names no memory".into());
    }
    Ok(memories)
}

impl Sizes {
    /// As JSON.
    #[must_use]
    pub fn json(&self) -> Value {
        let listed = |list: &[(String, u32)]| -> Vec<Value> {
            list.iter()
                .map(|(name, bytes)| json!({"name": name, "bytes": bytes}))
                .collect()
        };
        let memories: Vec<Value> = self
            .memories
            .iter()
            .map(|memory| {
                json!({
                    "name": memory.name,
                    "used_bytes": memory.used,
                    "limit_bytes": memory.limit,
                    "sections": listed(&memory.sections),
                    "largest_symbols": listed(&memory.symbols),
                })
            })
            .collect();
        json!({
            "memories": memories,
            "stack": {"bound_bytes": self.stack_bound, "room_bytes": self.stack_room},
        })
    }
}

impl std::fmt::Display for Sizes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let percent = |part: u32, whole: u32| 100.0 * f64::from(part) / f64::from(whole);
        for memory in &self.memories {
            let Memory {
                name, used, limit, ..
            } = memory;
            let (share, left) = (percent(*used, *limit), limit - used);
            writeln!(
                f,
                "{name:6} {used:>7} of {limit:>7} bytes ({share:4.1} %), {left} left"
            )?;
            for (name, bytes) in &memory.sections {
                writeln!(f, "  {bytes:>7}  section {name}")?;
            }
            for (name, bytes) in &memory.symbols {
                writeln!(f, "  {bytes:>7}  {name}")?;
            }
        }
        let (bound, room) = (self.stack_bound, self.stack_room);
        write!(
            f,
            "stack  {bound:>7} of {room:>7} bytes at most ({:4.1} %)",
            percent(bound, room)
        )
    }
}
