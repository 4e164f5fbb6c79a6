//! What a motor's current has beside the orders of its turn.

/// A regressor beside the orders.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Base {
    /// Acceleration: its coefficient is the inertia over the torque constant, A s^2/rad.
    Inertia,
    /// A constant current, A.
    Offset,
    /// Sign of the speed, A.
    Coulomb,
    /// Speed, A s/rad.
    Viscous,
}

impl Base {
    /// What every motor may have.
    pub(super) const ALL: [Base; 4] = [Base::Inertia, Base::Offset, Base::Coulomb, Base::Viscous];
    /// What every motor has.
    pub(super) const ALWAYS: [Base; 2] = [Base::Inertia, Base::Offset];

    /// For a reader, with its unit.
    pub fn name(self) -> (&'static str, &'static str) {
        match self {
            Base::Inertia => ("inertia over torque constant", "A s\u{B2}/rad"),
            Base::Offset => ("constant current", "A"),
            Base::Coulomb => ("Coulomb friction over torque constant", "A"),
            Base::Viscous => ("viscous friction over torque constant", "A s/rad"),
        }
    }
}
