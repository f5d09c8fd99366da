//! Ridge of the image (Steger 1998, "An Unbiased Detector of Curvilinear Structures", doi 10.1109/34.659930).
//!
//! The image is smoothed by a Gaussian and differentiated twice. The second derivative is most negative across the
//! stripe: that direction n is the eigenvector of the Hessian with the eigenvalue of largest magnitude (his section
//! 3.2). Along n the first derivative vanishes at the distance
//! `t = -(r_x n_x + r_y n_y) / (r_xx n_x² + 2 r_xy n_x n_y + r_yy n_y²)` (his eq. 19). The ridge is perpendicular to n, so it crosses the column `t / n_y` from the pixel's
//! centre. That position is reported, not the point `t n`, which lies in another column.
//!
//! The masks are the Gaussian and its derivatives integrated over pixels, as in his eq. 10 to 12. A stripe with
//! symmetric flanks is found without bias, whatever its width. His section 4 corrects lines whose two sides differ in
//! brightness with a model of sharp edges; a laser stripe has none, so the correction is omitted. Where the stripe
//! bends or ends within the Gaussian, the ridge is biased: this is the only method that averages neighbouring columns,
//! about 3.5 σ of them.

use super::{
    blur::Sample,
    lanes::Centres,
    picture::Picture,
    section::{Levels, LineCandidate},
};

/// Half length of the masks, in standard deviations.
const REACH_SIGMAS: f64 = 3.5;
/// Pixels tried on either side of the first one.
const STEPS: usize = 3;
/// Tolerance for a zero slightly outside its pixel: at a pixel boundary, both pixels may find it outside.
const PIXEL_PX: f32 = 0.6;
/// Samples this close to full scale are clipped and carry no noise.
const CLIPPED_SHARE: f32 = 0.995;

/// The masks of one standard deviation. Index 0 is the centre; the other half follows from symmetry.
#[derive(Clone, Debug)]
pub(super) struct Masks {
    /// The Gaussian, its first and its second derivative.
    half: Vec<[f32; 3]>,
    /// Σ of the squares of the Gaussian and of its first derivative.
    energy: [f32; 2],
}

impl Masks {
    /// Creates masks of that standard deviation.
    pub(super) fn new(sigma_px: f64) -> Self {
        let reach = (REACH_SIGMAS * sigma_px).ceil() as usize;
        let density = |x: f64| {
            libm::exp(-0.5 * (x / sigma_px).powi(2)) / (sigma_px * std::f64::consts::TAU.sqrt())
        };
        let below = |x: f64| 0.5 * libm::erfc(-x / sigma_px * std::f64::consts::FRAC_1_SQRT_2);
        let slope = |x: f64| -x / (sigma_px * sigma_px) * density(x);
        let half: Vec<[f32; 3]> = (0..=reach)
            .map(|k| {
                let (from, to) = (k as f64 - 0.5, k as f64 + 0.5);
                // Correlation, not convolution: the odd mask changes sign.
                let masks =
                    [below(to) - below(from), density(from) - density(to), slope(to) - slope(from)];
                masks.map(|mask| mask as f32)
            })
            .collect();
        let energy = [0, 1].map(|order| {
            half[0][order].powi(2) + 2.0 * half[1..].iter().map(|k| k[order].powi(2)).sum::<f32>()
        });
        Self { half, energy }
    }

    /// Pixels to either side of the centre.
    fn radius(&self) -> usize {
        self.half.len() - 1
    }
}

/// Finds ridges; keeps its buffer between frames.
#[derive(Debug)]
pub(super) struct Ridge {
    masks: Masks,
    /// Results of the three masks along the stripe for every position about the start.
    along: Vec<[f32; 3]>,
}

/// Derivatives of the smoothed image: x along the stripe, y across.
struct Derivatives {
    x: f32,
    y: f32,
    xx: f32,
    xy: f32,
    yy: f32,
}

/// A ridge about a pixel.
struct Crossing {
    /// Position at which it crosses the column, from the pixel's centre.
    offset_px: f32,
    /// Direction across it.
    normal: (f32, f32),
    /// Second derivative in that direction.
    curvature: f32,
}

impl Ridge {
    /// Creates a finder for a Gaussian of that standard deviation.
    pub(super) fn new(sigma_px: f64) -> Self {
        Self { masks: Masks::new(sigma_px), along: Vec::new() }
    }

    /// Moves every centre to the ridge near it. Without a ridge the centre is unchanged.
    pub(super) fn refine<S: Sample>(
        &mut self,
        picture: &Picture<'_, S>,
        found: &[LineCandidate],
        levels: &Levels<'_>,
        centres: &mut Centres,
    ) {
        for (lane, found) in found.iter().enumerate() {
            let start = (centres.position_px[lane] + 0.5).floor() as isize;
            let first = found.candidate.first as isize;
            self.smooth_along(picture, found.line as isize, first + start);
            let length = found.candidate.length() as f32;
            if let Some((at, crossing)) = self.search() {
                let offset = at as f32 - (self.masks.radius() + STEPS) as f32;
                let position = start as f32 + offset + crossing.offset_px;
                if position > -1.0 && position < length {
                    centres.position_px[lane] = position;
                    centres.sigma_px[lane] = self.sigma_px(at, &crossing, levels).min(length);
                }
            }
        }
    }

