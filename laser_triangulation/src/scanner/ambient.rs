//! The stored frame without laser that `background: reference` subtracts from every frame.

use super::{
    channel::{Decoder, SearchedRegion},
    image::{Image, OwnedImage},
    params::{Background, Channel, Params},
    stripe::Extractor,
};
use thiserror::Error;

/// The frame, and what it was last prepared for.
#[derive(Debug, Default)]
pub(super) struct Ambient {
    image: Option<OwnedImage>,
    decoder: Decoder,
    prepared: Option<(SearchedRegion, u32, Channel)>,
}

/// Reasons why the stored frame does not fit the image.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum AmbientError {
    /// There is no stored frame.
    #[error("background is reference, but there is no frame without laser: set background_file")]
    Missing,
    /// The frame is from another camera, or has another binning.
    #[error(
        "image is {width} x {height} pixels, but the frame without laser is {ambient_width} x {ambient_height}"
    )]
    Size {
        /// Columns of the image.
        width: u32,
        /// Rows of the image.
        height: u32,
        /// Columns of the frame without laser.
        ambient_width: u32,
        /// Rows of the frame without laser.
        ambient_height: u32,
    },
    /// The grey levels have different ranges.
    #[error(
        "levels of the image end at {max_level}, but those of the frame without laser at {ambient_max_level}"
    )]
    Depth {
        /// Largest level of the image's encoding.
        max_level: u32,
        /// Largest level of the frame without laser.
        ambient_max_level: u32,
    },
}

impl Ambient {
    /// Stores the frame without laser; `None` if there is none.
    pub(super) fn new(image: Option<OwnedImage>) -> Self {
        Self { image, ..Self::default() }
    }

    /// Requires a new preparation: the extractor or the channel has changed.
    pub(super) const fn forget(&mut self) {
        self.prepared = None;
    }

    /// The stored frame.
    pub(super) fn view(&self) -> Option<Image<'_>> {
        self.image.as_ref().map(OwnedImage::view)
    }

    /// True if the stored frame is one channel of grey levels, which `laser_profiler ambient` makes of colour images, too.
    pub(super) fn is_gray(&self) -> bool {
        self.image.as_ref().is_some_and(|image| !image.view().format().has_colors())
    }

    /// Passes the searched part of the stored frame to the extractor, once, if the parameters subtract a reference.
    /// `params.channel` is the channel that is measured.
    ///
    /// # Errors
    /// There is no stored frame, or it does not fit the image.
    pub(super) fn prepare(
        &mut self,
        image: &Image<'_>,
        searched: &SearchedRegion,
        params: &Params,
        extractor: &mut Extractor,
    ) -> Result<(), AmbientError> {
        if params.extraction.background != Background::Reference {
            return Ok(());
        }
        let max_level = image.format().max_level();
        let ambient = self.image.as_ref().ok_or(AmbientError::Missing)?.view();
        let (ambient_width, ambient_height) = (ambient.width(), ambient.height());
        let (width, height) = (image.width(), image.height());
        if (width, height) != (ambient_width, ambient_height) {
            return Err(AmbientError::Size { width, height, ambient_width, ambient_height });
        }
        let ambient_max_level = ambient.format().max_level();
        if max_level != ambient_max_level {
            return Err(AmbientError::Depth { max_level, ambient_max_level });
        }
        let wanted = (*searched, max_level, params.channel);
        if self.prepared != Some(wanted) {
            extractor.set_ambient(&self.decoder.decode(&ambient, params.channel, searched));
            self.prepared = Some(wanted);
        }
        Ok(())
    }
}
