//! Grey pictures, the input of the detectors of boards and markers.

use crate::scanner::{
    channel::{AnyPlane, Decoder, SearchedRegion},
    image::Image,
    params::Channel,
};

/// A grey picture with one byte per pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GrayPicture {
    /// Number of columns.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// `width * height` grey levels, row by row without padding.
    pub levels: Vec<u8>,
}

impl GrayPicture {
    /// Converts an image to 8-bit grey. `full_scale` is the level of a 16-bit image that becomes 255; brighter levels are
    /// clipped. It has no effect on 8-bit images.
    #[must_use]
    pub fn from_image(image: &Image<'_>, full_scale: u32) -> Self {
        let region = SearchedRegion::whole(image);
        let levels = match Decoder::default().decode(image, Channel::Gray, &region) {
            AnyPlane::Eight(plane) => plane.rows().flatten().copied().collect(),
            AnyPlane::Sixteen(plane) => {
                let eight =
                    |level: u16| (u32::from(level) * 255 / full_scale.max(1)).min(255) as u8;
                plane.rows().flatten().copied().map(eight).collect()
            }
        };
        Self { width: image.width(), height: image.height(), levels }
    }
}
