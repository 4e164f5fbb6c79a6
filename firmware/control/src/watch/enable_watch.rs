//! Two contacts of one enable switch: one that is welded shows when the other opens alone.
//!
//! Either contact that is open stops the drive. Both open together, and close together but for [`APART`] looks; where they do not, or
//! where one opens and closes and the other does not, the switch or its wiring is faulty, and has to be seen open with both contacts
//! before the drive may be armed again. That is what safety relays do with two-channel inputs: discrepancy monitoring, with a time that
//! is set, and a switch test that both channels must pass before the fault can be acknowledged
//! ([SEW-Eurodrive](https://download.sew-eurodrive.com/download/html/30587190/en-EN/4113980199543762844939.html), Siemens 3RK3 manual 3.7.3.9;
//! a single fault that costs no safety function is category 3 of ISO 13849-1). The time is our choice. Two contacts that are welded at
//! once, or a short circuit between the two wires, show in nothing.

/// Looks, a millisecond each, for which the contacts may be apart: half a second, in which a switch is turned slowly.
const APART: u16 = 500;
/// Looks in a row in which a contact must be open: it bounces.
const SETTLED: u8 = 2;

/// State of the watch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EnableWatch {
    /// Looks in a row in which each was open.
    open: [u8; 2],
    /// Each was open since both were closed.
    opened: [bool; 2],
    /// Looks in a row in which they differed.
    apart: u16,
    faulty: bool,
}

impl EnableWatch {
    /// Nothing seen yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            open: [0; 2],
            opened: [false; 2],
            apart: 0,
            faulty: false,
        }
    }

    /// One look at both contacts, which are closed: `true` while the switch is faulty.
    pub fn step(&mut self, closed: [bool; 2]) -> bool {
        let [one, other] = closed;
        let contacts = self.open.iter_mut().zip(&mut self.opened).zip(closed);
        for ((looks, opened), closed) in contacts {
            *looks = if closed {
                0
            } else {
                looks.saturating_add(1).min(SETTLED)
            };
            *opened |= *looks == SETTLED;
        }
        if self.open == [SETTLED; 2] {
            (self.opened, self.apart, self.faulty) = ([true; 2], 0, false);
        } else if one != other {
            self.apart = self.apart.saturating_add(1);
            self.faulty |= self.apart > APART;
        } else if one {
            let [one_opened, other_opened] = self.opened;
            self.faulty |= one_opened != other_opened;
            (self.opened, self.apart) = ([false; 2], 0);
        }
        self.faulty
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The look, from 0, at which it is faulty.
    fn found(watch: &mut EnableWatch, looks: u32, at: impl Fn(u32) -> [bool; 2]) -> Option<u32> {
        (0..looks).find(|&k| watch.step(at(k)))
    }

    const CLOSED: [bool; 2] = [true; 2];
    const OPEN: [bool; 2] = [false; 2];

    #[test]
    fn contacts_that_open_and_close_with_a_delay_are_none() {
        let mut watch = EnableWatch::new();
        // It bounces as it opens and as it closes.
        let contact = |k: u32| (k % 2000 < 1000) ^ (k % 1000 < 6 && k % 2 == 1);
        let slow = |k: u32| [contact(k), contact(k + 400)];
        assert_eq!(found(&mut watch, 20_000, slow), None);
        assert_eq!(found(&mut watch, 1000, |_| OPEN), None);
        assert_eq!(found(&mut watch, 1000, |_| CLOSED), None);
    }

    #[test]
    fn a_contact_that_is_welded_is_found_and_has_to_open() {
        for welded in [0, 1] {
            let one = |open: bool| {
                let mut closed = CLOSED;
                closed[1 - welded] = !open;
                closed
            };
            let mut watch = EnableWatch::new();
            let at = found(&mut watch, 1000, |_| one(true));
            assert_eq!(at, Some(u32::from(APART)), "held open");
            assert!(watch.step(CLOSED), "closed again");
            watch.step(OPEN);
            assert!(!watch.step(OPEN), "both were open");
            assert!(!watch.step(CLOSED), "armed again");

            // Opened for a tenth of a second.
            let at = found(&mut watch, 1000, |k| one(k < 100));
            assert_eq!(at, Some(100), "closed without the other having opened");
        }
    }
}
