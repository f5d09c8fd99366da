//! The map of heights that fits plateaus best.

use nalgebra::{DMatrix, DVector};

use super::{HeightModel, HeightReference, HeightTerms, Plateau};

const MAX_ROUNDS: usize = 50;
/// Number of times that a step which makes the fit worse is halved.
const MAX_HALVINGS: usize = 12;

/// A position of a plateau and its height.
#[derive(Clone, Copy)]
pub(super) struct Place {
    /// Index of the plateau.
    pub(super) plateau: usize,
    /// (along, across), pixels.
    pub(super) px: [f64; 2],
    /// Height as stated, metres.
    height_m: f64,
    /// Index of the picture.
    picture: usize,
}

/// The map, and the height of each picture's zero over that of the first.
#[derive(Clone)]
pub(super) struct Fit {
    pub(super) model: HeightModel,
    /// Empty if all pictures have one zero.
    pub(super) offsets_m: Vec<f64>,
}

impl Fit {
    /// Returns the best fit with equal weights for all plateaus; `None` if the plateaus do not determine it.
    pub(super) fn new(
        plateaus: &[Plateau],
        term: HeightTerms,
        reference: HeightReference,
    ) -> Option<Self> {
        let places = places(plateaus, term);
        let start = Self::start(plateaus, &places, term, reference)?;
        let mut fit = start;
        for _ in 0..MAX_ROUNDS {
            let (jacobian, residuals) = fit.linearised(&places)?;
            let step = least_squares(&jacobian, &residuals)?;
            let squares = residuals.norm_squared();
            let shorter = (0..MAX_HALVINGS).find_map(|halvings| {
                let next = fit.moved(&(&step * 0.5_f64.powi(halvings as i32)));
                let is_better =
                    next.squares(&places)? <= squares * (1.0 + 1e-9) + f64::MIN_POSITIVE;
                is_better.then_some(next)
            });
            let Some(next) = shorter else { break };
            fit = next;
            if step.amax() <= 1e-14 * fit.model.values().amax() {
                break;
            }
        }
        let is_sound = places.iter().all(|place| fit.model.denominator(place.px) > 0.0);
        is_sound.then_some(fit)
    }

    /// The initial guess, which is linear: z (r·v + 1) = p·v + q for one zero, z + offset = p·v + q for several.
    fn start(
        plateaus: &[Plateau],
        places: &[Place],
        term: HeightTerms,
        reference: HeightReference,
    ) -> Option<Self> {
        let model = HeightModel::blank(plateaus, term)?;
        let num = term.num_values();
        let heights = DVector::from_iterator(places.len(), places.iter().map(|p| p.height_m));
        let local = |i: usize| model.local(places[i].px);
        if reference == HeightReference::Common {
            let rows = DMatrix::from_fn(places.len(), num, |i, j| {
                let ([u, v], height_m) = (local(i), places[i].height_m);
                [v, 1.0, -height_m * v, u, -height_m * u][j]
            });
            let model = model.with_values(least_squares(&rows, &heights)?);
            return Some(Self { model, offsets_m: Vec::new() });
        }
        let num_pictures = 1 + plateaus.iter().map(|plateau| plateau.picture).max()?;
        let affine = if term == HeightTerms::Both { 3 } else { 2 };
        let rows = DMatrix::from_fn(places.len(), affine + num_pictures - 1, |i, j| {
            let [u, v] = local(i);
            match j {
                _ if j < affine => [v, 1.0, u][j],
                _ => -f64::from(u8::from(places[i].picture == j - affine + 1)),
            }
        });
        let found = least_squares(&rows, &heights)?;
        let mut values = DVector::zeros(num);
        (values[0], values[1]) = (found[0], found[1]);
        if affine == 3 {
            values[3] = found[2];
        }
        let offsets_m = std::iter::once(0.0).chain(found.iter().skip(affine).copied()).collect();
        Some(Self { model: model.with_values(values), offsets_m })
    }

    /// Returns the height of a picture's zero over that of the first picture, metres.
    pub(super) fn offset_m(&self, picture: usize) -> f64 {
        self.offsets_m.get(picture).copied().unwrap_or(0.0)
    }

