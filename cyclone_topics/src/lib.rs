//! DDS topics of raw CDR messages over Cyclone DDS, with a safe interface.
//!
//! Names of topics and types are chosen at run time, and messages pass through as bytes: the caller encodes and decodes
//! them. Everything unsafe of this workspace is in this crate, each block with the reason why it is sound.
//!
//! Nothing of Cyclone's is called back but the functions of the type (`sample.rs`, `topic.rs`), which cannot panic, and
//! the log (`log.rs`), which catches panics. Messages are taken on threads of this crate.

mod config;
mod entity;
mod error;
mod log;
mod qos;
mod fragment;
mod sample;
mod topic;
mod sockets;
mod discovery;
mod domain;
mod reader;
mod worker;
mod writer;
#[cfg(test)]
mod tests;

pub use config::{Config, Interfaces, Multicast, ParticipantIndex};
pub use discovery::{Discovery, RemoteEndpoint, Side};
pub use domain::Domain;
pub use entity::Guid;
pub use error::Error;
pub use qos::{Durability, History, Liveliness, Policy, Qos, Reliability, Terms};
pub use reader::{Message, Reader, Received};
pub use writer::Writer;
