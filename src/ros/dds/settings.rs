//! Settings of the DDS domain and its discovery, from environment variables.

use crate::ros::{node_params::ServiceMapping, transport::TransportError};

/// Largest domain; ports of higher ones exceed 65535.
const MAX_DOMAIN_ID: u16 = 232;

/// Range of automatic discovery.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DiscoveryRange {
    /// All machines that multicast reaches.
    Subnet,
    /// This machine only.
    Localhost,
    /// Nobody.
    #[cfg(feature = "cyclone")]
    Off,
}

/// Settings for joining a domain.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DdsSettings {
    /// `ROS_DOMAIN_ID`, 0 to 232.
    pub domain_id: u16,
    /// `ROS_AUTOMATIC_DISCOVERY_RANGE`, or `ROS_LOCALHOST_ONLY`.
    pub range: DiscoveryRange,
    /// `ROS_STATIC_PEERS`: addresses and host names that this node is announced to, regardless of the range.
    pub static_peers: Vec<String>,
    /// Wire format of services.
    pub service_mapping: ServiceMapping,
    /// `CYCLONEDDS_URI`: Cyclone's own configuration of topics, XML or file names. It overrides the
    /// other settings, but not the loopback interface.
    #[cfg(feature = "cyclone")]
    pub cyclone_configuration: Option<String>,
}

impl Default for DdsSettings {
    /// Returns domain 0 on the subnet.
    fn default() -> Self {
        Self {
            domain_id: 0,
            range: DiscoveryRange::Subnet,
            static_peers: Vec::new(),
            service_mapping: ServiceMapping::Auto,
            #[cfg(feature = "cyclone")]
            cyclone_configuration: None,
        }
    }
}

impl DdsSettings {
    /// Reads `ROS_DOMAIN_ID`, `ROS_LOCALHOST_ONLY`, `ROS_AUTOMATIC_DISCOVERY_RANGE` and `ROS_STATIC_PEERS`, with Cyclone
    /// `CYCLONEDDS_URI` too, through `variable`. As in rmw, `ROS_LOCALHOST_ONLY=1` overrides
    /// `ROS_AUTOMATIC_DISCOVERY_RANGE` and `ROS_STATIC_PEERS`; an empty variable counts as unset.
    ///
    /// # Errors
    /// An invalid value; states valid ones.
    pub(crate) fn from_environment(
        variable: &dyn Fn(&str) -> Option<String>,
        service_mapping: ServiceMapping,
    ) -> Result<Self, TransportError> {
        let variable = |name: &str| variable(name).filter(|value| !value.is_empty());
        let domain_id = domain_id(variable("ROS_DOMAIN_ID"))?;
        let mut range = range(variable("ROS_AUTOMATIC_DISCOVERY_RANGE").as_deref())?;
        let mut static_peers = peers(variable("ROS_STATIC_PEERS"));
        if localhost_only(variable("ROS_LOCALHOST_ONLY").as_deref())? {
            if !static_peers.is_empty() {
                tracing::warn!("ROS_LOCALHOST_ONLY=1 overrides ROS_STATIC_PEERS");
            }
            range = DiscoveryRange::Localhost;
            static_peers.clear();
        }
        if range != DiscoveryRange::Subnet && !static_peers.is_empty() {
            let reason = "on DDS, with another ROS_AUTOMATIC_DISCOVERY_RANGE than SUBNET this node announces no address \
                          that peers can reach: set the range to SUBNET, or unset ROS_STATIC_PEERS";
            return Err(setting("ROS_STATIC_PEERS", reason));
        }
        Ok(Self {
            domain_id,
            range,
            static_peers,
            service_mapping,
            #[cfg(feature = "cyclone")]
            cyclone_configuration: variable("CYCLONEDDS_URI"),
        })
    }
}

pub(super) fn setting(name: &str, reason: impl Into<String>) -> TransportError {
    TransportError::Setting { setting: name.to_owned(), reason: reason.into() }
}

fn domain_id(value: Option<String>) -> Result<u16, TransportError> {
    let Some(value) = value else { return Ok(0) };
    let parsed = value.parse().ok().filter(|id| *id <= MAX_DOMAIN_ID);
    let reason = || format!("{value:?} is not a domain: set a number from 0 to {MAX_DOMAIN_ID}");
    parsed.ok_or_else(|| setting("ROS_DOMAIN_ID", reason()))
}

fn localhost_only(value: Option<&str>) -> Result<bool, TransportError> {
    match value {
        None | Some("0") => Ok(false),
        Some("1") => Ok(true),
        Some(other) => Err(setting("ROS_LOCALHOST_ONLY", format!("{other:?}: must be 0 or 1"))),
    }
}