    /// Returns the derivatives of all heights with respect to the values of the map and the offsets, and the residuals:
    /// stated minus mapped heights, metres.
    pub(super) fn linearised(&self, places: &[Place]) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let num = self.model.values().len();
        let mut jacobian = DMatrix::zeros(places.len(), num + self.offsets_m.len().max(1) - 1);
        let mut residuals = DVector::zeros(places.len());
        for (i, place) in places.iter().enumerate() {
            let gradient = self.model.gradient(place.px)?;
            jacobian.view_mut((i, 0), (1, num)).copy_from(&gradient.transpose());
            if !self.offsets_m.is_empty() && place.picture > 0 {
                jacobian[(i, num + place.picture - 1)] = -1.0;
            }
            residuals[i] = self.residual_m(place)?;
        }
        Some((jacobian, residuals))
    }

    /// Returns the sum of squared residuals, square metres; `None` behind the camera.
    pub(super) fn squares(&self, places: &[Place]) -> Option<f64> {
        let residuals = places.iter().map(|place| self.residual_m(place));
        residuals.map(|residual| Some(residual?.powi(2))).sum()
    }

    /// Returns the sum of squared differences of the residuals at both positions of each plateau, over 2, square metres.
    pub(super) fn inclinations(&self, plateaus: &[Plateau]) -> Option<f64> {
        let places = places(plateaus, HeightTerms::Both);
        let differences = places.chunks_exact(2).map(|pair| {
            Some((self.residual_m(&pair[1])? - self.residual_m(&pair[0])?).powi(2) / 2.0)
        });
        differences.sum()
    }

    fn residual_m(&self, place: &Place) -> Option<f64> {
        let measured_m = self.model.height_m(place.px)? - self.offset_m(place.picture);
        Some(place.height_m - measured_m)
    }

    fn moved(&self, step: &DVector<f64>) -> Self {
        let num = self.model.values().len();
        let model = self.model.with_values(self.model.values() + step.rows(0, num));
        let shifts = std::iter::once(&0.0).chain(step.iter().skip(num));
        let offsets_m = self.offsets_m.iter().zip(shifts).map(|(m, by)| m + by).collect();
        Self { model, offsets_m }
    }
}

/// Returns the middle of each plateau, or two positions if its inclination counts too.
pub(super) fn places(plateaus: &[Plateau], term: HeightTerms) -> Vec<Place> {
    let of = |(at, plateau): (usize, &Plateau)| {
        let place = |px| Place {
            plateau: at,
            px,
            height_m: plateau.height.height_m,
            picture: plateau.picture,
        };
        match term {
            HeightTerms::Both => plateau.places().map(place).to_vec(),
            HeightTerms::Across => vec![place([plateau.middle_px(), plateau.across_px])],
        }
    };
    plateaus.iter().enumerate().flat_map(of).collect()
}

/// Returns the matrix that takes values to the least-squares solution; `None` if it is singular within rounding. Columns
/// are normalised first: heights are metres and small.
pub(super) fn solver(rows: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let norms: Vec<f64> = rows.column_iter().map(|column| column.norm()).collect();
    if norms.iter().any(|norm| !(*norm > 0.0 && norm.is_finite())) {
        return None;
    }
    let scaled = DMatrix::from_fn(rows.nrows(), rows.ncols(), |i, j| rows[(i, j)] / norms[j]);
    let svd = scaled.svd(true, true);
    let (largest, smallest) = (svd.singular_values.max(), svd.singular_values.min());
    if rows.nrows() < rows.ncols() || smallest.is_nan() || smallest <= 1e-10 * largest {
        return None;
    }
    let inverse = svd.pseudo_inverse(0.0).ok()?;
    Some(DMatrix::from_fn(inverse.nrows(), inverse.ncols(), |i, j| inverse[(i, j)] / norms[i]))
}

fn least_squares(rows: &DMatrix<f64>, values: &DVector<f64>) -> Option<DVector<f64>> {
    Some(solver(rows)? * values)
}
