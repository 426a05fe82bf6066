//! The connectives: triangular norms (AND, activation), conorms (OR, accumulation) and hedges.
//!
//! Formulas: Klement, Mesiar & Pap 2000, chapter 1; IEC 61131-7:2000, table 4; the names in FCL follow the
//! standard and, beyond it, the spelling that other readers of FCL share.

/// The smaller of two numbers that are no NaN; one instruction, unlike `f64::min`.
#[inline(always)]
pub(crate) fn smaller(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The larger of two numbers that are no NaN.
#[inline(always)]
pub(crate) fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// A triangular norm: how AND joins two degrees, or how a rule's degree limits its conclusion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum TNorm {
    /// `min(a, b)`, FCL `MIN`.
    Minimum,
    /// `a b`, FCL `PROD`.
    Product,
    /// `max(0, a + b - 1)` (Lukasiewicz), FCL `BDIF`.
    BoundedDifference,
    /// `min(a, b)` where the other is 1, else 0, FCL `DPROD`.
    DrasticProduct,
    /// `a b / (2 - (a + b - a b))`, FCL `EPROD`.
    EinsteinProduct,
    /// `a b / (a + b - a b)`, FCL `HPROD`.
    HamacherProduct,
    /// `min(a, b)` where `a + b > 1`, else 0, FCL `NMIN`.
    NilpotentMinimum,
}

/// A triangular conorm: how OR joins two degrees, or how the conclusions of several rules are put together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SNorm {
    /// `max(a, b)`, FCL `MAX`.
    Maximum,
    /// `a + b - a b`, FCL `ASUM` (`PROBOR` is read too).
    AlgebraicSum,
    /// `min(1, a + b)`, FCL `BSUM`.
    BoundedSum,
    /// `a + b`, divided by its own maximum over the universe where that is above one, FCL `NSUM` (`SUM` is
    /// read too). The division cancels in every defuzzification that divides by the area, so the engine
    /// accumulates the plain sum; as OR, between two degrees, it is the bounded sum.
    NormalisedSum,
    /// `max(a, b)` where the other is 0, else 1, FCL `DSUM`.
    DrasticSum,
    /// `(a + b) / (1 + a b)`, FCL `ESUM`.
    EinsteinSum,
    /// `(a + b - 2 a b) / (1 - a b)`, FCL `HSUM`.
    HamacherSum,
    /// `max(a, b)` where `a + b < 1`, else 1, FCL `NMAX`.
    NilpotentMaximum,
}

/// A word that bends a degree (Zadeh 1972): `IF speed IS very high`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Hedge {
    /// 1, whatever the degree.
    Any,
    /// `1 - a`.
    Not,
    /// `a²`.
    Very,
    /// `√a`.
    Somewhat,
    /// `2 a²` below one half, `1 - 2 (1 - a)²` above.
    Extremely,
    /// `√(a / 2)` up to one half, `1 - √((1 - a) / 2)` above.
    Seldom,
}

impl TNorm {
    /// Every norm with its FCL keyword, the preferred spelling first, jFuzzyLogic's last.
    pub const KEYWORDS: [(&'static str, Self); 10] = [
        ("MIN", Self::Minimum),
        ("PROD", Self::Product),
        ("BDIF", Self::BoundedDifference),
        ("DPROD", Self::DrasticProduct),
        ("EPROD", Self::EinsteinProduct),
        ("HPROD", Self::HamacherProduct),
        ("NMIN", Self::NilpotentMinimum),
        ("DMIN", Self::DrasticProduct),
        ("HAMACHER", Self::HamacherProduct),
        ("NIPMIN", Self::NilpotentMinimum),
    ];

    /// The norm of two degrees in [0, 1].
    #[inline]
    pub fn apply(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Minimum => smaller(a, b),
            Self::Product => a * b,
            Self::BoundedDifference => larger(0.0, a + b - 1.0),
            Self::DrasticProduct if larger(a, b) >= 1.0 => smaller(a, b),
            Self::EinsteinProduct => a * b / (2.0 - (a + b - a * b)),
            Self::HamacherProduct if a + b - a * b > 0.0 => a * b / (a + b - a * b),
            Self::NilpotentMinimum if a + b > 1.0 => smaller(a, b),
            Self::DrasticProduct | Self::HamacherProduct | Self::NilpotentMinimum => 0.0,
        }
    }

