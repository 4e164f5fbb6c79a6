//! What a person may set of a drive without building its firmware.
//!
//! | part | module |
//! | --- | --- |
//! | the parameters, each declared once | [`control::plate::groups`] |
//! | settings by number and name, the plate that they make | [`control::plate::settings`] |
//! | other ways in which datasheets print the same | [`datasheet`] |
//! | settings in flash | [`store`] |
//!
//! The drive computes its fixed-point configuration from the settings by the code that the host runs too, so both refuse the
//! same.

pub mod datasheet;
pub mod store;

pub use control::plate::Unfit;
pub use control::plate::groups::{
    Direction, EncoderDirection, EncoderInterface, MotorSettings, Switch,
};
pub use control::plate::parameter::{Effect, Kind, PER_KRPM, Value};
pub use control::plate::settings::{Setting, SettingError, Settings};

use crate::telemetry::Real;
use serde::{Deserialize, Serialize};

/// A setting's value, as it is sent and stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum WireValue {
    /// A number in the setting's unit.
    Real(Real),
    /// A whole number.
    Whole(u32),
    /// One of the setting's words, by its place among them.
    Choice(u8),
}

impl From<Value> for WireValue {
    fn from(value: Value) -> Self {
        match value {
            Value::Real(x) => Self::Real(Real::new(x)),
            Value::Whole(x) => Self::Whole(x),
            Value::Choice(x) => Self::Choice(x),
        }
    }
}

impl From<WireValue> for Value {
    fn from(value: WireValue) -> Self {
        match value {
            WireValue::Real(x) => Self::Real(x.get()),
            WireValue::Whole(x) => Self::Whole(x),
            WireValue::Choice(x) => Self::Choice(x),
        }
    }
}
