//! The lens models by name, and their coefficients as a list.

use super::Distortion;

/// Numbers of coefficients of `OpenCV` that leave out the last ones of a model: they are 0.
const SHORT: [usize; 2] = [4, 5];

impl Distortion {
    /// Returns the model `name` with the coefficients `d` in ROS's order: k1, k2, p1, p2, k3, k4, k5, k6, or k1, k2, k3, k4
    /// for `equidistant`. Further coefficients that are 0 have no meaning. Coefficients of `plumb_bob` and
    /// `rational_polynomial` that are all zero give no distortion.
    ///
    /// # Errors
    /// `None` for an unknown model; a description of the model's coefficients if `d` has too few, or others that are
    /// not 0.
    pub fn from_coefficients(name: &str, d: &[f64]) -> Result<Self, Option<&'static str>> {
        let (size, allowed) = match name {
            "plumb_bob" => (5, "five numbers k1, k2, p1, p2, k3 for plumb_bob"),
            "rational_polynomial" => (
                8,
                "eight numbers k1, k2, p1, p2, k3, k4, k5, k6 for rational_polynomial; thin-prism coefficients s1 to s4 \
                 are not supported: calibrate without them",
            ),
            "equidistant" => (4, "four numbers k1, k2, k3, k4 for equidistant"),
            _ => return Err(None),
        };
        let is_zero = |values: &[f64]| values.iter().all(|value| *value == 0.0);
        if name != "equidistant" && is_zero(d) {
            return Ok(Self::None);
        }
        let is_complete = d.len() >= size || SHORT.contains(&d.len());
        if !is_complete || !is_zero(d.get(size..).unwrap_or_default()) {
            return Err(Some(allowed));
        }
        let at = |index: usize| d.get(index).copied().unwrap_or(0.0);
        let [k1, k2, p1, p2] = [at(0), at(1), at(2), at(3)];
        let [k3, k4, k5, k6] = [at(4), at(5), at(6), at(7)];
        Ok(match name {
            "plumb_bob" => Self::PlumbBob { k1, k2, p1, p2, k3 },
            "rational_polynomial" => Self::RationalPolynomial { k1, k2, p1, p2, k3, k4, k5, k6 },
            _ => Self::Equidistant { k1, k2, k3: at(2), k4: at(3) },
        })
    }

    /// Returns ROS's name of the model.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::None | Self::PlumbBob { .. } => "plumb_bob",
            Self::RationalPolynomial { .. } => "rational_polynomial",
            Self::Equidistant { .. } => "equidistant",
        }
    }

    /// Returns the coefficients in ROS's order: k1, k2, p1, p2, k3, and for the rational model k4, k5, k6; k1, k2, k3, k4
    /// for `equidistant`.
    pub fn coefficients(&self) -> Vec<f64> {
        match *self {
            Self::None => vec![0.0; 5],
            Self::PlumbBob { k1, k2, p1, p2, k3 } => vec![k1, k2, p1, p2, k3],
            Self::RationalPolynomial { k1, k2, p1, p2, k3, k4, k5, k6 } => {
                vec![k1, k2, p1, p2, k3, k4, k5, k6]
            }
            Self::Equidistant { k1, k2, k3, k4 } => vec![k1, k2, k3, k4],
        }
    }

    /// Returns the names of [`coefficients`](Self::coefficients) in the formula, in the same order; none for a pinhole.
    pub(crate) const fn coefficient_names(&self) -> &'static [&'static str] {
        match self {
            Self::None => &[],
            Self::PlumbBob { .. } => &["k1", "k2", "p1", "p2", "k3"],
            Self::RationalPolynomial { .. } => &["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"],
            Self::Equidistant { .. } => &["k1", "k2", "k3", "k4"],
        }
    }

    /// Returns a coefficient by its name in the formula; `None` if the model has no such coefficient.
    pub(crate) fn coefficient_mut(&mut self, name: &str) -> Option<&mut f64> {
        if *self == Self::None {
            *self = Self::PlumbBob { k1: 0.0, k2: 0.0, p1: 0.0, p2: 0.0, k3: 0.0 };
        }
        let index = self.coefficient_names().iter().position(|known| *known == name)?;
        let coefficients = match self {
            Self::None => Vec::new(),
            Self::PlumbBob { k1, k2, p1, p2, k3 } => vec![k1, k2, p1, p2, k3],
            Self::RationalPolynomial { k1, k2, p1, p2, k3, k4, k5, k6 } => {
                vec![k1, k2, p1, p2, k3, k4, k5, k6]
            }
            Self::Equidistant { k1, k2, k3, k4 } => vec![k1, k2, k3, k4],
        };
        coefficients.into_iter().nth(index)
    }
}
