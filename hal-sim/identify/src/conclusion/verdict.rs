//! What may be said of a machine: from the check record alone, and never more than it confirms.

use crate::conclusion::said::Said;
use crate::digits::three;
use crate::predict::excitation::Excitation;
use crate::signal::channel::Channel;
use crate::signal::noise::{BANDS_HZ, BandPower, power_spectrum};
use serde::Serialize;

/// Mean square of a residual in its noise floor's up to which it is at the floor: the excess is then less than half of the
/// noise itself.
const QUIET: f64 = 1.5;
/// The same of its loudest frequency band. Of 60 clean double drives (seeds 620000 on) the torques have up to 2.0, the d voltages but one
/// record 2.4, and nine of ten tables 2.6: those that have more are not called anything.
const QUIET_BAND: f64 = 2.5;
/// The same of the q voltages, of which those machines have up to 1.45.
const QUIET_BAND_Q: f64 = 1.8;
/// Share of the excess from which on it is explained. Of a small one a third may be left beneath [`QUIET_BAND`], and is the shape of
/// another cause: a resistance that stepped was called explained by one that drifts, which took 60 %; right ones took 96 % or more.
const WHOLE: f64 = 0.9;

/// Share of a zero-phase Butterworth filter's bandwidth in which it passes all.
const FLAT: f64 = 0.6;
/// Residual over the drive quantity's rms up to which a residual that nothing predicts is small, whatever its floor.
const SMALL: f64 = 0.03;

/// What may be said.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Verdict {
    /// The declared model explains the check record to its noise floor.
    #[serde(rename = "nothing missing")]
    NothingMissing,
    /// The named effects bring the check record to its noise floor.
    #[serde(rename = "explained")]
    Explained,
    /// The named effects hold on the check record, and something is left.
    #[serde(rename = "partly explained")]
    PartlyExplained,
    /// Something is left, and no cause of it is named.
    #[serde(rename = "unexplained")]
    Unexplained,
    /// The records cannot tell: too little moved.
    #[serde(rename = "not excited")]
    NotExcited,
    /// The records are not what they are said to be.
    #[serde(rename = "wrong data")]
    WrongData,
}

impl Verdict {
    /// Whether the check record has something beyond what is named.
    pub(crate) fn leaves_something(self) -> bool {
        matches!(self, Verdict::Unexplained | Verdict::PartlyExplained)
    }

    /// As in a report.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::NothingMissing => "nothing missing",
            Verdict::Explained => "explained",
            Verdict::PartlyExplained => "partly explained",
            Verdict::Unexplained => "unexplained",
            Verdict::NotExcited => "not excited",
            Verdict::WrongData => "wrong data",
        }
    }
}

/// Where a noise floor is known from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Floor {
    /// The sensors' data in the model file.
    Sensors,
    /// The difference from lap to lap of a programme that repeats.
    Laps,
    /// The record's own spectrum above the dynamics.
    Spectrum,
    /// Nowhere: nothing can then be called explained.
    Unknown,
}

impl Floor {
    fn words(self) -> &'static str {
        match self {
            Floor::Sensors => "the noise floor of its sensors",
            Floor::Laps => "the noise floor, which is the difference from lap to lap",
            Floor::Spectrum => "the noise floor, which is the spectrum above the dynamics",
            Floor::Unknown => "a noise floor that these records do not tell",
        }
    }
}

/// How loud a residual is, in units of its noise floor: mean squares, 1 at the floor.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Level {
    /// Over the whole band that is used.
    pub power: f64,
    /// In the loudest of its frequency bands.
    pub band: f64,
    /// Upper edge of that band, Hz.
    pub band_hz: f64,
    /// Sum of squares beyond the floor, band by band.
    pub excess: f64,
    /// How loud that band may be at the floor.
    quiet_band: f64,
}

