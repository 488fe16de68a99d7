//! What numbers in a scene file may be.

/// The values that make sense for a parameter. All must be finite in single precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Bound {
    /// Any number.
    Any,
    /// Zero or more.
    NotNegative,
    /// More than zero.
    Positive,
    /// From 0 to 1.
    Unit,
    /// From the first to the second, both included.
    Between(f64, f64),
    /// Between the two, both excluded.
    Inside(f64, f64),
}

impl Bound {
    /// Whether `v` is allowed.
    pub fn allows(self, v: f64) -> bool {
        let fits = match self {
            Self::Any => true,
            Self::NotNegative => v >= 0.0,
            Self::Positive => v > 0.0 && v as f32 > 0.0,
            Self::Unit => (0.0..=1.0).contains(&v),
            Self::Between(low, high) => (low..=high).contains(&v),
            Self::Inside(low, high) => v > low && v < high,
        };
        fits && (v as f32).is_finite()
    }

    /// What was expected, for a message.
    pub fn expected(self) -> String {
        match self {
            Self::Any => "a finite number".into(),
            Self::NotNegative => "a finite number that is not negative".into(),
            Self::Positive => "a finite number greater than 0".into(),
            Self::Unit => "a number from 0 to 1".into(),
            Self::Between(low, high) => format!("a number from {low} to {high}"),
            Self::Inside(low, high) => format!("a number between {low} and {high}, both excluded"),
        }
    }
}
