//! How to join a domain, and the same in Cyclone's XML.

use std::net::Ipv4Addr;

/// Network interfaces that a domain uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interfaces {
    /// The one that Cyclone selects.
    Automatic,
    /// Only the loopback interface. Every socket that receives is bound to it.
    Loopback,
}

/// Use of multicast.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Multicast {
    /// As the interfaces permit.
    Automatic,
    /// Neither for discovery nor for data: only peers are found.
    Off,
}

/// Ports of a participant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParticipantIndex {
    /// The first free one of the well-known ports, so that others find this participant without multicast.
    Automatic {
        /// Highest index that is tried, and the highest one that peers are asked for.
        max: u16,
    },
    /// Any ports.
    None,
}

/// How to join a domain.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Config {
    /// Number of the domain, 0 to 232.
    pub domain_id: u32,
    /// Interfaces.
    pub interfaces: Interfaces,
    /// Multicast.
    pub multicast: Multicast,
    /// Machines that this participant announces itself to, besides those that multicast reaches.
    pub peers: Vec<Ipv4Addr>,
    /// Ports.
    pub participant_index: ParticipantIndex,
    /// Name that participants must share to find each other; empty: none. Letters, digits and `_`.
    pub tag: String,
    /// Receive buffer to ask for, bytes. The kernel may grant less: see `Domain::receive_buffer_bytes`.
    pub receive_buffer_bytes: u32,
    /// Largest UDP datagram sent, bytes.
    pub max_datagram_bytes: u32,
    /// Size of the fragments that a larger message is sent in, bytes; at most a little less than a datagram. A reader
    /// asks for 256 lost fragments at once, so that small ones take many rounds.
    pub fragment_bytes: u16,
    /// Most bytes that wait to be sent again. It must exceed the largest message, or readers of lossy networks and of
    /// small buffers recover it in many rounds.
    pub max_retransmit_bytes: u32,
    /// Largest message in both directions, bytes. Cyclone drops larger ones at their first fragment.
    pub max_sample_bytes: u32,
    /// Most messages of one writer that are stored while an earlier one is missing or incomplete.
    pub max_incomplete_samples: u16,
    /// Cyclone configuration of the user, XML or file names, as in `CYCLONEDDS_URI`. It has the last word.
    pub user_configuration: Option<String>,
}

impl Config {
    /// Returns Cyclone's configuration. `external_id`: the domain's number on the network, if it differs from the number
    /// in this process.
    pub(crate) fn xml(&self, external_id: Option<u32>) -> String {
        let parts = [self.general(), self.discovery(external_id), self.internal()];
        let own = element("CycloneDDS", &element("Domain", &parts.concat()));
        [Some(&own), self.user_configuration.as_ref()]
            .map(|part| part.map_or("", String::as_str))
            .join(",")
    }

    fn general(&self) -> String {
        let mut parts = vec![
            element("MaxMessageSize", &bytes(self.max_datagram_bytes)),
            element("FragmentSize", &bytes(u32::from(self.fragment_bytes))),
        ];
        if self.interfaces == Interfaces::Loopback {
            parts.push(element("Interfaces", "<NetworkInterface address=\"127.0.0.1\"/>"));
        }
        if self.multicast == Multicast::Off {
            parts.push(element("AllowMulticast", "false"));
        }
        element("General", &parts.concat())
    }

    fn discovery(&self, external_id: Option<u32>) -> String {
        let mut parts = Vec::new();
        match self.participant_index {
            ParticipantIndex::Automatic { max } => {
                parts.push(element("ParticipantIndex", "auto"));
                parts.push(element("MaxAutoParticipantIndex", &max.to_string()));
            }
            ParticipantIndex::None => parts.push(element("ParticipantIndex", "none")),
        }
        if let Some(id) = external_id {
            parts.push(element("ExternalDomainId", &id.to_string()));
        }
        if !self.tag.is_empty() {
            let is_plain = |letter: &char| letter.is_ascii_alphanumeric() || *letter == '_';
            parts.push(element("Tag", &self.tag.chars().filter(is_plain).collect::<String>()));
        }
        if !self.peers.is_empty() {
            let peers = self.peers.iter().map(|peer| format!("<Peer Address=\"{peer}\"/>"));
            parts.push(element("Peers", &peers.collect::<String>()));
        }
        element("Discovery", &parts.concat())
    }

