//! Registers that hold what is written to them: a table of names, offsets and reset values.

/// A register of a table.
#[derive(Clone, Copy, Debug)]
pub struct Register {
    name: &'static str,
    offset: u32,
    value: u32,
}

/// A peripheral's plain registers.
#[derive(Clone, Debug)]
pub struct Registers {
    peripheral: &'static str,
    table: Vec<Register>,
}

impl Registers {
    /// Registers by name, offset and reset value.
    #[must_use]
    pub fn new(peripheral: &'static str, table: &[(&'static str, u32, u32)]) -> Self {
        let table = table
            .iter()
            .map(|&(name, offset, value)| Register {
                name,
                offset,
                value,
            })
            .collect();
        Self { peripheral, table }
    }

    /// The peripheral, and its registers: name, offset, value.
    #[must_use]
    pub fn layout(&self) -> (&'static str, Vec<(&'static str, u32, u32)>) {
        let table = self.table.iter();
        let registers = table.map(|register| (register.name, register.offset, register.value));
        (self.peripheral, registers.collect())
    }

    fn unknown(&self, offset: u32) -> String {
        format!(
            "{} has no register at offset {offset:#x} in this model",
            self.peripheral
        )
    }

    /// The value at `offset`.
    ///
    /// # Errors
    /// The model has no register there.
    pub fn read(&self, offset: u32) -> Result<u32, String> {
        self.table
            .iter()
            .find(|register| register.offset == offset)
            .map(|register| register.value)
            .ok_or_else(|| self.unknown(offset))
    }

    /// Sets the value at `offset`, and gives the register's name.
    ///
    /// # Errors
    /// The model has no register there.
    pub fn write(&mut self, offset: u32, value: u32) -> Result<&'static str, String> {
        let unknown = self.unknown(offset);
        let register = self
            .table
            .iter_mut()
            .find(|register| register.offset == offset)
            .ok_or(unknown)?;
        register.value = value;
        Ok(register.name)
    }

    /// The value of the register called `name`, which the table must have.
    #[must_use]
    pub fn get(&self, name: &str) -> u32 {
        self.table
            .iter()
            .find(|register| register.name == name)
            .map_or(0, |register| register.value)
    }

    /// Sets the register called `name`.
    pub fn set(&mut self, name: &str, value: u32) {
        if let Some(register) = self.table.iter_mut().find(|register| register.name == name) {
            register.value = value;
        }
    }
}