impl Level {
    /// Of a channel's whitened residual of which `rows` count, at `rate` rows a second, judged from `from` up to `top` Hz.
    /// `expected` is what counts between two frequencies, Hz.
    pub(crate) fn new(
        channel: Channel,
        white: &[f64],
        rows: usize,
        rate: f64,
        [from_hz, top]: [f64; 2],
        expected: impl Fn([f64; 2]) -> BandPower,
    ) -> Self {
        let count = rows.max(1) as f64;
        let whole = expected([from_hz, top]);
        let mut level = Level {
            power: white.iter().map(|x| x * x).sum::<f64>() / count / whole.sensors,
            quiet_band: match channel {
                Channel::VoltageQ(_) => QUIET_BAND_Q,
                _ => QUIET_BAND,
            },
            ..Level::default()
        };
        if white.len() < 64 || rows == 0 {
            level.excess = (level.power - 1.0).max(0.0) * count;
            return level;
        }
        let power = power_spectrum(white);
        let width = rate / white.len() as f64;
        let mut from = ((from_hz / width) as usize).max(1);
        for high in BANDS_HZ.into_iter().filter(|high| *high <= top) {
            let to = ((high / width) as usize).min(power.len());
            if to >= from + 8 {
                let lines = (to - from) as f64;
                let expected = expected([from as f64 * width, to as f64 * width]);
                let mean = power[from..to].iter().sum::<f64>() / lines / count;
                // What is too small to count is taken for the sensors'.
                let beyond = (mean - expected.sensors).max(0.0);
                let counts = beyond > expected.small;
                if !counts {
                    level.power -= beyond * lines / power.len() as f64 / whole.sensors;
                }
                let mean = match counts {
                    true => mean / expected.sensors,
                    false => (mean / expected.sensors).min(1.0),
                };
                if mean > level.band {
                    (level.band, level.band_hz) = (mean, high);
                }
                // Chance alone makes a mean of so many exponentially distributed powers vary by so much.
                let chance = 2.0 / lines.sqrt();
                level.excess += (mean - 1.0 - chance).max(0.0) * lines / power.len() as f64 * count;
                from = to;
            }
        }
        // Above its bands a channel is not judged.
        let above = power[from..].iter().sum::<f64>() / count;
        let beyond = (above - (power.len() - from) as f64).max(0.0);
        level.power -= beyond / power.len() as f64 / whole.sensors;
        level
    }

    /// Beside `rows` more that have so much power on average and are not judged by frequency.
    pub(crate) fn beside(mut self, power: f64, rows: usize) -> Self {
        self.power = self.power.max(power);
        self.excess += (power - 1.0).max(0.0) * rows as f64;
        self
    }

    /// Whether it is at its noise floor.
    pub fn quiet(&self) -> bool {
        self.power <= QUIET && self.band <= self.quiet_band
    }
}

/// A channel of the check record.
#[derive(Debug, Clone, Copy)]
pub struct CheckChannel {
    /// Name.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// How loud it is before and after.
    pub levels: [Level; 2],
    /// Rms before and after, in its unit.
    pub rms: [f64; 2],
    /// Noise floor, in its unit.
    pub floor: f64,
}

impl CheckChannel {
    /// Of figures alone: a name with its unit, rms before and after, and its floor's. Without a floor only the fall counts.
    pub(crate) fn of_rms(
        (name, unit): (&'static str, &'static str),
        rms: [f64; 2],
        floor: f64,
    ) -> Self {
        let in_floors = if floor.is_finite() { floor } else { rms[1] };
        let level = |rms: f64| {
            let power = (rms / in_floors).powi(2);
            Level {
                power,
                band: power,
                band_hz: 0.0,
                excess: (power - 1.0).max(0.0),
                quiet_band: QUIET_BAND,
            }
        };
        CheckChannel {
            name,
            unit,
            levels: rms.map(level),
            rms,
            floor,
        }
    }

