//! A projective map from a position in the image to a height.

use nalgebra::{DMatrix, DVector};

use super::Plateau;

/// The image coordinates on which the height depends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeightTerms {
    /// The position across the stripe alone: three parameters.
    Across,
    /// Also the position along it, for a rolled camera or an oblique gauge: five parameters.
    Both,
}

/// `z = (p·v + q + p'·u) / (r·v + 1 + r'·u)`, u along and v across the stripe, both relative to a centre and scaled so
/// that the parameters have similar magnitudes. A camera maps a plane projectively (Hartley and Zisserman 2004, section
/// 2.3); this is the map's row of heights.
#[derive(Clone, Debug)]
pub struct HeightModel {
    /// The image coordinates on which the height depends.
    pub term: HeightTerms,
    middle_px: [f64; 2],
    unit_px: f64,
    /// p, q, r, then p', r'.
    values: DVector<f64>,
    covariance: DMatrix<f64>,
}

/// `h = (p·v + q) / (r·v + 1 - r·v₀)` over v in pixels across the stripe.
pub(super) struct AcrossModel {
    /// p, q, r.
    pub(super) values: [f64; 3],
    /// Covariance of p, q, r.
    pub(super) covariance: DMatrix<f64>,
    /// v₀, pixels.
    pub(super) middle_px: f64,
}

impl HeightTerms {
    /// Returns the number of values of the map.
    pub(super) const fn num_values(self) -> usize {
        match self {
            Self::Across => 3,
            Self::Both => 5,
        }
    }
}

impl HeightModel {
    /// Returns a map of zeros for plateaus in these places; `None` if they all coincide.
    pub(super) fn blank(plateaus: &[Plateau], term: HeightTerms) -> Option<Self> {
        let (middle_px, unit_px) = extent(plateaus)?;
        let num = term.num_values();
        let values = DVector::zeros(num);
        Some(Self { term, middle_px, unit_px, values, covariance: DMatrix::zeros(num, num) })
    }

    /// Returns the map with these values of p, q, r, then p', r'.
    pub(super) fn with_values(&self, values: DVector<f64>) -> Self {
        Self { values, ..self.clone() }
    }

    /// Returns the values p, q, r, then p', r'.
    pub(super) const fn values(&self) -> &DVector<f64> {
        &self.values
    }

    /// Returns the map with the covariance of its values.
    pub(super) fn with_covariance(self, covariance: DMatrix<f64>) -> Self {
        Self { covariance, ..self }
    }

    /// Returns the height at (along, across) in pixels, metres; `None` behind the camera.
    #[must_use]
    pub fn height_m(&self, place: [f64; 2]) -> Option<f64> {
        let denominator = self.denominator(place);
        (denominator > 0.0).then(|| self.numerator(place) / denominator)
    }

    /// Returns the position across the stripe at which a place along it sees that height, pixels; `None` at the horizon.
    pub(super) fn across_px(&self, along_px: f64, height_m: f64) -> Option<f64> {
        let [z, w] = self.rows();
        let across = z[1] - height_m * w[1];
        let across_px = (height_m * (w[0] * along_px + w[2]) - z[0] * along_px - z[2]) / across;
        across_px.is_finite().then_some(across_px)
    }

    /// Returns the derivative of the height by the position across the stripe, metres per pixel.
    #[must_use]
    pub fn slope_m_per_px(&self, place: [f64; 2]) -> Option<f64> {
        let z_m = self.height_m(place)?;
        let (p, r) = (self.values[0], self.values[2]);
        Some((p - r * z_m) / self.denominator(place) / self.unit_px)
    }

    /// Returns one standard deviation of the height at a position, metres, from the covariance of the map.
    #[must_use]
    pub fn sigma_m(&self, place: [f64; 2]) -> Option<f64> {
        let gradient = self.gradient(place)?;
        Some((gradient.transpose() * &self.covariance * gradient)[(0, 0)].max(0.0).sqrt())
    }

