//! The motors' encoders, looked at once a PWM period as the current loops do.

use super::{Started, put, wait_until, word};
use crate::board;
use control::encoder::Interface;
use control::mt6835;
use core::sync::atomic::Ordering::Relaxed;
use link::bringup::{EncoderKind, EncoderReading};
use stm32g4xx_hal::stm32::TIM1;

pub(super) fn read(words: &[EncoderReading; 2], started: &Started<'_>, listen_ms: u32) {
    for (entry, motor) in words.iter().zip(started.motors) {
        let kind = match motor.encoder.interface {
            Interface::Incremental => EncoderKind::Incremental,
            Interface::IncrementalWithIndex => EncoderKind::IncrementalWithIndex,
            Interface::Mt6835 => EncoderKind::Mt6835,
        };
        put(&entry.kind, kind.word());
        put(&entry.counts_per_turn, motor.encoder.counts_per_turn);
    }
    // Whatever they saw while the pins were pulled.
    let _ = board::take_encoder_flags();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let a_millisecond = (board::PLATE.board.pwm_hz / 1e3) as u32;
    let mut seen = [Seen::default(); 2];
    let mut left = listen_ms.saturating_mul(a_millisecond);
    while left > 0 {
        left -= 1;
        if !next_period() {
            break;
        }
        let now = [word(started.screw_encoder), word(started.nut_encoder)];
        let flags = board::take_encoder_flags();
        for (((entry, seen), now), flags) in words.iter().zip(&mut seen).zip(now).zip(flags) {
            if flags.index {
                put(&entry.indices, entry.indices.load(Relaxed).wrapping_add(1));
            }
            if flags.transition_error {
                let errors = entry.transition_errors.load(Relaxed);
                put(&entry.transition_errors, errors.wrapping_add(1));
            }
            seen.look(entry, now);
        }
    }
}

/// Waits for the next top of the screw's timer.
fn next_period() -> bool {
    const LOOKS: u32 = 10_000;
    // SAFETY: interrupts are masked: nobody else takes the flag.
    let timer = unsafe { &*TIM1::ptr() };
    let there = wait_until(LOOKS, || timer.sr().read().uif().bit_is_set());
    timer.sr().write(|w| w.uif().clear_bit());
    there
}

#[derive(Clone, Copy, Default)]
struct Seen {
    last: Option<u32>,
    moved: i32,
}

impl Seen {
    fn look(&mut self, entry: &EncoderReading, now: u32) {
        put(&entry.looks, entry.looks.load(Relaxed).wrapping_add(1));
        let kind = EncoderKind::of_word(entry.kind.load(Relaxed));
        let count = match kind {
            Some(EncoderKind::Mt6835) => mt6835::counts(now),
            _ => Some(now),
        };
        let Some(count) = count else {
            put(&entry.bad_frame, now);
            let status = now >> 8 & 7;
            let kind = if mt6835::is_whole(now) {
                put(&entry.status, entry.status.load(Relaxed) | status);
                &entry.bad_status
            } else {
                &entry.bad_checks
            };
            put(kind, kind.load(Relaxed).wrapping_add(1));
            return;
        };
        let Some(last) = self.last.replace(count) else {
            put(&entry.first, count);
            return;
        };
        if last == count {
            return;
        }
        put(&entry.changes, entry.changes.load(Relaxed).wrapping_add(1));
        // The short way round.
        let turn = entry.counts_per_turn.load(Relaxed).cast_signed();
        let mut step = count.cast_signed().wrapping_sub(last.cast_signed());
        if step > turn / 2 {
            step = step.wrapping_sub(turn);
        } else if step < -(turn / 2) {
            step = step.wrapping_add(turn);
        }
        self.moved = self.moved.wrapping_add(step);
        entry.least.fetch_min(self.moved, Relaxed);
        entry.most.fetch_max(self.moved, Relaxed);
    }
}