    /// Of rows: the residual before and after of the rows that count, at `rate` rows a second and filtered below `top_hz`.
    /// Besides the rms each frequency band counts, so that a slow misfit does not hide beneath noise of other frequencies.
    pub(crate) fn of_rows(
        named: (&'static str, &'static str),
        residuals: [&[f64]; 2],
        open: &[bool],
        [rate, top_hz]: [f64; 2],
        floor: f64,
    ) -> Self {
        let counted = |values: &[f64]| -> Vec<f64> {
            let rows = values.iter().zip(open).filter(|(_, open)| **open);
            rows.map(|(x, _)| *x).collect()
        };
        let residuals = residuals.map(counted);
        let size = |values: &[f64]| {
            (values.iter().map(|x| x * x).sum::<f64>() / values.len().max(1) as f64).sqrt()
        };
        let rms = [size(&residuals[0]), size(&residuals[1])];
        let mut channel = Self::of_rms(named, rms, floor);
        if !(floor.is_finite() && floor > 0.0) {
            return channel;
        }
        // The floor is that of a band up to `top_hz`; at this rate white noise of its density has so much more.
        let per_row = floor * (0.5 * rate / top_hz).sqrt();
        for (level, values) in channel.levels.iter_mut().zip(&residuals) {
            let white: Vec<f64> = values.iter().map(|x| x / per_row).collect();
            let banded = Level::new(
                Channel::Table,
                &white,
                white.len(),
                rate,
                [0.0, FLAT * top_hz],
                |_| BandPower::WHITE,
            );
            if banded.band > 0.0 {
                *level = Level {
                    power: level.power,
                    ..banded
                };
            }
        }
        channel
    }

    /// Judges a machine that has no other.
    pub(crate) fn judged(self, found: Tally, floor: Floor) -> Judged {
        judge(&[self], found, floor)
    }
}

/// What is said, and by how much the excess fell.
#[derive(Debug, Clone)]
pub struct Judged {
    /// In one word.
    pub verdict: Verdict,
    /// In sentences, with figures.
    pub said: Said,
    /// Sums of squares beyond the floor on the check record, before and after.
    pub excess: [f64; 2],
}

impl Judged {
    /// Share of the check record's excess that has gone.
    pub fn gone(&self) -> f64 {
        gone(self.excess)
    }

    /// What a fall of the check record's sum of squares is of the excess that was there.
    pub fn share(&self, check_fall: f64) -> f64 {
        match self.excess[0] > 0.0 {
            true => (check_fall / self.excess[0]).clamp(0.0, 1.0),
            false => 0.0,
        }
    }
}

impl Judged {
    /// Of a residual that a model-free judge was asked about: `does_not_carry` where it predicts the check record from itself
    /// alone, `is_judged` where the records are long enough, `share` of the drive quantity's rms.
    pub(crate) fn predicted(mut self, does_not_carry: bool, is_judged: bool, share: f64) -> Self {
        match self.verdict {
            Verdict::NothingMissing | Verdict::Explained if does_not_carry => {
                self.verdict = match self.verdict {
                    Verdict::Explained => Verdict::PartlyExplained,
                    _ => Verdict::Unexplained,
                };
                let own = "The check record's operating points predict each other, and the fit record does not predict them: \
                           something does not carry over.";
                self.said.left = Some(own.into());
            }
            Verdict::Unexplained if is_judged && !does_not_carry && share < SMALL => {
                self.verdict = Verdict::NothingMissing;
                self.said = Said {
                    why: format!(
                        "Nothing predicts what the declared model leaves, {} % of the drive quantity's rms.",
                        three(100.0 * share)
                    ),
                    left: Some("Nothing is missing above that.".into()),
                    ..Said::default()
                };
            }
            _ => {}
        }
        self
    }

    /// Beside what the records excite of each shaft.
    pub(crate) fn excited(mut self, shafts: &[(Excitation, &str)]) -> Self {
        self.said.test(shafts);
        if self.said.next.is_empty() {
            return self;
        }
        let stands = shafts.iter().all(|(own, _)| own.stands());
        let cannot_tell = match self.verdict {
            Verdict::NothingMissing => shafts.iter().any(|(own, _)| own.is_thin()),
            Verdict::Unexplained => stands,
            _ => false,
        };
        if cannot_tell {
            self.verdict = Verdict::NotExcited;
            (self.said.why, self.said.left) = ("The record moves too little to tell.".into(), None);
        } else if self.verdict == Verdict::Explained && stands {
            self.verdict = Verdict::PartlyExplained;
        }
        self
    }

    /// Of a machine that the drive runs: with the command that records what is asked for.
    pub(crate) fn commanded(mut self, shafts: &[(Excitation, &str)]) -> Self {
        self.said.commanded(shafts);
        self
    }
}

/// The residual of each channel, in words.
fn left_in_words(channels: &[CheckChannel]) -> String {
    let left = channels.iter().map(|channel| {
        let [_, after] = channel.rms;
        format!("{} {after:.2e} {} rms", channel.name, channel.unit)
    });
    left.collect::<Vec<_>>().join(", ")
}

