//! The Zenoh transport against other people's software: Python's zenoh and zenoh-ros2-sdk, each in its own process, in a
//! network of the test's own.

mod peer;
mod network;

mod messages;
mod faults;
mod services;
mod graph;
mod router;
mod loss;
mod volume;
mod process;
mod axis;
mod sdk;
