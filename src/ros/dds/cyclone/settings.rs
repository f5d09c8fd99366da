//! How Cyclone joins a domain: the settings of ROS, and limits on memory.

use std::{net::Ipv4Addr, process};

use cyclone_topics::{Config, Domain, Interfaces, Multicast, ParticipantIndex};

use super::super::{
    settings::{DdsSettings, DiscoveryRange},
    static_peers::address,
};
use crate::ros::transport::TransportError;

/// Receive buffer to ask for: an image of 5 MB comes in one burst.
const RECEIVE_BUFFER_BYTES: u32 = 8 << 20;
/// Buffers below lose images of 5 MB: with 4 MiB, all of 220 arrived, with the kernel's default of 208 KiB 131.
const MIN_RECEIVE_BUFFER_BYTES: usize = 4 << 20;
/// Largest datagram, Cyclone's own value.
const MAX_DATAGRAM_BYTES: u32 = 14_720;
/// Size of fragments, one to a datagram. With Cyclone's 1344 bytes, 5 of 10 clouds of 5 MB reached Fast DDS with stock
/// buffers, after seconds; with these all 10, after 0.1 to 0.2 s.
const FRAGMENT_BYTES: u16 = 14_000;
/// Most bytes that wait to be sent again. With Cyclone's 512 kB, a subscriber that lost most of a cloud asks in many
/// rounds.
const MAX_RETRANSMIT_BYTES: u32 = 64 << 20;
/// Largest message in both directions. Cyclone drops larger ones at their first fragment, and otherwise stores what has
/// come, so that a claimed length alone takes no memory.
const MAX_SAMPLE_BYTES: u32 = 256 << 20;
/// Most messages of one publisher that wait for an earlier one. Cyclone's own limits are 128 and 256; 32 images of 5 MB
/// are 170 MB.
const MAX_INCOMPLETE_SAMPLES: u16 = 32;
/// Highest index of a participant, Cyclone's own limit.
const MAX_PARTICIPANT: u16 = 99;

/// Returns the configuration that the settings mean.
///
/// # Errors
/// A static peer without an address.
pub(super) fn config(settings: &DdsSettings) -> Result<Config, TransportError> {
    let is_local = settings.range != DiscoveryRange::Subnet;
    let mut peers = Vec::new();
    for peer in &settings.static_peers {
        peers.push(address(peer)?);
    }
    if settings.range == DiscoveryRange::Localhost {
        peers.push(Ipv4Addr::LOCALHOST);
    }
    Ok(Config {
        domain_id: u32::from(settings.domain_id),
        interfaces: if is_local { Interfaces::Loopback } else { Interfaces::Automatic },
        multicast: if is_local { Multicast::Off } else { Multicast::Automatic },
        peers,
        participant_index: match settings.range {
            DiscoveryRange::Off => ParticipantIndex::None,
            _ => ParticipantIndex::Automatic { max: MAX_PARTICIPANT },
        },
        // Participants of different tags do not find each other.
        tag: match settings.range {
            DiscoveryRange::Off => format!("laser_profiler_{}", process::id()),
            _ => String::new(),
        },
        receive_buffer_bytes: RECEIVE_BUFFER_BYTES,
        max_datagram_bytes: MAX_DATAGRAM_BYTES,
        fragment_bytes: FRAGMENT_BYTES,
        max_retransmit_bytes: MAX_RETRANSMIT_BYTES,
        max_sample_bytes: MAX_SAMPLE_BYTES,
        max_incomplete_samples: MAX_INCOMPLETE_SAMPLES,
        user_configuration: settings.cyclone_configuration.clone(),
    })
}

/// Logs a receive buffer in which large images are lost, and what to do.
pub(super) fn report_buffer(domain: &Domain, asked_bytes: u32) {
    let granted = domain.receive_buffer_bytes();
    if let Some(granted) = granted.filter(|granted| *granted < MIN_RECEIVE_BUFFER_BYTES) {
        tracing::warn!(
            "DDS asked for a receive buffer of {asked_bytes} bytes and got {granted}: images of several megabytes \
             will be lost. Allow more with: sysctl -w net.core.rmem_max={asked_bytes}"
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(range: DiscoveryRange) -> Config {
        config(&DdsSettings { range, ..DdsSettings::default() }).unwrap()
    }

    #[test]
    fn the_range_decides_who_is_found() {
        let subnet = of(DiscoveryRange::Subnet);
        assert_eq!(
            (subnet.interfaces, subnet.multicast),
            (Interfaces::Automatic, Multicast::Automatic)
        );
        assert!(subnet.peers.is_empty() && subnet.tag.is_empty());
        let local = of(DiscoveryRange::Localhost);
        assert_eq!((local.interfaces, local.multicast), (Interfaces::Loopback, Multicast::Off));
        assert_eq!(local.peers, [Ipv4Addr::LOCALHOST]);
        let off = of(DiscoveryRange::Off);
        assert_eq!(off.interfaces, Interfaces::Loopback);
        assert!(off.peers.is_empty() && !off.tag.is_empty());
    }

    #[test]
    fn static_peers_need_an_address() {
        let named = |peer: &str| {
            config(&DdsSettings { static_peers: vec![peer.to_owned()], ..DdsSettings::default() })
        };
        assert_eq!(named("192.0.2.1").unwrap().peers, [Ipv4Addr::new(192, 0, 2, 1)]);
        let error = named("no.such.host.invalid").unwrap_err().to_string();
        assert!(error.contains("ROS_STATIC_PEERS"), "{error}");
    }
}