    fn internal(&self) -> String {
        let most = self.max_incomplete_samples.to_string();
        let size = bytes(self.receive_buffer_bytes);
        let max_retransmits = self.max_retransmit_bytes / u32::from(self.fragment_bytes.max(1));
        let parts = [
            // Without a minimum, less is accepted.
            format!("<SocketReceiveBufferSize min=\"default\" max=\"{size}\"/>"),
            element("MaxSampleSize", &bytes(self.max_sample_bytes)),
            element("MaxQueuedRexmitBytes", &bytes(self.max_retransmit_bytes)),
            element("MaxQueuedRexmitMessages", &max_retransmits.to_string()),
            element("PrimaryReorderMaxSamples", &most),
            element("SecondaryReorderMaxSamples", &most),
            element("DeliveryQueueMaxSamples", &most),
        ];
        element("Internal", &parts.concat())
    }
}

fn bytes(number: u32) -> String {
    format!("{number} B")
}

fn element(name: &str, content: &str) -> String {
    format!("<{name}>{content}</{name}>")
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn config(domain_id: u32) -> Config {
        Config {
            domain_id,
            interfaces: Interfaces::Loopback,
            multicast: Multicast::Off,
            peers: vec![Ipv4Addr::LOCALHOST],
            participant_index: ParticipantIndex::Automatic { max: 32 },
            tag: String::new(),
            receive_buffer_bytes: 4 << 20,
            max_datagram_bytes: 14_720,
            fragment_bytes: 1344,
            max_retransmit_bytes: 64 << 20,
            max_sample_bytes: 64 << 20,
            max_incomplete_samples: 32,
            user_configuration: None,
        }
    }

    #[test]
    fn every_setting_is_in_the_configuration() {
        let mut wanted = Config { tag: "a_<b>1".to_owned(), ..config(5) };
        wanted.user_configuration = Some("file:///etc/cyclone.xml".to_owned());
        let xml = wanted.xml(Some(5));
        for part in [
            "<NetworkInterface address=\"127.0.0.1\"/>",
            "<AllowMulticast>false</AllowMulticast>",
            "<MaxMessageSize>14720 B</MaxMessageSize>",
            "<FragmentSize>1344 B</FragmentSize>",
            "<MaxQueuedRexmitBytes>67108864 B</MaxQueuedRexmitBytes>",
            "<MaxQueuedRexmitMessages>49932</MaxQueuedRexmitMessages>",
            "<ParticipantIndex>auto</ParticipantIndex>",
            "<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>",
            "<ExternalDomainId>5</ExternalDomainId>",
            "<Tag>a_b1</Tag>",
            "<Peer Address=\"127.0.0.1\"/>",
            "max=\"4194304 B\"",
            "<MaxSampleSize>67108864 B</MaxSampleSize>",
            "<PrimaryReorderMaxSamples>32</PrimaryReorderMaxSamples>",
        ] {
            assert!(xml.contains(part), "{part} in {xml}");
        }
        assert!(xml.ends_with("</CycloneDDS>,file:///etc/cyclone.xml"), "{xml}");
    }

    #[test]
    fn what_is_not_set_is_left_to_cyclone() {
        let open = Config {
            interfaces: Interfaces::Automatic,
            multicast: Multicast::Automatic,
            peers: Vec::new(),
            participant_index: ParticipantIndex::None,
            ..config(5)
        };
        let xml = open.xml(None);
        for part in ["Interface", "AllowMulticast", "Peers", "Tag", "ExternalDomainId", "MaxAuto"] {
            assert!(!xml.contains(part), "{part} in {xml}");
        }
    }
}
