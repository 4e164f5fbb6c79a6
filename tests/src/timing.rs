//! What an instruction costs on a Cortex-M4.
//!
//! The figures are those of the Cortex-M4 Technical Reference Manual (ARM DDI 0439, tables 3-1 and 7-1 and section 3.3.3),
//! for code and data without wait states. The rules:
//!
//! | instruction | cycles |
//! | --- | --- |
//! | data processing, saturation, `MUL`, long multiplies, DSP | 1 |
//! | `MLA`, `MLS` | 2 |
//! | `UDIV`, `SDIV` | 12, their longest |
//! | load of one register | 2; 1 right after another load or store that does not make its address |
//! | store of one register, immediate offset | 1; register offset 2 |
//! | load or store of `n` registers | 1 + n |
//! | branch taken, or any write of the PC | 1 + P; not taken 1 |
//! | `TBB`, `TBH` | 2 + P |
//! | `MRS`, `MSR`, `CPS` | 2 |
//! | `DMB`, `DSB`, `ISB` | 4 |
//! | load, store or move of a float register | as an integer one; a move of two 2 |
//! | float multiply and add 3, `VDIV` and `VSQRT` 14, other float arithmetic | 1 |
//! | an instruction that its `IT` skips | as if executed |
//!
//! P, the refill of the pipeline, is 1 to 3; [`REFILL`] is taken for what runs, [`REFILL_MAX`] for the bound.
//! Entering an exception takes [`ENTRY`] cycles and leaving it [`EXIT`]. What the bus adds to an access of a
//! peripheral is counted where the access happens (`chip::bus_wait`).

use capstone::arch::arm::ArmOperandType;
use capstone::prelude::*;

/// How many more cycles than the model says a real Cortex-M4 may take, %: the worst of five operations of a library whose
/// cycles were published; none took fewer. `tests/published_cycles` has them, and holds this figure to what it finds.
pub const MODEL_ERROR_PERCENT: f64 = 7.0;
/// P for what runs.
pub const REFILL: u64 = 2;
/// P for the bound.
pub const REFILL_MAX: u64 = 3;
/// Cycles from an interrupt to its first instruction.
pub const ENTRY: u64 = 12;
/// Cycles from its last instruction to the interrupted one.
pub const EXIT: u64 = 12;

/// How an instruction may end its block.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Flow {
    /// Goes on.
    Next,
    /// Branches, always or if a condition holds, to an address.
    Branch {
        /// Where to.
        to: u32,
        /// It may fall through instead.
        conditional: bool,
    },
    /// Calls an address and comes back.
    Call(u32),
    /// Returns: writes the PC from the stack or from `LR`.
    Return {
        /// It may fall through instead.
        conditional: bool,
    },
    /// Goes to one of these, by a table after the instruction.
    Table(Vec<u32>),
    /// Goes or calls where a register says.
    Indirect,
}

/// `UDF`, as it is disassembled.
const TRAPS: [&str; 2] = ["udf", "trap"];

/// One instruction.
#[derive(Clone, Debug)]
pub struct Instruction {
    /// Where.
    pub address: u32,
    /// Bytes.
    pub size: u32,
    /// Cycles without refill.
    pub cycles: u64,
    /// Where it goes.
    pub flow: Flow,
    /// It uses the float unit.
    pub float: bool,
    /// As text.
    pub text: String,
}

impl Instruction {
    /// It is a fault where it is executed.
    #[must_use]
    pub fn traps(&self) -> bool {
        let name = self.text.split(['.', ' ']).next().unwrap_or_default();
        TRAPS.contains(&name)
    }
}

/// The disassembler.
pub struct Decoder(Capstone);

impl Decoder {
    /// A decoder of Thumb-2.
    ///
    /// # Panics
    /// If the library was built without this architecture.
    #[must_use]
    pub fn new() -> Self {
        let capstone = Capstone::new()
            .arm()
            .mode(arch::arm::ArchMode::Thumb)
            .extra_mode([arch::arm::ArchExtraMode::MClass].into_iter())
            .detail(true)
            .build()
            .expect("capstone is built with ARM");
        Self(capstone)
    }

    /// The instructions in `code`, which runs at `address`.
    ///
    /// # Errors
    /// Something is not an instruction.
    pub fn decode(&self, code: &[u8], address: u32) -> Result<Vec<Instruction>, String> {
        self.decode_to(code, address, |_| false)
    }

    /// The instructions from `address` to the first that may go elsewhere.
    ///
    /// # Errors
    /// Something is not an instruction.
    pub fn decode_straight(&self, code: &[u8], address: u32) -> Result<Vec<Instruction>, String> {
        self.decode_to(code, address, |instruction| instruction.flow != Flow::Next)
    }

    fn decode_to(
        &self,
        code: &[u8],
        address: u32,
        is_last: impl Fn(&Instruction) -> bool,
    ) -> Result<Vec<Instruction>, String> {
        let mut decoded = self
            .0
            .disasm_iter(code, u64::from(address))
            .map_err(|error| error.to_string())?;
        let mut previous: Option<Access> = None;
        let mut list = Vec::new();
        while let Some(instruction) = decoded.next() {
            let (cost, access) = self.cost(&instruction, previous.take());
            previous = access;
            let last = is_last(&cost);
            list.push(cost);
            if last {
                break;
            }
        }
        Ok(list)
    }