    /// Returns numerator and denominator over (along, across, 1) in pixels: the map's row of heights and its last row.
    #[must_use]
    pub(crate) fn rows(&self) -> [[f64; 3]; 2] {
        let [p, q, r] = [self.values[0], self.values[1], self.values[2]];
        let [along_p, along_r] =
            [3, 4].map(|i| self.values.get(i).copied().unwrap_or(0.0) / self.unit_px);
        let [p, r] = [p, r].map(|value| value / self.unit_px);
        let [u, v] = self.middle_px;
        [[along_p, p, q - along_p * u - p * v], [along_r, r, 1.0 - along_r * u - r * v]]
    }

    /// Returns the covariance of any function of the map, by finite differences.
    #[must_use]
    pub(crate) fn propagated<const N: usize>(
        &self,
        of: impl Fn(&Self) -> [f64; N],
    ) -> DMatrix<f64> {
        let mut jacobian = DMatrix::zeros(N, self.values.len());
        for j in 0..self.values.len() {
            let sigma = self.covariance[(j, j)].sqrt();
            let step = if sigma > 0.0 && sigma.is_finite() { 1e-3 * sigma } else { 1e-9 };
            let moved = |by: f64| {
                let mut other = self.clone();
                other.values[j] += by;
                of(&other)
            };
            let (low, high) = (moved(-step), moved(step));
            for i in 0..N {
                jacobian[(i, j)] = (high[i] - low[i]) / (2.0 * step);
            }
        }
        &jacobian * &self.covariance * jacobian.transpose()
    }

    /// Returns the map at the middle along the stripe. The derivative of its parameters with respect to those of the
    /// whole map is constant.
    pub(super) fn across(&self) -> AcrossModel {
        let unit = self.unit_px;
        let values = [self.values[0] / unit, self.values[1], self.values[2] / unit];
        let scale = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0 / unit, 1.0, 1.0 / unit]));
        let covariance = &scale * self.covariance.view((0, 0), (3, 3)) * &scale;
        AcrossModel { values, covariance, middle_px: self.middle_px[1] }
    }

    /// Returns a position relative to the centre, in units of the extent.
    pub(super) fn local(&self, [along, across]: [f64; 2]) -> [f64; 2] {
        [(along - self.middle_px[0]) / self.unit_px, (across - self.middle_px[1]) / self.unit_px]
    }

    fn numerator(&self, place: [f64; 2]) -> f64 {
        let [u, v] = self.local(place);
        let x = &self.values;
        x[0] * v + x[1] + x.get(3).map_or(0.0, |p| p * u)
    }

    /// Returns the map's denominator: the relative depth.
    pub(super) fn denominator(&self, place: [f64; 2]) -> f64 {
        let [u, v] = self.local(place);
        let x = &self.values;
        x[2] * v + 1.0 + x.get(4).map_or(0.0, |r| r * u)
    }

    /// Returns the derivatives of the height with respect to the parameters.
    pub(super) fn gradient(&self, place: [f64; 2]) -> Option<DVector<f64>> {
        let z_m = self.height_m(place)?;
        let [u, v] = self.local(place);
        let w = self.denominator(place);
        let all = [v / w, 1.0 / w, -z_m * v / w, u / w, -z_m * u / w];
        Some(DVector::from_row_slice(&all[..self.values.len()]))
    }
}

/// Returns the middle of all plateaus and half of their extent, pixels.
fn extent(plateaus: &[Plateau]) -> Option<([f64; 2], f64)> {
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    for place in plateaus.iter().flat_map(Plateau::places) {
        for axis in [0, 1] {
            low[axis] = low[axis].min(place[axis]);
            high[axis] = high[axis].max(place[axis]);
        }
    }
    let unit_px = 0.5 * (high[0] - low[0]).max(high[1] - low[1]);
    let middle_px = [0, 1].map(|axis| 0.5 * (low[axis] + high[axis]));
    (unit_px > 0.0 && unit_px.is_finite()).then_some((middle_px, unit_px))
}
