//! Camera, shape of the board and poses from all views at once: the Levenberg-Marquardt method, with the poses eliminated
//! (Triggs et al. 2000, "Bundle adjustment: a modern synthesis", section 6.1).

use nalgebra::{DMatrix, DVector, Isometry3, Point2, Translation3, UnitQuaternion, Vector3};

use super::board_shape::{BoardShape, ShapeTerm};
use crate::scanner::camera::{Camera, DistortedPixel};

/// Largest number of steps.
const MAX_STEPS: usize = 40;
/// Relative change of the cost that counts as convergence.
const STILL: f64 = 1e-10;
/// Unknowns of a pose.
const POSE: usize = 6;
/// A direction that only one view measures has a leverage within this of 1.
const ALONE: f64 = 1e-9;

/// Corners of one view: places on flat squares relative to the middle, metres, and positions in the picture, pixels.
pub(super) type Corners = Vec<(Point2<f64>, Point2<f64>)>;

/// All that is estimated.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub(super) camera: Camera,
    pub(super) shape: BoardShape,
    /// Poses of the middle of each view's board.
    pub(super) poses: Vec<Isometry3<f64>>,
}

/// Estimated quantities that all views have in common.
#[derive(Clone, Debug)]
pub(super) struct Shared {
    /// Names of the camera's values, `f` for both focal lengths; none if the camera is known.
    pub(super) camera: Vec<String>,
    /// Terms of the shape.
    pub(super) shape: Vec<ShapeTerm>,
}

/// A solution.
#[derive(Clone, Debug)]
pub(super) struct JointFit {
    pub(super) state: State,
    /// Covariance of what all views share, in the order of [`Shared`], the scatter between views included.
    pub(super) covariance: DMatrix<f64>,
    /// Ratio of the variance by leaving out views to that of the residuals, which the covariance includes.
    pub(super) view_scatter: f64,
    /// Root mean square distance of the corners from their projections, pixels.
    pub(super) rms_px: f64,
    /// The same at the start.
    pub(super) start_rms_px: f64,
    /// The same for each view.
    pub(super) views_rms_px: Vec<f64>,
}

/// Linear equations of one view.
struct Equations {
    shared: DMatrix<f64>,
    own: DMatrix<f64>,
    residuals: DVector<f64>,
}

/// One view's information on what is shared, its pose eliminated.
struct Reduced {
    information: DMatrix<f64>,
    gradient: DVector<f64>,
}

/// Returns the solution near `start`; `None` if there is none, or the views leave it open.
pub(super) fn minimise(views: &[Corners], shared: &Shared, start: State) -> Option<JointFit> {
    let mut state = start;
    let mut cost = cost(views, &state)?;
    let start_cost = cost;
    let mut damping = 1e-6;
    for _ in 0..MAX_STEPS {
        let equations = linearise(views, shared, &state)?;
        let next = stepped(&equations, shared, &state, damping);
        let found = next.and_then(|next| Some((self::cost(views, &next)?, next)));
        match found {
            Some((lower, next)) if lower <= cost => {
                let is_still = cost - lower <= STILL * cost;
                (state, cost) = (next, lower);
                damping = (damping * 0.1_f64).max(1e-12);
                if is_still {
                    break;
                }
            }
            _ if damping > 1e6 => break,
            _ => damping *= 10.0,
        }
    }
    finish(views, shared, state, [start_cost, cost])
}