fn range(value: Option<&str>) -> Result<DiscoveryRange, TransportError> {
    let name = "ROS_AUTOMATIC_DISCOVERY_RANGE";
    match value {
        None | Some("SUBNET" | "SYSTEM_DEFAULT") => Ok(DiscoveryRange::Subnet),
        Some("LOCALHOST") => Ok(DiscoveryRange::Localhost),
        #[cfg(feature = "cyclone")]
        Some("OFF") => Ok(DiscoveryRange::Off),
        #[cfg(not(feature = "cyclone"))]
        Some("OFF") => {
            let reason = "OFF is not supported on DDS: set LOCALHOST and a ROS_DOMAIN_ID that no other program uses";
            Err(setting(name, reason))
        }
        Some(other) => {
            let off = if cfg!(feature = "cyclone") { "OFF, " } else { "" };
            let allowed = format!("SUBNET, LOCALHOST, {off}or SYSTEM_DEFAULT");
            Err(setting(name, format!("{other:?}: must be {allowed}")))
        }
    }
}

fn peers(value: Option<String>) -> Vec<String> {
    let value = value.unwrap_or_default();
    value.split(';').map(str::trim).filter(|peer| !peer.is_empty()).map(str::to_owned).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(variables: &[(&str, &str)]) -> Result<DdsSettings, String> {
        let variable = |name: &str| {
            variables.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned())
        };
        DdsSettings::from_environment(&variable, ServiceMapping::Auto)
            .map_err(|error| error.to_string())
    }

    #[test]
    fn without_variables_the_domain_is_0_on_the_subnet() {
        assert_eq!(read(&[]), Ok(DdsSettings::default()));
        assert_eq!(read(&[("ROS_DOMAIN_ID", ""), ("ROS_STATIC_PEERS", "")]), read(&[]));
    }

    #[test]
    fn every_variable_is_applied() {
        let variables = [
            ("ROS_DOMAIN_ID", "232"),
            ("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET"),
            ("ROS_STATIC_PEERS", "192.168.1.7; camera.local;"),
        ];
        let settings = read(&variables).unwrap();
        assert_eq!(settings.domain_id, 232);
        assert_eq!(settings.range, DiscoveryRange::Subnet);
        assert_eq!(settings.static_peers, ["192.168.1.7", "camera.local"]);
        let settings = read(&[("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")]).unwrap();
        assert_eq!(settings.range, DiscoveryRange::Localhost);
    }

    #[cfg(feature = "cyclone")]
    #[test]
    fn cyclone_has_settings_of_its_own() {
        let off = read(&[("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")]).unwrap();
        assert_eq!(off.range, DiscoveryRange::Off);
        let uri = read(&[("CYCLONEDDS_URI", "file:///etc/cyclone.xml")]).unwrap();
        assert_eq!(uri.cyclone_configuration.as_deref(), Some("file:///etc/cyclone.xml"));
    }

    #[test]
    fn localhost_only_overrides() {
        let variables = [
            ("ROS_LOCALHOST_ONLY", "1"),
            ("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET"),
            ("ROS_STATIC_PEERS", "10.0.0.1"),
        ];
        let settings = read(&variables).unwrap();
        assert_eq!(settings.range, DiscoveryRange::Localhost);
        assert!(settings.static_peers.is_empty());
    }

    #[test]
    fn invalid_values_are_rejected_by_name() {
        for (variables, words) in [
            (&[("ROS_DOMAIN_ID", "233")][..], ["ROS_DOMAIN_ID", "\"233\"", "0 to 232"]),
            (&[("ROS_DOMAIN_ID", "-1")], ["ROS_DOMAIN_ID", "\"-1\"", "0 to 232"]),
            (&[("ROS_DOMAIN_ID", "seven")], ["ROS_DOMAIN_ID", "\"seven\"", "0 to 232"]),
            (&[("ROS_LOCALHOST_ONLY", "yes")], ["ROS_LOCALHOST_ONLY", "\"yes\"", "0 or 1"]),
            #[cfg(not(feature = "cyclone"))]
            (
                &[("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")],
                ["ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF is not supported", "LOCALHOST"],
            ),
            (
                &[("ROS_AUTOMATIC_DISCOVERY_RANGE", "lan")],
                ["ROS_AUTOMATIC_DISCOVERY_RANGE", "\"lan\"", "SUBNET"],
            ),
            (
                &[("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST"), ("ROS_STATIC_PEERS", "10.0.0.1")],
                ["ROS_STATIC_PEERS", "SUBNET", "unset"],
            ),
        ] {
            let message = read(variables).unwrap_err();
            assert!(words.iter().all(|word| message.contains(word)), "{message}");
        }
    }
}
