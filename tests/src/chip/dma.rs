//! DMA1 and its multiplexer: circular transfers of half words between a peripheral and memory, of bytes to memory, and pieces of
//! bytes from memory (RM0440 12 and 13).

use super::registers::Registers;

/// Channels that the model has.
const CHANNELS: usize = 8;

const CR: u32 = 0x0;
const NDTR: u32 = 0x4;

const ENABLE: u32 = 1;
const FROM_MEMORY: u32 = 1 << 4;
const CIRCULAR: u32 = 1 << 5;
const MEMORY_COUNTS_UP: u32 = 1 << 7;
const HALF_WORDS: u32 = 1 << 8 | 1 << 10;
const PRIORITY: u32 = 3 << 12;

struct Channel {
    registers: Registers,
    request: u32,
    /// Transfers that are left of the round.
    left: u32,
    /// Its piece has been taken.
    taken: bool,
}

/// Where a request takes a half word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transfer {
    /// From the peripheral to this address of memory.
    ToMemory(u32),
    /// From this address of memory to the peripheral.
    FromMemory(u32),
}

/// DMA1 with DMAMUX.
pub struct Dma {
    channels: [Channel; CHANNELS],
}

impl Dma {
    /// After reset.
    #[must_use]
    pub fn new() -> Self {
        let names = ["DMA1 channel 1", "2", "3", "4", "5", "6", "7", "8"];
        Self {
            channels: names.map(|name| Channel {
                registers: Registers::new(
                    name,
                    &[
                        ("CR", CR, 0),
                        ("NDTR", NDTR, 0),
                        ("PAR", 0x8, 0),
                        ("MAR", 0xC, 0),
                    ],
                ),
                request: 0,
                left: 0,
                taken: false,
            }),
        }
    }

    /// The peripheral whose data register is at `data` makes `request`: what is to go where. `None` if no channel
    /// listens.
    ///
    /// # Errors
    /// A channel takes the request and is not set up for it.
    pub fn request(&mut self, request: u32, data: u32) -> Result<Option<Transfer>, String> {
        self.circular(request, data, 2)
    }

    /// The same for a byte that has come: where it goes.
    ///
    /// # Errors
    /// A channel takes the request and is not set up for it.
    pub fn request_byte(&mut self, request: u32, data: u32) -> Result<Option<u32>, String> {
        match self.circular(request, data, 1)? {
            None => Ok(None),
            Some(Transfer::ToMemory(address)) => Ok(Some(address)),
            Some(Transfer::FromMemory(_)) => {
                Err("the DMA writes to a data register that is read".into())
            }
        }
    }

    /// The piece of memory that a channel was told to send to the data register at `data`, once: where and how many bytes.
    ///
    /// # Errors
    /// The channel that listens to `request` is not set up for it.
    pub fn take_piece(&mut self, request: u32, data: u32) -> Result<Option<(u32, usize)>, String> {
        let listens = |channel: &&mut Channel| channel.request == request;
        let Some(channel) = self.channels.iter_mut().find(listens) else {
            return Ok(None);
        };
        let cr = channel.registers.get("CR");
        if cr & ENABLE == 0 || channel.taken {
            return Ok(None);
        }
        if cr & !PRIORITY != ENABLE | FROM_MEMORY | MEMORY_COUNTS_UP
            || channel.registers.get("PAR") != data
        {
            return Err(format!(
                "a DMA channel is not set up to send bytes (CR {cr:#x})"
            ));
        }
        channel.taken = true;
        Ok(Some((channel.registers.get("MAR"), channel.left as usize)))
    }

    /// So many bytes of the piece have not gone yet.
    pub fn set_left(&mut self, request: u32, left: usize) {
        for channel in &mut self.channels {
            if channel.request == request && channel.taken {
                channel.left = u32::try_from(left).unwrap_or(u32::MAX);
            }
        }
    }

    fn circular(
        &mut self,
        request: u32,
        data: u32,
        bytes: u32,
    ) -> Result<Option<Transfer>, String> {
        let Some(index) = self
            .channels
            .iter()
            .position(|channel| channel.request == request)
        else {
            return Ok(None);
        };
        let channel = &mut self.channels[index];
        let (cr, count) = (channel.registers.get("CR"), channel.registers.get("NDTR"));
        if cr & ENABLE == 0 {
            return Ok(None);
        }
        let choices = FROM_MEMORY | MEMORY_COUNTS_UP | PRIORITY;
        let size = if bytes == 2 { HALF_WORDS } else { 0 };
        if cr & !choices != ENABLE | CIRCULAR | size || channel.registers.get("PAR") != data {
            return Err(format!(
                "DMA1 channel {} is not set up as this model has it (CR {cr:#x})",
                index + 1
            ));
        }
        let passed = if cr & MEMORY_COUNTS_UP == 0 {
            0
        } else {
            bytes * (count - channel.left)
        };
        channel.left = if channel.left > 1 {
            channel.left - 1
        } else {
            count
        };
        let memory = channel.registers.get("MAR") + passed;
        Ok(Some(if cr & FROM_MEMORY == 0 {
            Transfer::ToMemory(memory)
        } else {
            Transfer::FromMemory(memory)
        }))
    }

    fn at(address: u32) -> Option<(usize, u32)> {
        let offset = (address & 0x3FF).checked_sub(8)?;
        let (channel, offset) = (offset / 20, offset % 20);
        ((channel as usize) < CHANNELS).then_some((channel as usize, offset))
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn read(&self, address: u32) -> Result<u32, String> {
        match (address & 0x800, Self::at(address)) {
            (0, Some((channel, NDTR))) => Ok(self.channels[channel].left),
            (0, Some((channel, offset))) => self.channels[channel].registers.read(offset),
            _ => Err("DMA or DMAMUX have no such register in this model".into()),
        }
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The model does not have it, or the channel runs.
    pub fn write(&mut self, address: u32, value: u32) -> Result<(), String> {
        let multiplexed = (address & 0x3FF) as usize / 4;
        match (address & 0x800, Self::at(address)) {
            (0, Some((channel, offset))) => {
                let channel = &mut self.channels[channel];
                if offset != CR && channel.registers.get("CR") & ENABLE != 0 {
                    return Err("a DMA channel is set up while it runs".into());
                }
                if offset == CR && value & ENABLE == 0 {
                    channel.taken = false;
                }
                if offset == NDTR {
                    channel.left = value;
                }
                channel.registers.write(offset, value).map(|_| ())
            }
            (0x800, _) if multiplexed < CHANNELS => {
                self.channels[multiplexed].request = value;
                Ok(())
            }
            _ => Err("DMA or DMAMUX have no such register in this model".into()),
        }
    }
}

impl Default for Dma {
    fn default() -> Self {
        Self::new()
    }
}
