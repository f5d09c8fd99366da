//! How accurate a centreline is: against truth, against the noise's own bound, and by the protocol of Yao et al. 2023.
//! Pure: a result is a function of the scene, the seed and the parameters.
//!
//! Truth comes from where the extractor did not make it: [`scene`] renders stripes about centres that it states, and a
//! recording of `laser_profiler simulate` carries its own. [`bound`] says how small an error could be at all.
//!
//! | file | what |
//! |---|---|
//! | [`statistics`] | errors as a few numbers |
//! | [`bound`] | the Cramér–Rao bound of the centre |
//! | [`scene`], [`trial`] | a stripe with known centres, and the methods on it |
//! | [`experiment`], [`locking`], [`edge`], [`smoothing`] | what is varied, and what is asked |
//! | [`paper`], [`table3`], [`added_noise`] | the protocol of the paper, its numbers, its noise |

pub mod statistics;
pub mod normal;
pub mod bound;
pub mod scene;
pub mod trial;
pub mod experiment;
pub mod locking;
pub mod edge;
pub mod smoothing;
pub mod table3;
pub mod paper;
pub mod added_noise;
