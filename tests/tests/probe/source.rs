//! Where the compiler has put a function that it took into others: by the ELF's debug information, as a debugger looks it up.

use gimli::{AttributeValue, DebuggingInformationEntry, Dwarf, EndianSlice, LittleEndian, Unit};
use object::{Object, ObjectSection};
use std::collections::BTreeSet;

type Bytes<'a> = EndianSlice<'a, LittleEndian>;

/// First instructions of each place where the function `name`, whose linkage name has `part` in it, was taken in.
///
/// # Errors
/// The file's debug information is not as its standard says.
pub fn inlined(elf: &[u8], name: &str, part: &str) -> Result<Vec<u64>, gimli::Error> {
    let file = object::File::parse(elf).expect("an ELF");
    let dwarf = Dwarf::load(|id| {
        let section = file.section_by_name(id.name());
        let data = section.and_then(|section| section.data().ok());
        Ok::<_, gimli::Error>(EndianSlice::new(data.unwrap_or_default(), LittleEndian))
    })?;
    let (mut origins, mut places) = (BTreeSet::new(), BTreeSet::new());
    let mut headers = dwarf.units();
    let mut units = Vec::new();
    while let Some(header) = headers.next()? {
        units.push(dwarf.unit(header)?);
    }
    for unit in &units {
        each(unit, |entry| {
            let named = text(&dwarf, unit, entry, gimli::DW_AT_name)?
                .is_some_and(|found| found == name || found.starts_with(&format!("{name}<")));
            let is_it = entry.tag() == gimli::DW_TAG_subprogram
                && named
                && text(&dwarf, unit, entry, gimli::DW_AT_linkage_name)?
                    .is_some_and(|linkage| linkage.contains(part));
            if is_it && let Some(offset) = entry.offset().to_debug_info_offset(&unit.header) {
                origins.insert(offset.0);
            }
            Ok(())
        })?;
    }
    // A declaration within its type, and what it declares.
    let declared = origins.clone();
    for unit in &units {
        each(unit, |entry| {
            let of = reference(unit, entry, gimli::DW_AT_specification)?;
            if of.is_some_and(|of| declared.contains(&of))
                && let Some(offset) = entry.offset().to_debug_info_offset(&unit.header)
            {
                origins.insert(offset.0);
            }
            Ok(())
        })?;
    }
    for unit in &units {
        each(unit, |entry| {
            if entry.tag() != gimli::DW_TAG_inlined_subroutine {
                return Ok(());
            }
            let origin = reference(unit, entry, gimli::DW_AT_abstract_origin)?;
            if origin.is_some_and(|origin| origins.contains(&origin)) {
                let mut ranges = dwarf.die_ranges(unit, entry)?;
                let mut first = None;
                while let Some(range) = ranges.next()? {
                    first.get_or_insert(range.begin);
                }
                places.extend(first);
            }
            Ok(())
        })?;
    }
    Ok(places.into_iter().collect())
}

fn each<'a>(
    unit: &Unit<Bytes<'a>>,
    mut look: impl FnMut(&DebuggingInformationEntry<'_, '_, Bytes<'a>>) -> Result<(), gimli::Error>,
) -> Result<(), gimli::Error> {
    let mut entries = unit.entries();
    while let Some((_, entry)) = entries.next_dfs()? {
        look(entry)?;
    }
    Ok(())
}

fn text<'a>(
    dwarf: &Dwarf<Bytes<'a>>,
    unit: &Unit<Bytes<'a>>,
    entry: &DebuggingInformationEntry<'_, '_, Bytes<'a>>,
    attribute: gimli::DwAt,
) -> Result<Option<String>, gimli::Error> {
    let Some(value) = entry.attr_value(attribute)? else {
        return Ok(None);
    };
    let bytes = dwarf.attr_string(unit, value)?;
    Ok(Some(bytes.to_string_lossy().into_owned()))
}

/// Where in the file's entries the one is that an attribute refers to.
fn reference(
    unit: &Unit<Bytes<'_>>,
    entry: &DebuggingInformationEntry<'_, '_, Bytes<'_>>,
    attribute: gimli::DwAt,
) -> Result<Option<usize>, gimli::Error> {
    Ok(match entry.attr_value(attribute)? {
        Some(AttributeValue::UnitRef(offset)) => offset
            .to_debug_info_offset(&unit.header)
            .map(|offset| offset.0),
        Some(AttributeValue::DebugInfoRef(offset)) => Some(offset.0),
        _ => None,
    })
}
