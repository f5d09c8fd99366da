//! Camera, laser plane and axis from views of boards and markers. Pure: a result is a function of the pictures.
//!
//! | file | what |
//! |---|---|
//! | [`target`] | the board that the user says was shown |
//! | [`board`] | its corners in a picture |
//! | [`least_squares`] | the solver of everything but the camera |
//! | [`homography`], [`pose`] | a plane's picture, and where the plane lies |
//! | [`variety`] | whether a set of views says enough, and what is missing |
//! | [`intrinsics`] | the camera from many views |
//! | [`markers`], [`quads`] | square markers in a picture |
//! | [`revolute`], [`board_axis`] | the axis that markers turn about, or that moves a board |
//! | [`positions`] | what the joint said, against what the pictures show |
//! | [`stripe_line`], [`plane`] | the laser's line on a board, and its plane through many |

pub mod target;
pub mod least_squares;
pub mod homography;
pub mod board;
pub mod pose;
pub mod variety;
mod bundle;
pub mod intrinsics;
pub mod stripe_line;
pub mod plane;
mod components;
pub mod quads;
pub mod markers;
pub mod revolute;
pub mod board_axis;
pub mod positions;
