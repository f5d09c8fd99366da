//! The places of circles on their grid, by their neighbours.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use nalgebra::Vector2;

use super::{
    board::Corner,
    circle_grid::{CircleArrangement, CircleGrid},
    ellipses::Ellipse,
};
use crate::statistics::median;

/// Ellipses from which a grid is grown; the largest grid counts.
const MAX_SEEDS: usize = 40;
/// A neighbour lies within this share of the step from where it is expected.
const MAX_OFF: f64 = 0.3;
/// Largest ratio of neighbours' areas.
const MAX_AREAS: f64 = 2.5;
/// Least sine of the angle between the two directions of the grid.
const MIN_SINE: f64 = 0.35;

/// A square lattice of ellipses: columns run to the right, rows downwards, or both turned.
#[derive(Clone, Debug, Default)]
pub(super) struct Lattice(BTreeMap<(i32, i32), Ellipse>);

/// Rows of a matrix that maps one place to another.
type Map = [[i32; 2]; 2];

/// Grows the largest lattice of these ellipses.
pub(super) fn grow(all: &[Ellipse]) -> Lattice {
    let count = all.len().max(1) as f64;
    let middle = all.iter().map(|ellipse| ellipse.centre.coords).sum::<Vector2<f64>>() / count;
    let mut seeds: Vec<usize> = (0..all.len()).collect();
    let off = |index: &usize| (all[*index].centre.coords - middle).norm();
    seeds.sort_by(|a, b| off(a).total_cmp(&off(b)));
    let mut best = Lattice::default();
    for seed in seeds.into_iter().take(MAX_SEEDS) {
        let grown = from_seed(all, seed).unwrap_or_default();
        if grown.len() > best.len() {
            best = grown;
        }
        if 2 * best.len() > all.len() {
            break;
        }
    }
    best
}

fn from_seed(all: &[Ellipse], seed: usize) -> Option<Lattice> {
    let mut found = BTreeMap::from([((0, 0), all[seed])]);
    let mut used = BTreeSet::from([seed]);
    let mut open = VecDeque::from([((0, 0), seed, steps(all, seed)?)]);
    while let Some(((i, j), from, steps)) = open.pop_front() {
        for (axis, sign) in [(0, 1), (0, -1), (1, 1), (1, -1)] {
            let place = if axis == 0 { (i + sign, j) } else { (i, j + sign) };
            if found.contains_key(&place) {
                continue;
            }
            let step = steps[axis] * f64::from(sign);
            let Some(next) = neighbour(all, from, step) else { continue };
            if !used.insert(next) {
                continue;
            }
            let mut steps = steps;
            steps[axis] = (all[next].centre - all[from].centre) * f64::from(sign);
            found.insert(place, all[next]);
            open.push_back((place, next, steps));
        }
    }
    Some(Lattice(found))
}

/// Returns the ellipse one step from another.
fn neighbour(all: &[Ellipse], from: usize, step: Vector2<f64>) -> Option<usize> {
    let Ellipse { centre, area } = all[from];
    let expected = centre + step;
    let off = |index: usize| (all[index].centre - expected).norm();
    let nearest = (0..all.len()).filter(|&index| index != from);
    let nearest = nearest.min_by(|&a, &b| off(a).total_cmp(&off(b)))?;
    let ratio = all[nearest].area / area;
    let is_alike = (1.0 / MAX_AREAS..MAX_AREAS).contains(&ratio);
    (is_alike && off(nearest) < MAX_OFF * step.norm()).then_some(nearest)
}

/// Returns the two steps from an ellipse to its neighbours, the second to the right of the first as seen along it (down for
/// a first step to the right). Both neighbours have a counterpart on the other side.
fn steps(all: &[Ellipse], seed: usize) -> Option<[Vector2<f64>; 2]> {
    let mut near: Vec<Vector2<f64>> = (0..all.len())
        .filter(|&index| index != seed)
        .map(|index| all[index].centre - all[seed].centre)
        .collect();
    near.sort_by(|a, b| a.norm().total_cmp(&b.norm()));
    let is_step = |step: &Vector2<f64>| {
        [*step, -step].into_iter().all(|step| neighbour(all, seed, step).is_some())
    };
    let mut steps = near.into_iter().take(12).filter(is_step);
    let first = steps.next()?;
    let sine = |step: &Vector2<f64>| first.perp(step) / (first.norm() * step.norm());
    let second = steps.find(|step| sine(step).abs() > MIN_SINE)?;
    Some([first, if sine(&second) < 0.0 { -second } else { second }])
}

