//! The node's services, which viewers can call.

use foxglove::{
    Schema,
    websocket::service::{Request, Service, ServiceSchema},
};

/// Description of a service for viewers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ServiceDescription<'a> {
    /// Absolute name, for example `/laser_profiler/start_scan`.
    pub(crate) name: &'a str,
    /// Full name of the type, for example `std_srvs/srv/Trigger`.
    pub(crate) type_name: &'a str,
    /// The request in the `.msg` language.
    pub(crate) request: &'a str,
    /// The response in the `.msg` language.
    pub(crate) response: &'a str,
}

/// Bytes of an empty CDR message: the header alone.
const EMPTY_BYTES: usize = 4;

/// Creates a service. `on_request` receives and returns CDR bytes, or returns `None` for a malformed request; it runs
/// on a thread that may block.
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
            // ROS pads empty messages with one byte, but not every viewer does.
            bytes.push(0);
        }
        on_request(&bytes).ok_or("the request is not valid CDR of its type")
    })
}