fn finish(
    views: &[Corners],
    shared: &Shared,
    state: State,
    [start_cost, cost]: [f64; 2],
) -> Option<JointFit> {
    let equations = linearise(views, shared, &state)?;
    let reduced: Option<Vec<_>> = equations.iter().map(|view| reduce(view, 0.0)).collect();
    let reduced = reduced?;
    let corners: usize = views.iter().map(Vec::len).sum();
    let information: DMatrix<f64> = reduced.iter().map(|view| &view.information).sum();
    let unknowns = information.nrows() + POSE * views.len();
    let freedom = (2 * corners).checked_sub(unknowns).filter(|freedom| *freedom > 0)?;
    let variance = cost / freedom as f64;
    let view_scatter = view_scatter(&reduced, &information, variance)?;
    let covariance = inverse(&information)? * (variance * view_scatter);
    let rms_px = |cost: f64, corners: usize| (cost / corners as f64).sqrt();
    let each = equations.iter().zip(views);
    let views_rms_px =
        each.map(|(found, view)| rms_px(found.residuals.norm_squared(), view.len())).collect();
    let (start_rms_px, rms_px) = (rms_px(start_cost, corners), rms_px(cost, corners));
    Some(JointFit { state, covariance, view_scatter, rms_px, start_rms_px, views_rms_px })
}

/// Returns the sum of squared distances, pixels squared.
fn cost(views: &[Corners], state: &State) -> Option<f64> {
    let costs = views.iter().zip(&state.poses).map(|(view, pose)| {
        Some(residuals(view, &state.camera, &state.shape, pose)?.norm_squared())
    });
    costs.sum()
}

/// Returns projected minus observed positions, pixels.
fn residuals(
    view: &Corners,
    camera: &Camera,
    shape: &BoardShape,
    pose: &Isometry3<f64>,
) -> Option<DVector<f64>> {
    let mut both = Vec::with_capacity(2 * view.len());
    for (flat, seen) in view {
        let DistortedPixel(projected) = camera.project(pose * shape.point(*flat))?;
        both.extend([projected.x - seen.x, projected.y - seen.y]);
    }
    Some(DVector::from_vec(both))
}

impl Shared {
    /// Adds to one of the unknowns.
    fn add(&self, camera: &mut Camera, shape: &mut BoardShape, at: usize, by: f64) -> Option<()> {
        match self.camera.get(at).map(String::as_str) {
            Some("f") => {
                camera.fx_px += by;
                camera.fy_px += by;
            }
            Some(name) => *camera.value_mut(name)? += by,
            None => *shape.value_mut(self.shape[at - self.camera.len()]) += by,
        }
        Some(())
    }

    fn count(&self) -> usize {
        self.camera.len() + self.shape.len()
    }

    /// Returns the step of an unknown's numeric derivative.
    fn step(&self, at: usize) -> f64 {
        match self.camera.get(at) {
            Some(name) if name.starts_with(['f', 'c']) => 1e-3,
            Some(_) => 1e-6,
            None => 1e-4,
        }
    }
}

fn linearise(views: &[Corners], shared: &Shared, state: &State) -> Option<Vec<Equations>> {
    let equations = views.iter().zip(&state.poses).map(|(view, pose)| {
        let seen = |at: usize, by: f64| {
            let (mut camera, mut shape) = (state.camera, state.shape);
            shared.add(&mut camera, &mut shape, at, by)?;
            residuals(view, &camera, &shape, pose)
        };
        let moved = |at: usize, by: f64| {
            let mut step = DVector::zeros(POSE);
            step[at] = by;
            residuals(view, &state.camera, &state.shape, &moved(pose, step.as_slice()))
        };
        Some(Equations {
            shared: slopes(shared.count(), |at| shared.step(at), seen)?,
            own: slopes(POSE, |_| 1e-6, moved)?,
            residuals: residuals(view, &state.camera, &state.shape, pose)?,
        })
    });
    equations.collect()
}

fn slopes(
    count: usize,
    step: impl Fn(usize) -> f64,
    residuals: impl Fn(usize, f64) -> Option<DVector<f64>>,
) -> Option<DMatrix<f64>> {
    let column = |at: usize| {
        let by = step(at);
        Some((residuals(at, by)? - residuals(at, -by)?) / (2.0 * by))
    };
    let columns: Option<Vec<_>> = (0..count).map(column).collect();
    Some(DMatrix::from_columns(&columns?))
}