/// Share of an excess that has gone, of before and after.
fn gone([before, after]: [f64; 2]) -> f64 {
    match before > 0.0 {
        true => (1.0 - after / before).clamp(0.0, 1.0),
        false => 0.0,
    }
}

/// How many effects are named, how many curves have no cause, and how many descriptions of the residual there are.
#[derive(Debug, Clone, Copy, Default)]
pub struct Tally {
    /// Effects with a name.
    pub names: usize,
    /// Curves that were measured, without a cause.
    pub curves: usize,
    /// Descriptions of the residual.
    pub left: usize,
}

impl Tally {
    /// What takes of the residual, as the subject of a sentence and its verb in singular or plural.
    fn taker(self, [one, many]: [&str; 2]) -> String {
        match (self.names, self.curves) {
            (_, 0) => format!("What is named {one}"),
            (0, _) => format!("Nothing is named. Curves without a cause {many}"),
            _ => format!("What is named and curves without a cause {many}"),
        }
    }
}

/// Judges by the check record: its channels, and what was found.
pub fn judge(channels: &[CheckChannel], found: Tally, floor: Floor) -> Judged {
    let quiet = |when: usize| channels.iter().all(|channel| channel.levels[when].quiet());
    let known = floor != Floor::Unknown && channels.iter().all(|c| c.floor.is_finite());
    let excess = [0, 1].map(|when| channels.iter().map(|c| c.levels[when].excess).sum::<f64>());
    let gone = gone(excess);
    let whole = known && found.left == 0 && quiet(1);
    let verdict = match (found.names + found.curves, whole) {
        (0, true) if quiet(0) => Verdict::NothingMissing,
        (0, _) => Verdict::Unexplained,
        (_, true) if found.curves == 0 && gone >= WHOLE => Verdict::Explained,
        _ => Verdict::PartlyExplained,
    };
    let loudest = channels
        .iter()
        .max_by(|a, b| a.levels[1].excess.total_cmp(&b.levels[1].excess))
        .filter(|channel| !channel.levels[1].quiet());
    let is_beyond = known && (verdict == Verdict::PartlyExplained || !quiet(0));
    let (why, rest) = match verdict {
        Verdict::NothingMissing | Verdict::Unexplained => {
            bare(verdict, channels, floor, [known, quiet(0)])
        }
        _ => beside(verdict, found, (floor, known), gone),
    };
    let loud = loudest.filter(|_| is_beyond);
    let left = rest.into_iter().chain(loud.map(most_of_it));
    let left: Vec<String> = left.collect();
    Judged {
        verdict,
        said: Said {
            why,
            left: (!left.is_empty()).then(|| left.join(" ")),
            channel: loud.map(|channel| channel.name),
            ..Said::default()
        },
        excess,
    }
}

/// Why, and the residual, where nothing was found. Last whether the floor is known, and whether the record is at it.
fn bare(
    verdict: Verdict,
    channels: &[CheckChannel],
    floor: Floor,
    [known, quiet]: [bool; 2],
) -> (String, Option<String>) {
    let floor = floor.words();
    if verdict == Verdict::NothingMissing {
        let why = format!(
            "With its plate values refined, the declared model explains the check record to {floor}."
        );
        let left = format!("Nothing is missing above {}.", left_in_words(channels));
        return (why, Some(left));
    }
    let no_cause = "Both records confirm no cause of it.".to_owned();
    match (known, quiet) {
        (false, _) => (
            format!("Both records confirm no effect, beside {floor}."),
            None,
        ),
        (true, true) => (
            format!("The check record is no louder than {floor}."),
            Some(format!(
                "What is left of it has a shape, or more power than the spectrum above the dynamics has. {no_cause}"
            )),
        ),
        (true, false) => (
            format!("The check record has something beyond {floor}."),
            Some(no_cause),
        ),
    }
}