    fn cost(
        &self,
        instruction: &capstone::Insn<'_>,
        previous: Option<Access>,
    ) -> (Instruction, Option<Access>) {
        let mnemonic = instruction.mnemonic().unwrap_or("");
        let base = mnemonic.split('.').next().unwrap_or("");
        let detail = self.0.insn_detail(instruction).ok();
        let arm = detail.as_ref().map(InsnDetail::arch_detail);
        let operands: Vec<_> = arm
            .as_ref()
            .and_then(|d| d.arm())
            .map(|d| d.operands().collect())
            .unwrap_or_default();
        let registers = operands
            .iter()
            .filter(|o| matches!(o.op_type, ArmOperandType::Reg(_)))
            .count() as u64;
        let memory = operands.iter().find_map(|o| match o.op_type {
            ArmOperandType::Mem(memory) => Some(memory),
            _ => None,
        });
        let mut access = None;
        let cycles = match base {
            "mla" | "mls" => 2,
            _ if base.starts_with("udiv") || base.starts_with("sdiv") => 12,
            "push" | "pop" => 1 + registers,
            _ if base.starts_with("ldm") || base.starts_with("stm") => registers,
            _ if base.starts_with("vpush")
                || base.starts_with("vpop")
                || base.starts_with("vldm")
                || base.starts_with("vstm") =>
            {
                1 + 2 * registers
            }
            _ if base.starts_with("ldrd") || base.starts_with("strd") => 3,
            _ if base.starts_with("ldr") || base.starts_with("vldr") => {
                let target = operands.first().and_then(register);
                access = Some(Access { loads: target });
                let depends = memory.is_some_and(|m| {
                    let made = previous.as_ref().and_then(|p| p.loads);
                    made.is_some_and(|r| r == m.base() || r == m.index())
                });
                if previous.is_some() && !depends { 1 } else { 2 }
            }
            _ if base.starts_with("str") || base.starts_with("vstr") => {
                access = Some(Access { loads: None });
                if memory.is_some_and(|m| m.index().0 != 0) {
                    2
                } else {
                    1
                }
            }
            "vmov" if registers >= 4 => 2,
            "vmla" | "vmls" | "vnmla" | "vnmls" | "vfma" | "vfms" | "vfnma" | "vfnms" => 3,
            "vdiv" | "vsqrt" => 14,
            "tbb" | "tbh" => 2,
            "mrs" | "msr" | "cpsid" | "cpsie" => 2,
            "dmb" | "dsb" | "isb" => 4,
            _ => 1,
        };
        let text = format!("{mnemonic} {}", instruction.op_str().unwrap_or(""));
        #[allow(clippy::cast_possible_truncation)]
        let address = instruction.address() as u32;
        let flow = flow(base, &text, &operands);
        let size = instruction.bytes().len() as u32;
        (
            Instruction {
                address,
                size,
                cycles,
                flow,
                float: base.starts_with('v'),
                text,
            },
            access,
        )
    }
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

/// A load or store just before.
struct Access {
    loads: Option<RegId>,
}

fn register(operand: &arch::arm::ArmOperand) -> Option<RegId> {
    match operand.op_type {
        ArmOperandType::Reg(id) => Some(id),
        _ => None,
    }
}

/// The name without a condition, and whether there is one.
fn conditional<'a>(base: &'a str, names: &[&'a str]) -> Option<(&'a str, bool)> {
    const CONDITIONS: [&str; 16] = [
        "eq", "ne", "hs", "lo", "cs", "cc", "mi", "pl", "vs", "vc", "hi", "ls", "ge", "lt", "gt",
        "le",
    ];
    names.iter().find_map(|&name| {
        let rest = base.strip_prefix(name)?;
        (rest.is_empty() || CONDITIONS.contains(&rest)).then_some((name, !rest.is_empty()))
    })
}

fn flow(base: &str, text: &str, operands: &[arch::arm::ArmOperand]) -> Flow {
    let immediate = operands.iter().rev().find_map(|o| match o.op_type {
        #[allow(clippy::cast_sign_loss, clippy::cast_possible_truncation)]
        ArmOperandType::Imm(value) => Some(value as u32),
        _ => None,
    });
    let operand_text = text.split_once(' ').map_or("", |(_, rest)| rest);
    let writes_pc = operand_text.contains("pc}") || operand_text.starts_with("pc,");
    // A `UDF` is where the compiler knows that no way leads: a fault if one does.
    if TRAPS.contains(&base) {
        return Flow::Return { conditional: false };
    }
    let names = [
        "cbz", "cbnz", "blx", "bl", "bx", "b", "tbb", "tbh", "pop", "ldmdb", "ldm", "ldr", "mov",
    ];
    let Some((name, conditional)) = conditional(base, &names) else {
        return if writes_pc {
            Flow::Indirect
        } else {
            Flow::Next
        };
    };
    match (name, immediate) {
        ("b", Some(to)) => Flow::Branch { to, conditional },
        ("cbz" | "cbnz", Some(to)) => Flow::Branch {
            to,
            conditional: true,
        },
        ("bl", Some(to)) => Flow::Call(to),
        ("bx", _) if operand_text == "lr" => Flow::Return { conditional },
        ("b" | "cbz" | "cbnz" | "bl" | "blx" | "bx" | "tbb" | "tbh", _) => Flow::Indirect,
        ("pop" | "ldm" | "ldmdb", _) if writes_pc => Flow::Return { conditional },
        ("ldr", _) if writes_pc && operand_text.contains("[sp]") => Flow::Return { conditional },
        ("ldr" | "mov", _) if writes_pc => Flow::Indirect,
        _ => Flow::Next,
    }
}
