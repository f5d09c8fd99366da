//! Connected dark regions of a grey picture.

use nalgebra::Point2;

use super::picture::GrayPicture;

/// Half the side of the square around a pixel that defines its surroundings.
const RADIUS: usize = 15;
/// A pixel is dark below this share of the mean of its surroundings.
const DARK: f64 = 0.85;
/// Fewest pixels of a region.
const MIN_PIXELS: usize = 60;

/// Returns the outline of every dark region: the first and last pixel of each of its rows.
pub(super) fn dark_outlines(picture: &GrayPicture) -> Vec<Vec<Point2<f64>>> {
    dark_outlines_within(picture, RADIUS)
}

/// Returns the outlines of regions that are darker than a square about each pixel, half of whose side is `radius`.
pub(super) fn dark_outlines_within(picture: &GrayPicture, radius: usize) -> Vec<Vec<Point2<f64>>> {
    let (width, height) = (picture.width as usize, picture.height as usize);
    let mut is_dark = dark(picture, radius);
    let mut outlines = Vec::new();
    let mut open = Vec::new();
    for start in 0..width * height {
        if !is_dark[start] {
            continue;
        }
        // Ends of each row, by row.
        let mut rows: Vec<(usize, usize, usize)> = Vec::new();
        let mut pixels = Vec::new();
        is_dark[start] = false;
        open.push(start);
        while let Some(at) = open.pop() {
            pixels.push(at);
            let (x, y) = (at % width, at / width);
            let near = [
                (x > 0).then(|| at - 1),
                (x + 1 < width).then(|| at + 1),
                (y > 0).then(|| at - width),
                (y + 1 < height).then(|| at + width),
            ];
            for next in near.into_iter().flatten() {
                if is_dark[next] {
                    is_dark[next] = false;
                    open.push(next);
                }
            }
        }
        if pixels.len() < MIN_PIXELS || pixels.len() > width * height / 4 {
            continue;
        }
        pixels.sort_unstable();
        for at in pixels {
            let (x, y) = (at % width, at / width);
            match rows.last_mut() {
                Some(row) if row.0 == y => row.2 = x,
                _ => rows.push((y, x, x)),
            }
        }
        let point = |x: usize, y: usize| Point2::new(x as f64, y as f64);
        outlines.push(rows.iter().flat_map(|&(y, a, b)| [point(a, y), point(b, y)]).collect());
    }
    outlines
}

/// Marks pixels darker than their surroundings.
fn dark(picture: &GrayPicture, radius: usize) -> Vec<bool> {
    let (width, height) = (picture.width as usize, picture.height as usize);
    // Integral image: sums of everything above and to the left.
    let mut sums = vec![0_u64; (width + 1) * (height + 1)];
    for y in 0..height {
        let mut row = 0;
        for x in 0..width {
            row += u64::from(picture.levels[y * width + x]);
            sums[(y + 1) * (width + 1) + x + 1] = sums[y * (width + 1) + x + 1] + row;
        }
    }
    let sum = |x: usize, y: usize| sums[y * (width + 1) + x];
    let is_dark = |at: usize| {
        let (x, y) = (at % width, at / width);
        let (left, top) = (x.saturating_sub(radius), y.saturating_sub(radius));
        let (right, bottom) = ((x + radius + 1).min(width), (y + radius + 1).min(height));
        let total = sum(right, bottom) + sum(left, top) - sum(right, top) - sum(left, bottom);
        let mean = total as f64 / ((right - left) * (bottom - top)) as f64;
        f64::from(picture.levels[at]) < DARK * mean
    };
    (0..width * height).map(is_dark).collect()
}
