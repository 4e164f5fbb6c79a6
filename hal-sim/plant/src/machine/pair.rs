//! A number of each motor, screw and nut, side by side: what is computed for both is computed once.

/// One number a motor: screw, nut.
pub(super) type Pair = wide::f64x2;

/// The bits of a pair.
pub(super) type Bits = wide::u64x2;

#[inline]
pub(super) fn bits(of: Pair) -> Bits {
    Bits::new(of.to_array().map(f64::to_bits))
}

#[inline]
pub(super) fn pair(of: Bits) -> Pair {
    Pair::new(of.to_array().map(f64::from_bits))
}

/// The number of each motor by `of`.
#[inline]
pub(super) fn each(of: impl FnMut(usize) -> f64) -> Pair {
    Pair::new([0, 1].map(of))
}
