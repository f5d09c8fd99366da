//! Renders any frame of a scenario, with the true position of its stripe.

use super::{
    exposure::{CrossSection, Exposure},
    noise::{frame_rng, speckle},
    scenario::Scenario,
};

/// A rendered frame; its buffers are reused.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RenderedFrame {
    /// Samples, rows without padding; samples of more than 8 bits are little endian.
    pub samples: Vec<u8>,
    /// Exact light in each column (row, for a vertical stripe); the centre is NaN where the image shows no stripe.
    pub truth: Vec<CrossSection>,
    pub(super) exposure: Exposure,
}

impl Scenario {
    /// Renders a frame. The result depends only on the scenario and the frame's number.
    pub fn render(&self, frame: u32, out: &mut RenderedFrame) {
        let mut rng = frame_rng(self.seed, u64::from(frame));
        let camera = &self.camera;
        let laser = &self.laser;
        let shares =
            speckle(&mut rng, camera.length_px(), laser.speckle_contrast, laser.speckle_sigma_px);
        out.truth.clear();
        let exposure_factor = self.exposure_factor(frame);
        out.truth.extend((0..).zip(&shares).map(|(column, share)| {
            let mut section = self.cross_section(frame, column);
            section.amplitude *= share * exposure_factor;
            section
        }));
        self.expose(frame, &out.truth, &mut out.exposure);
        camera.sensor().read_out(&out.exposure, &mut rng, &mut out.samples);
    }

    /// Returns the exact light of the stripe in one column (row, for a vertical stripe), without speckle.
    fn cross_section(&self, frame: u32, column: u32) -> CrossSection {
        let position_m = self.position_m(frame);
        let sigma_px = self.laser.sigma_px;
        let dark = CrossSection { center_px: f64::NAN, amplitude: 0.0, sigma_px };
        let Some(point) = self.camera.lit_point(&self.part, position_m, column) else {
            return dark;
        };
        let (_, center_px) = self.camera.project(point);
        let reflectance = self.part.surface(point.x_m, position_m).reflectance;
        let in_picture = -0.5..f64::from(self.camera.across_px()) - 0.5;
        if reflectance == 0.0 || !in_picture.contains(&center_px) {
            return dark;
        }
        CrossSection { center_px, amplitude: self.laser.amplitude * reflectance, sigma_px }
    }