impl Lattice {
    /// Returns the number of circles.
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    /// Returns the circles with their places on a grid, pitches; `None` if they do not fit onto it. Of several ways to
    /// place them, the one with the smallest area.
    pub(super) fn places(&self, grid: &CircleGrid) -> Option<Vec<Corner>> {
        let [columns, rows] = grid.span();
        let fits = |&(_, [x, y]): &(Map, [u32; 2])| x <= columns && y <= rows;
        let placed = self.placed(grid.arrangement).into_iter().filter(fits);
        let (map, _) = placed.min_by_key(|(_, [x, y])| u64::from(*x) * u64::from(*y))?;
        let at = self.mapped(&map);
        let first = [0, 1].map(|axis| at.iter().map(|place| place[axis]).min().unwrap_or(0));
        let place = |at: &[i32; 2]| ((at[0] - first[0]) as u32, (at[1] - first[1]) as u32);
        let corner =
            |(at, one): (&[i32; 2], &Ellipse)| Corner { place: place(at), seen: one.centre };
        Some(at.iter().zip(self.0.values()).map(corner).collect())
    }

    /// Describes the grid in a few words.
    pub(super) fn describe(&self) -> String {
        let smallest = |arrangement| {
            let spans = self.placed(arrangement).into_iter().map(|(_, span)| span);
            spans.min_by_key(|[x, y]| u64::from(*x) * u64::from(*y))
        };
        if let Some([x, y]) = smallest(CircleArrangement::Symmetric)
            && (x * y) as usize == self.len()
        {
            return format!("a symmetric grid of {} x {} circles", x.max(y), x.min(y));
        }
        if let Some([x, y]) = smallest(CircleArrangement::Asymmetric)
            && (x * y) as usize == 2 * self.len()
        {
            // A quarter turn may exchange columns and rows.
            let [x, y] = if x % 2 == 0 { [x, y] } else { [y, x] };
            return format!("an asymmetric grid of {} x {y} circles", x / 2);
        }
        format!("a grid of {} circles", self.len())
    }

    /// Returns the radius of the circles, pitches: the root of a circle's share of its cell, which hardly depends on the
    /// perspective. `None` if no circle has neighbours all round.
    pub(super) fn radius(&self, arrangement: CircleArrangement) -> Option<f64> {
        let at = |i: i32, j: i32| Some(self.0.get(&(i, j))?.centre);
        let share = |(&(i, j), ellipse): (&(i32, i32), &Ellipse)| {
            let across = (at(i + 1, j)? - at(i - 1, j)?) / 2.0;
            let along = (at(i, j + 1)? - at(i, j - 1)?) / 2.0;
            Some(ellipse.area / across.perp(&along).abs())
        };
        let mut shares: Vec<_> = self.0.iter().filter_map(share).collect();
        let cell = match arrangement {
            CircleArrangement::Symmetric => 1.0,
            CircleArrangement::Asymmetric => 2.0,
        };
        Some((median(&mut shares)? * cell / std::f64::consts::PI).sqrt())
    }

    /// Returns every way to place the circles on grids of an arrangement, with the columns and rows that they span.
    fn placed(&self, arrangement: CircleArrangement) -> Vec<(Map, [u32; 2])> {
        let span = |map: &Map| {
            let at = self.mapped(map);
            [0, 1].map(|axis| {
                let along = || at.iter().map(|place| place[axis]);
                (along().max().unwrap_or(0) - along().min().unwrap_or(0) + 1) as u32
            })
        };
        maps(arrangement).into_iter().map(|map| (map, span(&map))).collect()
    }

    fn mapped(&self, map: &Map) -> Vec<[i32; 2]> {
        let apply = |&(i, j): &(i32, i32)| map.map(|row| row[0] * i + row[1] * j);
        self.0.keys().map(apply).collect()
    }
}

/// Returns the maps from a lattice, whose steps may run askew, to places on a grid, without mirrored ones.
fn maps(arrangement: CircleArrangement) -> Vec<Map> {
    let ones = |digits: i32, place: u32| digits / 3_i32.pow(place) % 3 - 1;
    let all = (0..81).map(|n| [[ones(n, 0), ones(n, 1)], [ones(n, 2), ones(n, 3)]]);
    let straight = all.filter(|[[a, b], [c, d]]| a * d - b * c == 1);
    let map = |[x, y]: Map| match arrangement {
        CircleArrangement::Symmetric => [x, y],
        // Neighbours lie one column and one row away.
        CircleArrangement::Asymmetric => [[x[0] - y[0], x[1] - y[1]], [x[0] + y[0], x[1] + y[1]]],
    };
    straight.map(map).collect()
}