    fn smooth_along<S: Sample>(&mut self, picture: &Picture<'_, S>, line: isize, middle: isize) {
        let reach = (self.masks.radius() + STEPS) as isize;
        self.along.clear();
        for position in middle - reach..=middle + reach {
            let centre = picture.at(line, position);
            let [smooth, _, second] = self.masks.half[0];
            let mut sums = [smooth * centre, 0.0, second * centre];
            for (k, mask) in (1..).zip(&self.masks.half[1..]) {
                let (before, after) =
                    (picture.at(line - k, position), picture.at(line + k, position));
                sums[0] += mask[0] * (before + after);
                sums[1] += mask[1] * (after - before);
                sums[2] += mask[2] * (before + after);
            }
            self.along.push(sums);
        }
    }

    /// Steps from the middle towards the zero until it lies in the pixel.
    fn search(&self) -> Option<(usize, Crossing)> {
        let radius = self.masks.radius();
        let mut at = radius + STEPS;
        for _ in 0..=STEPS {
            let crossing = self.derivatives(at).crossing()?;
            if crossing.offset_px.abs() <= PIXEL_PX {
                return Some((at, crossing));
            }
            at = if crossing.offset_px > 0.0 { at + 1 } else { at - 1 };
            if at < radius || at > radius + 2 * STEPS {
                return None;
            }
        }
        None
    }

    fn derivatives(&self, at: usize) -> Derivatives {
        let [smooth, _, second] = self.masks.half[0];
        let [centre, centre_x, centre_xx] = self.along[at];
        let mut d = Derivatives {
            x: smooth * centre_x,
            y: 0.0,
            xx: smooth * centre_xx,
            xy: 0.0,
            yy: second * centre,
        };
        for (k, [smooth, first, second]) in (1..).zip(&self.masks.half[1..]) {
            let (before, after) = (&self.along[at - k], &self.along[at + k]);
            d.x += smooth * (before[1] + after[1]);
            d.y += first * (after[0] - before[0]);
            d.xx += smooth * (before[2] + after[2]);
            d.xy += first * (after[1] - before[1]);
            d.yy += second * (before[0] + after[0]);
        }
        d
    }

    /// Returns the noise of the derivative across the stripe divided by the slope of that derivative. Noise of the
    /// curvature hardly moves a zero near the pixel's centre.
    fn sigma_px(&self, at: usize, crossing: &Crossing, levels: &Levels<'_>) -> f32 {
        let (noise, full_scale) = (&levels.noise, levels.full_scale as f32);
        let (nx, ny) = crossing.normal;
        let [smooth_energy, first_energy] = self.masks.energy;
        let of = |k: usize, at: usize| {
            let [smooth, first, _] = self.masks.half[k];
            let level = self.along[at][0];
            let variance = noise.constant as f32 + noise.per_level as f32 * level;
            let variance = if level < CLIPPED_SHARE * full_scale { variance } else { 0.0 };
            variance
                * (nx * nx * first_energy * smooth * smooth
                    + ny * ny * smooth_energy * first * first)
        };
        let sides = (1..=self.masks.radius()).map(|k| of(k, at - k) + of(k, at + k));
        let variance = of(0, at) + sides.sum::<f32>();
        // A stripe that is clipped throughout the mask: anywhere in the pixel.
        variance.sqrt().max(1e-4) / (crossing.curvature * ny).abs()
    }
}

impl Derivatives {
    /// Returns the ridge, if the image is darker on both sides; by Jacobi's rotation.
    fn crossing(&self) -> Option<Crossing> {
        let Self { x, y, xx, xy, yy } = *self;
        let (normal, curvature) = if xy == 0.0 {
            if xx.abs() > yy.abs() { ((1.0, 0.0), xx) } else { ((0.0, 1.0), yy) }
        } else {
            let theta = 0.5 * (yy - xx) / xy;
            let side = if theta < 0.0 { -1.0 } else { 1.0 };
            let tangent = side / (theta.abs() + (theta * theta + 1.0).sqrt());
            let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
            let sine = tangent * cosine;
            let (along, across) = (xx - tangent * xy, yy + tangent * xy);
            if along.abs() > across.abs() {
                ((cosine, -sine), along)
            } else {
                ((sine, cosine), across)
            }
        };
        let (nx, ny) = normal;
        let offset_px = -(x * nx + y * ny) / curvature / ny;
        // Steeper than 80 degrees against the column: the zero does not belong to this column.
        (curvature < 0.0 && ny.abs() > 0.17 && offset_px.is_finite()).then_some(Crossing {
            offset_px,
            normal,
            curvature,
        })
    }
}