    /// Adds up the light: the stripe, its reflections and everything else.
    fn expose(&self, frame: u32, stripe: &[CrossSection], exposure: &mut Exposure) {
        let camera = &self.camera;
        exposure.reset(camera.width_px, camera.height_px, 0.0);
        let size_px = [camera.width_px, camera.height_px];
        let factor = self.exposure_factor(frame);
        exposure.add(|column, row| {
            (factor * self.clutter.level(frame, size_px, [column, row]).max(0.0)) as f32
        });
        exposure.add_stripe(camera.stripe_direction, |column| stripe[column as usize]);
        for reflection in &self.clutter.reflections {
            exposure.add_stripe(camera.stripe_direction, |column| {
                let mut section = stripe[column as usize];
                section.center_px += reflection.offset_px;
                if (reflection.first..=reflection.last).contains(&column) {
                    section.amplitude *= reflection.share;
                } else {
                    section.amplitude = 0.0;
                }
                section
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{scanner::params::StripeDirection, simulate::scenario::EXAMPLE};

    fn scenario(more: &[(&str, &str)]) -> Scenario {
        let text =
            more.iter().fold(EXAMPLE.to_owned(), |text, (from, to)| text.replacen(from, to, 1));
        Scenario::from_yaml(&text).unwrap()
    }

    fn frame(scenario: &Scenario, frame: u32) -> RenderedFrame {
        let mut out = RenderedFrame::default();
        scenario.render(frame, &mut out);
        out
    }

    #[test]
    fn the_brightest_light_of_each_column_is_near_the_truth() {
        let deep = scenario(&[
            ("height_px: 96", "height_px: 96\n  bit_depth: 16"),
            ("amplitude: 183.0", "amplitude: 40000.0"),
        ]);
        let picture = frame(&deep, 20);
        let mut checked = 0;
        for (column, section) in picture.truth.iter().enumerate() {
            let level = |row: usize| {
                let at = 2 * (row * 160 + column);
                f64::from(u16::from_le_bytes([picture.samples[at], picture.samples[at + 1]]))
            };
            let flux: f64 = (0..96).map(level).sum();
            if section.center_px.is_nan() {
                assert!(flux == 0.0, "column {column} is dark");
                continue;
            }
            let centroid = (0..96).map(|row| row as f64 * level(row)).sum::<f64>() / flux;
            assert!((centroid - section.center_px).abs() < 2e-3, "{column}: {centroid}");
            checked += 1;
        }
        assert!(checked > 150);
    }

    #[test]
    fn the_truth_is_formula_6_of_the_part() {
        let truth = frame(&scenario(&[]), 20).truth;
        // Frame 20 is 5 mm into the cell. Column 79.5 is its middle: film 4.2 mm, no warp there but the twist's 0.
        let (a, b, beta, h) = (0.026, 0.3, 30f64.to_radians(), 0.0042);
        let row = 75.0 - a * h * beta.sin() / (b - h * beta.cos()) / 9.6e-6;
        for column in [79, 80] {
            assert!((truth[column].center_px - row).abs() < 1e-3, "{}", truth[column].center_px);
        }
        assert!((truth[0].center_px - 75.0).abs() < 1e-12, "the table");
    }

    #[test]
    fn frames_repeat_in_any_order_and_differ_by_seed() {
        let noise = ("height_px: 96", "height_px: 96\n  read_noise: 2.0\n  shot_gain: 0.1");
        let speckle =
            ("sigma_px: 2.3", "sigma_px: 2.3, speckle_contrast: 0.2, speckle_sigma_px: 2.0");
        let one = scenario(&[noise, speckle]);
        let forwards = [frame(&one, 3), frame(&one, 4)];
        let mut reused = frame(&one, 4);
        assert_eq!(reused, forwards[1]);
        one.render(3, &mut reused);
        assert_eq!(reused, forwards[0]);
        assert_ne!(forwards[0].samples, forwards[1].samples);
        let other = scenario(&[noise, speckle, ("seed: 1", "seed: 2")]);
        assert_ne!(frame(&other, 3).samples, forwards[0].samples);
    }

    #[test]
    fn exposures_alternate_and_do_not_change_the_truth() {
        let plain = scenario(&[("amplitude: 183.0", "amplitude: 100.0")]);
        let turns = scenario(&[
            ("amplitude: 183.0", "amplitude: 100.0"),
            ("seed: 1", "seed: 1\nexposure_factors: [2.0, 0.5, 1.0]"),
        ]);
        for (number, factor) in [(18, 2.0), (19, 0.5), (20, 1.0)] {
            let [plain, turns] = [&plain, &turns].map(|scenario| frame(scenario, number));
            let brightest = |picture: &RenderedFrame| *picture.samples.iter().max().unwrap();
            let share = f64::from(brightest(&turns)) / f64::from(brightest(&plain));
            assert!((share - factor).abs() < 0.02, "{number}: {share}");
            for (a, b) in plain.truth.iter().zip(&turns.truth) {
                assert_eq!(a.center_px.to_bits(), b.center_px.to_bits());
            }
        }
    }

    #[test]
    fn a_vertical_stripe_is_the_transposed_picture() {
        let horizontal = scenario(&[]);
        let mut vertical = horizontal.clone();
        vertical.camera.stripe_direction = StripeDirection::Vertical;
        (vertical.camera.width_px, vertical.camera.height_px) = (96, 160);
        let (horizontal, vertical) = (frame(&horizontal, 20), frame(&vertical, 20));
        for column in 0..160 {
            for row in 0..96 {
                assert_eq!(
                    horizontal.samples[row * 160 + column],
                    vertical.samples[column * 96 + row]
                );
            }
        }
    }

    #[test]
    fn reflections_and_saturation_do_not_change_the_truth() {
        let plain = frame(&scenario(&[]), 20);
        let mut glossy = scenario(&[("amplitude: 183.0", "amplitude: 690.0")]);
        glossy.clutter.reflections.push(crate::simulate::clutter::Reflection {
            offset_px: -20.0,
            share: 0.2,
            first: 60,
            last: 70,
        });
        let glossy = frame(&glossy, 20);
        for column in 0..160 {
            let [a, b] = [&plain, &glossy].map(|picture| picture.truth[column].center_px.to_bits());
            assert_eq!(a, b);
        }
        let at = |picture: &RenderedFrame, column: usize| {
            picture.samples[(plain.truth[column].center_px - 20.0).round() as usize * 160 + column]
        };
        assert!(at(&glossy, 65) > 130 && at(&glossy, 75) < 2 && at(&plain, 65) < 2);
        assert!(glossy.samples.contains(&255));
    }
}
