//! The node's services, which viewers can call.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex},
};

use super::{
    ViewError,
    protocol::{AdvertisedService, Reply, ServiceCall, ServiceSchema},
    viewers::{Viewer, Viewers, lock},
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

type OnCall = dyn Fn(&[u8]) -> Option<Vec<u8>> + Send + Sync;

struct Service {
    name: String,
    type_name: String,
    request: String,
    response: String,
    on_call: Arc<OnCall>,
}

impl Service {
    fn advertised(&self, id: u32) -> AdvertisedService<'_> {
        let schema = |part: &str, schema| ServiceSchema {
            encoding: "cdr",
            schema_name: format!("{}_{part}", self.type_name),
            schema_encoding: "ros2msg",
            schema,
        };
        AdvertisedService {
            id,
            name: &self.name,
            r#type: &self.type_name,
            request: schema("Request", &self.request),
            response: schema("Response", &self.response),
        }
    }
}

/// All services that are offered.
pub(super) struct Services {
    offered: Mutex<Offered>,
    viewers: Arc<Viewers>,
}

#[derive(Default)]
struct Offered {
    by_id: BTreeMap<u32, Service>,
    num_offered: u32,
}

impl Services {
    pub(super) fn new(viewers: Arc<Viewers>) -> Self {
        Self { offered: Mutex::default(), viewers }
    }

    /// Offers a service. `on_call` receives and returns CDR bytes, or returns `None` for a malformed request; it runs on
    /// a thread that may block.
    ///
    /// # Errors
    /// Another service has the same name.
    pub(super) fn offer(
        &self,
        description: ServiceDescription<'_>,
        on_call: impl Fn(&[u8]) -> Option<Vec<u8>> + Send + Sync + 'static,
    ) -> Result<(), ViewError> {
        let ServiceDescription { name, type_name, request, response } = description;
        let mut offered = lock(&self.offered);
        if offered.by_id.values().any(|service| service.name == name) {
            return Err(ViewError::Service(name.to_owned()));
        }
        offered.num_offered += 1;
        let id = offered.num_offered;
        let service = Service {
            name: name.to_owned(),
            type_name: type_name.to_owned(),
            request: request.to_owned(),
            response: response.to_owned(),
            on_call: Arc::new(on_call),
        };
        self.viewers.tell(&Reply::AdvertiseServices { services: vec![service.advertised(id)] });
        offered.by_id.insert(id, service);
        Ok(())
    }

    /// Removes a service.
    pub(super) fn withdraw(&self, name: &str) {
        let mut offered = lock(&self.offered);
        let found = offered.by_id.iter().find(|(_, service)| service.name == name);
        if let Some(id) = found.map(|(id, _)| *id) {
            offered.by_id.remove(&id);
            self.viewers.tell(&Reply::UnadvertiseServices { service_ids: &[id] });
        }
    }

    /// Tells a new viewer all services.
    pub(super) fn introduce(&self, viewer: &Viewer) {
        let offered = lock(&self.offered);
        let services: Vec<_> =
            offered.by_id.iter().map(|(id, service)| service.advertised(*id)).collect();
        if !services.is_empty() {
            viewer.tell(&Reply::AdvertiseServices { services });
        }
    }

    /// Calls a service. May block.
    ///
    /// # Errors
    /// There is no such service, or the request is malformed.
    pub(super) fn call(&self, mut call: ServiceCall) -> Result<Vec<u8>, String> {
        if call.encoding != "cdr" {
            return Err(format!("encoding {:?}: must be cdr", call.encoding));
        }
        let on_call = lock(&self.offered).by_id.get(&call.service_id).map(|it| it.on_call.clone());
        let on_call = on_call.ok_or_else(|| format!("there is no service {}", call.service_id))?;
        if call.payload.len() == EMPTY_BYTES {
            // ROS pads empty messages with one byte, but not every viewer does.
            call.payload.push(0);
        }
        let answer = on_call(&call.payload);
        answer.ok_or_else(|| "the request is not valid CDR of its type".to_owned())
    }
}