/// Returns a pose shifted and turned in the camera's frame about the board's origin.
fn moved(pose: &Isometry3<f64>, step: &[f64]) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(step[3], step[4], step[5]));
    let shift =
        Translation3::from(pose.translation.vector + Vector3::new(step[0], step[1], step[2]));
    Isometry3::from_parts(shift, turn * pose.rotation)
}

fn damped(mut normal: DMatrix<f64>, damping: f64) -> DMatrix<f64> {
    for i in 0..normal.nrows() {
        normal[(i, i)] *= 1.0 + damping;
    }
    normal
}

fn reduce(view: &Equations, damping: f64) -> Option<Reduced> {
    let solved = damped(view.own.tr_mul(&view.own), damping).cholesky()?;
    let cross = view.own.tr_mul(&view.shared);
    let both = view.shared.tr_mul(&view.shared);
    let gradient = view.shared.tr_mul(&view.residuals);
    Some(Reduced {
        information: both - cross.tr_mul(&solved.solve(&cross)),
        gradient: gradient - cross.tr_mul(&solved.solve(&view.own.tr_mul(&view.residuals))),
    })
}

/// Returns the inverse of a symmetric matrix whose unknowns have very different units.
fn inverse(information: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let units = information.diagonal().map(|value| 1.0 / value.sqrt());
    let units = DMatrix::from_diagonal(&units);
    let scaled = &units * information * &units;
    Some(&units * scaled.cholesky()?.inverse() * &units)
}

fn stepped(equations: &[Equations], shared: &Shared, state: &State, damping: f64) -> Option<State> {
    let reduced: Option<Vec<_>> = equations.iter().map(|view| reduce(view, damping)).collect();
    let reduced = reduced?;
    let step = if shared.count() > 0 {
        let information = reduced.iter().map(|view| &view.information).sum();
        let gradient: DVector<f64> = reduced.iter().map(|view| &view.gradient).sum();
        -inverse(&damped(information, damping))? * gradient
    } else {
        DVector::zeros(0)
    };
    let mut next = state.clone();
    for (at, by) in step.iter().enumerate() {
        shared.add(&mut next.camera, &mut next.shape, at, *by)?;
    }
    for (view, pose) in equations.iter().zip(&mut next.poses) {
        let solved = damped(view.own.tr_mul(&view.own), damping).cholesky()?;
        let rest = view.own.tr_mul(&(&view.residuals + &view.shared * &step));
        *pose = moved(pose, (-solved.solve(&rest)).as_slice());
    }
    Some(next)
}

/// Returns how much more the solution scatters when views are left out, one after the other, than the residuals explain:
/// `1 + (tr(Σ⁻¹ J) - E) / n`, J the jackknife's covariance by one step for each view, Σ that of the residuals, E its
/// expectation from the views' leverages; at least 1.
fn view_scatter(views: &[Reduced], information: &DMatrix<f64>, variance: f64) -> Option<f64> {
    let count = information.nrows();
    let root = inverse(information)?.cholesky()?.l();
    let (mut found, mut expected) = (0.0, 0.0);
    for view in views {
        // Both in units in which the information of all views is 1.
        let leverage = (root.tr_mul(&view.information) * &root).symmetric_eigen();
        let pull = leverage.eigenvectors.tr_mul(&root.tr_mul(&view.gradient));
        for (share, pull) in leverage.eigenvalues.iter().zip(pull.iter()) {
            let rest = 1.0 - share.clamp(0.0, 1.0);
            let factor = if rest > ALONE { 1.0 / rest } else { 1.0 };
            found += (factor * pull).powi(2) / variance;
            expected += factor * factor * share.clamp(0.0, 1.0) * rest;
        }
    }
    let number = views.len() as f64;
    Some(1.0 + ((found - expected) * (number - 1.0) / (number * count as f64)).max(0.0))
}