    /// The OR that De Morgan's law pairs with this AND.
    pub fn dual(self) -> SNorm {
        match self {
            Self::Minimum => SNorm::Maximum,
            Self::Product => SNorm::AlgebraicSum,
            Self::BoundedDifference => SNorm::BoundedSum,
            Self::DrasticProduct => SNorm::DrasticSum,
            Self::EinsteinProduct => SNorm::EinsteinSum,
            Self::HamacherProduct => SNorm::HamacherSum,
            Self::NilpotentMinimum => SNorm::NilpotentMaximum,
        }
    }
}

impl SNorm {
    /// Every conorm with its FCL keyword, the preferred spelling first, jFuzzyLogic's last.
    pub const KEYWORDS: [(&'static str, Self); 13] = [
        ("MAX", Self::Maximum),
        ("ASUM", Self::AlgebraicSum),
        ("PROBOR", Self::AlgebraicSum),
        ("BSUM", Self::BoundedSum),
        ("NSUM", Self::NormalisedSum),
        ("SUM", Self::NormalisedSum),
        ("DSUM", Self::DrasticSum),
        ("ESUM", Self::EinsteinSum),
        ("HSUM", Self::HamacherSum),
        ("NMAX", Self::NilpotentMaximum),
        ("DMAX", Self::DrasticSum),
        ("EINSTEIN", Self::EinsteinSum),
        ("NIPMAX", Self::NilpotentMaximum),
    ];

    /// The conorm of two degrees in [0, 1].
    #[inline]
    pub fn apply(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Maximum => larger(a, b),
            Self::AlgebraicSum => a + b - a * b,
            Self::BoundedSum | Self::NormalisedSum => smaller(1.0, a + b),
            Self::DrasticSum if smaller(a, b) <= 0.0 => larger(a, b),
            Self::EinsteinSum => (a + b) / (1.0 + a * b),
            Self::HamacherSum if a * b < 1.0 => (a + b - 2.0 * a * b) / (1.0 - a * b),
            Self::NilpotentMaximum if a + b < 1.0 => larger(a, b),
            Self::DrasticSum | Self::HamacherSum | Self::NilpotentMaximum => 1.0,
        }
    }

    /// How conclusions add up at one place of an output's universe: as `apply`, but a normalised sum is not
    /// bounded.
    #[inline]
    pub(crate) fn accumulate(self, a: f64, b: f64) -> f64 {
        if self == Self::NormalisedSum { a + b } else { self.apply(a, b) }
    }
}

impl Hedge {
    /// Every hedge with its word.
    pub const KEYWORDS: [(&'static str, Self); 6] = [
        ("any", Self::Any),
        ("not", Self::Not),
        ("very", Self::Very),
        ("somewhat", Self::Somewhat),
        ("extremely", Self::Extremely),
        ("seldom", Self::Seldom),
    ];

    /// The bent degree.
    #[inline]
    pub fn apply(self, a: f64) -> f64 {
        match self {
            Self::Any => 1.0,
            Self::Not => 1.0 - a,
            Self::Very => a * a,
            Self::Somewhat => a.sqrt(),
            Self::Extremely if a <= 0.5 => 2.0 * a * a,
            Self::Extremely => 1.0 - 2.0 * (1.0 - a) * (1.0 - a),
            Self::Seldom if a <= 0.5 => (0.5 * a).sqrt(),
            Self::Seldom => 1.0 - (0.5 * (1.0 - a)).sqrt(),
        }
    }
}

/// The value that goes by `word` in a table of keywords, upper or lower case alike.
pub(crate) fn by_keyword<T: Copy>(table: &[(&str, T)], word: &str) -> Option<T> {
    table.iter().find(|(keyword, _)| keyword.eq_ignore_ascii_case(word)).map(|(_, value)| *value)
}

/// The preferred keyword of a value.
pub(crate) fn keyword_of<T: PartialEq>(table: &[(&'static str, T)], value: &T) -> &'static str {
    table.iter().find(|(_, candidate)| candidate == value).map_or("?", |(keyword, _)| keyword)
}
