//! What is done with measured points: plateaus, planes, steps, spheres, volumes, regular height maps. Pure: no file,
//! socket, thread or clock. Every figure comes with its uncertainty.

pub mod correlation;
pub mod plateaus;
pub mod robust;
pub mod steps;
pub mod student;
