//! The firmware's ELF: what goes where, and what is called how.

use object::{Object, ObjectSegment, ObjectSymbol, SymbolKind};
use std::collections::BTreeMap;
use std::path::Path;

/// A function of the image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Function {
    /// Its demangled name, without hash.
    pub name: String,
    /// Address of its first instruction, where it runs.
    pub address: u32,
    /// Bytes.
    pub size: u32,
}

/// A loaded ELF.
#[derive(Clone, Debug)]
pub struct Image {
    /// The file itself.
    pub file: Vec<u8>,
    /// Load address and bytes of each segment.
    pub segments: Vec<(u32, Vec<u8>)>,
    /// Where each segment runs: address, and index and offset of its bytes; for code that is copied before use.
    code: Vec<(u32, Vec<u8>)>,
    /// By address.
    pub functions: BTreeMap<u32, Function>,
    symbols: BTreeMap<String, u32>,
    /// Where data within code begins (`true`) and ends (ELF for the Arm Architecture, mapping symbols `$d` and `$t`).
    data: BTreeMap<u32, bool>,
}

impl Image {
    /// Reads an ELF file.
    ///
    /// # Errors
    /// A sentence that says what is wrong with the file.
    pub fn read(path: &Path) -> Result<Self, String> {
        let bytes = std::fs::read(path).map_err(|error| {
            format!(
                "cannot read the firmware {}: {error}; build it with `cargo xtask build`",
                path.display()
            )
        })?;
        Self::parse(&bytes)
            .map_err(|error| format!("{} is not an ELF for this chip: {error}", path.display()))
    }

    fn parse(bytes: &[u8]) -> Result<Self, object::Error> {
        let file = object::read::elf::ElfFile32::<object::Endianness>::parse(bytes)?;
        let mut image = Self {
            file: bytes.to_vec(),
            segments: Vec::new(),
            code: Vec::new(),
            functions: BTreeMap::new(),
            symbols: BTreeMap::new(),
            data: BTreeMap::new(),
        };
        let endian = file.endian();
        for segment in file.segments() {
            let data = segment.data()?.to_vec();
            if data.is_empty() {
                continue;
            }
            let load = segment.elf_program_header().p_paddr.get(endian);
            #[allow(clippy::cast_possible_truncation)]
            image.code.push((segment.address() as u32, data.clone()));
            image.segments.push((load, data));
        }
        for symbol in file.symbols() {
            let Ok(name) = symbol.name() else { continue };
            #[allow(clippy::cast_possible_truncation)]
            let (address, size) = (symbol.address() as u32, symbol.size() as u32);
            if let Some(kind @ ("$d" | "$t")) = name.get(..2) {
                image.data.insert(address, kind == "$d");
            }
            image.symbols.insert(name.to_owned(), address);
            if symbol.kind() == SymbolKind::Text && size > 0 {
                let name = format!("{:#}", rustc_demangle::demangle(name));
                let address = address & !1;
                image.functions.insert(
                    address,
                    Function {
                        name,
                        address,
                        size,
                    },
                );
            }
        }
        Ok(image)
    }

    /// Where the data ends in which `address`, within code, is; `None` if it is in none.
    #[must_use]
    pub fn data_end(&self, address: u32) -> Option<u32> {
        let (_, data) = self.data.range(..=address).next_back()?;
        let mut after = self.data.range(address + 1..);
        let end = after.find(|(_, data)| !**data).map(|(&end, _)| end);
        end.filter(|_| *data)
    }

    /// Where the next data begins after `address`; `None` if none does.
    #[must_use]
    pub fn data_after(&self, address: u32) -> Option<u32> {
        let mut after = self.data.range(address + 1..);
        after.find(|(_, data)| **data).map(|(&begin, _)| begin)
    }

    /// The address of a symbol.
    ///
    /// # Errors
    /// A sentence that says that it is missing.
    pub fn symbol(&self, name: &str) -> Result<u32, String> {
        self.symbols
            .get(name)
            .copied()
            .ok_or_else(|| format!("the firmware has no symbol `{name}`"))
    }

    /// The address of a symbol by its demangled name, without hash.
    ///
    /// # Errors
    /// A sentence that says that it is missing.
    pub fn demangled(&self, name: &str) -> Result<u32, String> {
        let mut symbols = self.symbols.iter();
        let found =
            symbols.find(|(mangled, _)| format!("{:#}", rustc_demangle::demangle(mangled)) == name);
        found
            .map(|(_, &at)| at)
            .ok_or_else(|| format!("the firmware has no symbol `{name}`"))
    }

    /// Bytes of RAM that objects and fast code take, and bytes that are left for the stack.
    ///
    /// # Errors
    /// The linker script's symbols are missing.
    pub fn ram(&self) -> Result<(u32, u32), String> {
        const START: u32 = 0x2000_0000;
        let end = self.symbol("__eguard")?;
        let fast_code = self.symbol("__eccm")? - self.symbol("__sccm")?;
        Ok((end - START + fast_code, self.symbol("_stack_start")? - end))
    }

    /// What the vector table has: exception number and the handler's address, of all but the stack and the reset.
    ///
    /// # Errors
    /// The table is not at the start of the flash.
    pub fn vectors(&self) -> Result<Vec<(usize, u32)>, String> {
        const TABLE: u32 = 0x0800_0000;
        const EXCEPTIONS: usize = 16 + 102;
        (2..EXCEPTIONS)
            .map(|number| {
                let at = TABLE + 4 * number as u32;
                let word = self
                    .bytes(at, 4)
                    .and_then(|bytes| bytes.try_into().ok())
                    .map(u32::from_le_bytes)
                    .ok_or_else(|| format!("there is no vector table at {TABLE:#010x}"))?;
                Ok((number, word & !1))
            })
            .filter(|vector| vector.as_ref().map_or(true, |(_, handler)| *handler != 0))
            .collect()
    }

    /// The function that holds `address`.
    #[must_use]
    pub fn function_at(&self, address: u32) -> Option<&Function> {
        let (_, function) = self.functions.range(..=address).next_back()?;
        (address < function.address + function.size).then_some(function)
    }

    /// `size` bytes at `address`, where they run.
    #[must_use]
    pub fn bytes(&self, address: u32, size: u32) -> Option<&[u8]> {
        self.code.iter().find_map(|(start, data)| {
            let offset = address.checked_sub(*start)? as usize;
            data.get(offset..offset.checked_add(size as usize)?)
        })
    }
}
