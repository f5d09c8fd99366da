//! The Zenoh transport against third-party software: Python's zenoh and zenoh-ros2-sdk, each in its own process, in a
//! separate network for each test.

mod peer;
mod network;

mod messages;
mod faults;
mod hostile;
mod services;
mod graph;
mod router;
mod loss;
mod volume;
mod process;
mod axis;
mod action;
mod encryption;
mod sdk;
