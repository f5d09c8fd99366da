//! The node's services, for buttons in a viewer.

use foxglove::{
    Schema,
    websocket::service::{Request, Service, ServiceSchema},
};

/// Description of a service for viewers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ServiceDescription<'a> {
    /// Absolute name, as in `/laser_profiler/start_scan`.
    pub(crate) name: &'a str,
    /// Full name of the type, as in `std_srvs/srv/Trigger`.
    pub(crate) type_name: &'a str,
    /// The request in the `.msg` language.
    pub(crate) request: &'a str,
    /// The response in the `.msg` language.
    pub(crate) response: &'a str,
}

/// A request of four bytes is the header of CDR alone.
const EMPTY_BYTES: usize = 4;

/// A service that answers CDR bytes with CDR bytes, on a thread that may wait; `None`: the request is malformed.
pub(super) fn service(
    description: ServiceDescription<'_>,
    on_request: impl Fn(&[u8]) -> Option<Vec<u8>> + Send + Sync + 'static,
) -> Service {
    let ServiceDescription { name, type_name, request, response } = description;
    let schema = |part: &str, text: &str| {
        Schema::new(format!("{type_name}_{part}"), "ros2msg", text.as_bytes().to_vec())
    };
    let schema = ServiceSchema::new(type_name)
        .with_request("cdr", schema("Request", request))
        .with_response("cdr", schema("Response", response));
    Service::builder(name, schema).blocking_handler_fn(move |request: Request| {
        let mut bytes = request.payload().to_vec();
        if bytes.len() == EMPTY_BYTES {
            // ROS puts one byte into messages that would be empty; not every viewer knows.
            bytes.push(0);
        }
        on_request(&bytes).ok_or("the request is not valid CDR of its type")
    })
}
