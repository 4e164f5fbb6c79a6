//! What a session needs of the firmware's ELF: where its structures are, and what its log's numbers mean.

use anyhow::{Context, Result, anyhow};
use link::host::Drive;
use object::{Object, ObjectSymbol};
use std::path::Path;

/// The ELF.
pub struct Image {
    bytes: Vec<u8>,
}

impl Image {
    /// Reads it.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes =
            std::fs::read(path).with_context(|| format!("{} cannot be read", path.display()))?;
        Ok(Self { bytes })
    }

    /// Its bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Where the drive has what a host needs.
    pub fn drive(&self) -> Result<Drive> {
        Drive::locate(|name| self.symbol(name))
    }

    /// The address of a symbol.
    pub fn symbol(&self, name: &str) -> Result<u32> {
        let file = object::File::parse(&*self.bytes).context("the firmware is not an ELF")?;
        let symbol = file
            .symbol_by_name(name)
            .ok_or_else(|| anyhow!("the firmware has no symbol {name}"))?;
        u32::try_from(symbol.address()).context("a symbol beyond 32 bits")
    }
}
