//! Ground truth: the defects in the scenario of the bundled recording.

use crate::simulate::scenario::Scenario;

/// A defect of the scenario.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct KnownDefect {
    /// Kind: bubble, pit or fold.
    pub(crate) name: &'static str,
    /// Center (x, y), metres; y counts from the first frame.
    pub(crate) center_m: [f64; 2],
    /// Height above the film, metres; negative for a pit.
    pub(crate) height_m: f64,
}

/// Returns all defects of a scenario.
pub(crate) fn known_defects(scenario: &Scenario) -> Vec<KnownDefect> {
    let film = &scenario.part.film;
    let known = |name, x_m: f64, y_m: f64, height_m| KnownDefect {
        name,
        center_m: [x_m, y_m - scenario.motion.start_m],
        height_m,
    };
    let bubbles = film.bubbles.iter().map(|b| known("bubble", b.x_m, b.y_m, b.height_m));
    let pits = film.pits.iter().map(|p| known("pit", p.x_m, p.y_m, -p.depth_m));
    let folds = film.folds.iter().map(|fold| {
        let [x_m, y_m] = [0, 1].map(|axis| 0.5 * (fold.from_m[axis] + fold.to_m[axis]));
        known("fold", x_m, y_m, fold.height_m)
    });
    bubbles.chain(pits).chain(folds).collect()
}

/// Returns the defect whose center is nearest to a place; `None` if it is farther away than `reach_m`, metres.
pub(crate) fn nearest(
    known: &[KnownDefect],
    center_m: [f64; 2],
    reach_m: f64,
) -> Option<&KnownDefect> {
    let distance_m = |defect: &KnownDefect| {
        (defect.center_m[0] - center_m[0]).hypot(defect.center_m[1] - center_m[1])
    };
    known
        .iter()
        .filter(|defect| distance_m(defect) <= reach_m)
        .min_by(|a, b| distance_m(a).total_cmp(&distance_m(b)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::scenario::EXAMPLE;

    #[test]
    fn defects_are_matched_by_their_center_on_the_scan() {
        let known = known_defects(&Scenario::from_yaml(EXAMPLE).unwrap());
        // The scan starts 5 mm before the cell.
        let name = |x_mm, y_mm| {
            nearest(&known, [x_mm * 1e-3, y_mm * 1e-3], 1e-3).map(|defect| defect.name)
        };
        assert_eq!(name(2.1, 10.1), Some("bubble"));
        assert_eq!(name(-3.4, 12.0), Some("pit"));
        assert_eq!(name(-2.0, 9.9), Some("fold"));
        assert_eq!(name(5.0, 5.0), None);
    }
}