/// Why, and the residual, where something was found that takes the share `gone`.
fn beside(
    verdict: Verdict,
    found: Tally,
    (floor, known): (Floor, bool),
    gone: f64,
) -> (String, Option<String>) {
    let floor = floor.words();
    if !known {
        let taker = found.taker(["holds", "hold"]);
        return (
            format!("{taker} on the check record."),
            Some(format!(
                "Whether anything is left cannot be said beside {floor}."
            )),
        );
    }
    let left = match verdict {
        Verdict::Explained => "The residual is at the noise floor.",
        _ => "Both records confirm no cause of the rest.",
    };
    let taker = found.taker(["takes", "take"]);
    let percent = 100.0 * gone;
    (
        format!("{taker} {percent:.0} % of what the check record has beyond {floor}."),
        Some(left.into()),
    )
}

/// Where most of the rest is.
fn most_of_it(channel: &CheckChannel) -> String {
    let name = channel.name;
    let Level {
        band,
        band_hz,
        quiet_band,
        ..
    } = channel.levels[1];
    match band > 0.0 && band_hz > 0.0 {
        true => format!(
            "Most of it is in the {name} up to {band_hz:.0} Hz: its power there is {} times the sensors' noise; up to {quiet_band:.1} \
             times count as noise.",
            three(band)
        ),
        false => format!("Most of it is in the {name}."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel(before: f64, after: f64) -> CheckChannel {
        CheckChannel::of_rms(("torque", "N m"), [before, after], 1.0)
    }

    #[test]
    fn no_word_says_more_than_the_check_record() {
        let say = |before, after, names, left, floor| {
            let found = Tally {
                names,
                curves: 0,
                left,
            };
            judge(&[channel(before, after)], found, floor).verdict
        };
        let sensors = Floor::Sensors;
        assert_eq!(say(1.0, 1.0, 0, 0, sensors), Verdict::NothingMissing);
        assert_eq!(say(5.0, 5.0, 0, 0, sensors), Verdict::Unexplained);
        assert_eq!(say(5.0, 1.1, 1, 0, sensors), Verdict::Explained);
        assert_eq!(say(5.0, 1.1, 1, 1, sensors), Verdict::PartlyExplained);
        assert_eq!(say(1.5, 1.2, 1, 0, sensors), Verdict::PartlyExplained);
        assert_eq!(say(5.0, 3.0, 1, 0, sensors), Verdict::PartlyExplained);
        assert_eq!(say(1.0, 1.0, 0, 0, Floor::Unknown), Verdict::Unexplained);
        assert_eq!(
            say(5.0, 1.0, 1, 0, Floor::Unknown),
            Verdict::PartlyExplained
        );
    }

    #[test]
    fn the_sentence_says_how_much_of_the_excess_is_gone() {
        let judged = judge(&[channel(5.0, 3.0)], named(1, 0), Floor::Sensors);
        // (25 - 9) / (25 - 1)
        assert!(judged.said.why.contains("67 %"), "{}", judged.said.why);
        assert!((judged.gone() - 16.0 / 24.0).abs() < 1e-9);
    }

    fn named(names: usize, curves: usize) -> Tally {
        Tally {
            names,
            curves,
            left: 0,
        }
    }

    #[test]
    fn curves_without_a_cause_name_nothing() {
        let curves = judge(&[channel(5.0, 1.1)], named(0, 2), Floor::Sensors);
        assert_eq!(curves.verdict, Verdict::PartlyExplained);
        let why = &curves.said.why;
        assert!(
            why.starts_with("Nothing is named. Curves without a cause take 99 %"),
            "{why}"
        );
        assert!(!why.contains("What is named"), "{why}");
        let both = judge(&[channel(5.0, 1.1)], named(1, 1), Floor::Sensors);
        assert!(
            (both.said.why).starts_with("What is named and curves without a cause take"),
            "{}",
            both.said.why
        );
    }

    #[test]
    fn a_loud_rest_has_three_digits() {
        let level = Level {
            power: 292_499.1,
            band: 292_499.1,
            band_hz: 50.0,
            excess: 1e6,
            quiet_band: QUIET_BAND,
        };
        let loud = CheckChannel {
            levels: [level; 2],
            ..channel(5.0, 3.0)
        };
        let said = judge(&[loud], Tally::default(), Floor::Sensors).said;
        let left = said.left.unwrap();
        assert!(
            left.contains("is 292000 times the sensors' noise"),
            "{left}"
        );
        assert_eq!(said.channel, Some("torque"));
    }
}
