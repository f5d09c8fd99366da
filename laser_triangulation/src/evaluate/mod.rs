//! Accuracy of centrelines: against ground truth, against the bound set by the noise, and by the protocol of Yao et al.
//! 2023.
//! Pure: a result is a function of the scene, the seed and the parameters.
//!
//! Ground truth never comes from the extractor: `scene` renders stripes around known centres, and a recording of
//! `laser_profiler simulate` carries its own ground truth. [`bound`] gives the smallest possible error.
//!
//! | file | content |
//! |---|---|
//! | [`statistics`] | errors as a few numbers |
//! | [`bound`] | the Cramér–Rao bound of the centre |
//! | `scene`, [`trial`] | a stripe with known centres, and the methods on it |
//! | [`experiment`], [`locking`], [`edge`], [`smoothing`] | the experiments |
//! | [`hard`] | hard scenes: glow, clipping, halo, second lines, speckle; points that are wrong and do not show it |
//! | [`scatter`] | scatter along the stripe over the stated standard deviation, without ground truth |
//! | [`paper`], [`table3`], [`added_noise`] | the protocol of the paper, its numbers, its noise |

pub mod statistics;
pub(crate) mod normal;
pub mod bound;
pub(crate) mod scene;
pub mod trial;
pub mod experiment;
pub mod locking;
pub mod edge;
pub mod smoothing;
pub mod hard;
pub mod scatter;
pub mod table3;
pub mod paper;
pub mod added_noise;
