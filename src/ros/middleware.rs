//! Selection of the middleware, and joining its network.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

#[cfg(feature = "dds")]
use super::dds::{DdsSettings, DdsTransport};
#[cfg(feature = "zenoh")]
use super::zenoh::{Role, ZenohSettings, ZenohTransport};
use super::{
    node_params::ServiceMapping,
    transport::{NodeIdentity, Transport, TransportError},
};
use laser_triangulation::named_enum;

named_enum! {
    /// A middleware of ROS 2.
    #[derive(serde::Serialize, serde::Deserialize)]
    Middleware {
        /// DDS: Fast DDS, Cyclone DDS and others.
        Dds = "dds",
        /// Zenoh, compatible with `rmw_zenoh`.
        Zenoh = "zenoh",
    }
}

/// How to join a network, in addition to the environment.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct JoinRequest {
    /// Middleware of the network.
    pub(crate) middleware: Middleware,
    /// The node that joins.
    pub(crate) node: NodeIdentity,
    /// Wire format of services on DDS.
    pub(crate) service_mapping: ServiceMapping,
    /// True if the node is its own Zenoh router.
    pub(crate) is_router: bool,
    /// Largest memory of the middleware process, bytes.
    pub(crate) max_memory_bytes: u64,
}

impl Middleware {
    /// Returns the middleware of the environment's `RMW_IMPLEMENTATION`: Zenoh if it is `rmw_zenoh_cpp`, otherwise DDS.
    pub(crate) fn of_environment(variable: &dyn Fn(&str) -> Option<String>) -> Self {
        match variable("RMW_IMPLEMENTATION").as_deref() {
            Some("rmw_zenoh_cpp") => Self::Zenoh,
            _ => Self::Dds,
        }
    }
}

/// Joins the network in this process, with the settings of the environment.
///
/// # Errors
/// An invalid setting, an unreachable network, or a program built without this middleware.
pub(crate) fn join(request: &JoinRequest) -> Result<Arc<dyn Transport>, TransportError> {
    let variable = |name: &str| std::env::var(name).ok();
    match request.middleware {
        #[cfg(feature = "dds")]
        Middleware::Dds => {
            let settings = DdsSettings::from_environment(&variable, request.service_mapping)?;
            Ok(Arc::new(DdsTransport::open(&settings, &request.node)?))
        }
        #[cfg(feature = "zenoh")]
        Middleware::Zenoh => {
            let role = if request.is_router { Role::Router } else { Role::Node };
            let settings = ZenohSettings::from_environment(&variable, role)?;
            Ok(Arc::new(ZenohTransport::open(&settings, &request.node)?))
        }
        #[cfg(not(all(feature = "dds", feature = "zenoh")))]
        absent => {
            _ = variable;
            Err(TransportError::Setting {
                setting: format!("--transport {}", absent.name()),
                reason: format!(
                    "this program was built without it: rebuild it with the Cargo feature {:?}",
                    absent.name()
                ),
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_environment_selects_the_middleware() {
        let of = |value: Option<&str>| {
            Middleware::of_environment(&|name| {
                value.filter(|_| name == "RMW_IMPLEMENTATION").map(str::to_owned)
            })
        };
        assert_eq!(of(Some("rmw_zenoh_cpp")), Middleware::Zenoh);
        assert_eq!(of(Some("rmw_cyclonedds_cpp")), Middleware::Dds);
        assert_eq!(of(None), Middleware::Dds);
    }
}
