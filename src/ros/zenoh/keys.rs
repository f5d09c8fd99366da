//! Zenoh keys of a node, its messages and its services.

use hiroz_protocol::{
    EndpointEntity, EndpointKind, KeyExprFormat, NodeEntity, TypeHash, TypeInfo,
    format::rmw_zenoh::dds_type_name,
    qos::{
        QosDuration, QosHistory, QosLiveliness, QosProfile as WireQos,
        RMW_ZENOH_DEFAULT_HISTORY_DEPTH,
    },
};
use twox_hash::XxHash3_128;
use zenoh::{key_expr::KeyExpr, session::ZenohId};

use crate::{
    msg::{
        qos::{Durability, History, Liveliness, QosProfile, QosTime, Reliability},
        schema::MessageType,
    },
    ros::transport::{NodeIdentity, TopicEndpoint},
};

/// Keys of one node.
pub(super) struct NodeKeys(NodeEntity);

/// Properties that determine the keys of a publisher, subscriber or service.
pub(super) struct Endpoint<'a> {
    pub(super) kind: EndpointKind,
    /// Absolute name of its topic or service.
    pub(super) name: &'a str,
    /// Type, such as `sensor_msgs/msg/Image`.
    pub(super) type_name: &'a str,
    /// Type hash, `RIHS01_…`.
    pub(super) hash: &'a str,
    pub(super) qos: &'a QosProfile,
}

impl<'a> Endpoint<'a> {
    /// Returns one side of a topic.
    pub(super) const fn of(topic: &'a TopicEndpoint, kind: EndpointKind) -> Self {
        let TopicEndpoint { name, kind: message, qos } = topic;
        Self { kind, name: name.as_str(), type_name: message.name, hash: message.hash, qos }
    }
}

/// Keys of one publisher, subscriber or service.
#[derive(Clone, Debug)]
pub(super) struct EndpointKeys {
    /// Key of its messages.
    pub(super) data: KeyExpr<'static>,
    /// Liveliness token that announces it to the graph.
    pub(super) token: KeyExpr<'static>,
    /// Identity in attachments.
    pub(super) id: [u8; 16],
}

impl NodeKeys {
    /// Creates the keys of node number 0 of its session.
    pub(super) fn new(domain_id: u32, session: ZenohId, node: &NodeIdentity) -> Self {
        let (name, namespace) = (node.name.clone(), node.namespace.clone());
        Self(NodeEntity::new(domain_id as usize, session, 0, name, namespace, String::new()))
    }

    /// Returns the node's own token.
    pub(super) fn token(&self) -> zenoh::Result<KeyExpr<'static>> {
        Ok(KeyExprFormat::RmwZenoh.node_liveliness_key_expr(&self.0)?.0)
    }

    /// Returns the keys of endpoint number `id` of the node.
    ///
    /// # Errors
    /// A name that is not a valid key, or an invalid hash.
    pub(super) fn endpoint(
        &self,
        id: usize,
        endpoint: &Endpoint<'_>,
    ) -> zenoh::Result<EndpointKeys> {
        let Endpoint { kind, name, type_name, hash, qos } = *endpoint;
        let hash = TypeHash::from_rihs_string(hash)
            .ok_or_else(|| format!("{type_name} has an invalid type hash: {hash}"))?;
        let entity = EndpointEntity {
            id,
            node: Some(self.0.clone()),
            kind,
            topic: name.to_owned(),
            type_info: Some(TypeInfo { name: wire_type(type_name), hash }),
            qos: wire_qos(qos),
        };
        let format = KeyExprFormat::RmwZenoh;
        let data = (*format.topic_key_expr(&entity)?).clone();
        let token = format.liveliness_key_expr(&entity, &self.0.z_id)?.0;
        let id = XxHash3_128::oneshot(token.as_bytes()).to_le_bytes();
        Ok(EndpointKeys { data, token, id })
    }
}

impl EndpointKeys {
    /// Adds a subscriber of byte arrays to Lyrical's CPU buffer group and returns the group's key. A publisher of
    /// Lyrical sends to that key instead of the topic's own if every subscriber is in the group.
    pub(super) fn join_buffer_group(&mut self) -> zenoh::Result<KeyExpr<'static>> {
        self.token = KeyExpr::try_from(format!("{}/backends:cpu:", self.token))?;
        KeyExpr::try_from(format!("{}/_buf_cpu", self.data))
    }
}

/// Returns true if Lyrical treats a message as one with a buffer: it or a part of it has an unbounded byte array.
pub(super) fn has_buffer(kind: &MessageType) -> bool {
    let of_bytes = |line: &str| line.starts_with("uint8[] ") || line.starts_with("char[] ");
    kind.text.lines().any(of_bytes) || kind.dependencies.iter().any(|part| has_buffer(part))
}

/// Converts `sensor_msgs/msg/Image` to `sensor_msgs::msg::dds_::Image_`.
fn wire_type(type_name: &str) -> String {
    let (namespace, name) = type_name.rsplit_once('/').unwrap_or(("", type_name));
    dds_type_name(&namespace.replace('/', "::"), name)
}

/// Resolves policies left to the system like `rmw_zenoh_cpp`.
pub(super) fn wire_qos(qos: &QosProfile) -> WireQos {
    use hiroz_protocol::qos::{QosDurability, QosReliability};
    let depth = usize::try_from(qos.depth).ok().filter(|depth| *depth > 0);
    WireQos {
        reliability: match qos.reliability {
            Reliability::BestEffort => QosReliability::BestEffort,
            _ => QosReliability::Reliable,
        },
        durability: match qos.durability {
            Durability::TransientLocal => QosDurability::TransientLocal,
            _ => QosDurability::Volatile,
        },
        history: match qos.history {
            History::KeepAll => QosHistory::KeepAll,
            _ => QosHistory::KeepLast(depth.unwrap_or(RMW_ZENOH_DEFAULT_HISTORY_DEPTH)),
        },
        deadline: wire_time(qos.deadline),
        lifespan: wire_time(qos.lifespan),
        liveliness: match qos.liveliness {
            Liveliness::ManualByTopic => QosLiveliness::ManualByTopic,
            _ => QosLiveliness::Automatic,
        },
        liveliness_lease_duration: wire_time(qos.liveliness_lease_duration),
    }
}

/// Converts a duration; 0 is rmw's "unspecified", which means infinite.
fn wire_time(time: QosTime) -> QosDuration {
    match time {
        QosTime { sec: 0, nsec: 0 } => QosDuration::INFINITE,
        QosTime { sec, nsec } => QosDuration { sec, nsec },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::msg::{schema::Message, sensor_msgs, std_msgs};

    const SESSION: &str = "1234567890abcdef1234567890abcdef";

    fn node(namespace: &str) -> NodeKeys {
        let node =
            NodeIdentity { name: "laser_profiler".to_owned(), namespace: namespace.to_owned() };
        NodeKeys::new(7, SESSION.parse().unwrap(), &node)
    }

    fn image(qos: QosProfile) -> EndpointKeys {
        let topic = TopicEndpoint {
            name: "/camera/image_raw".to_owned(),
            kind: sensor_msgs::Image::TYPE,
            qos,
        };
        node("/").endpoint(3, &Endpoint::of(&topic, EndpointKind::Subscription)).unwrap()
    }

    #[test]
    fn keys_are_those_of_rmw_zenoh() {
        let hash = sensor_msgs::Image::TYPE.hash;
        let mut keys = image(QosProfile::best_effort(5));
        let data = format!("7/camera/image_raw/sensor_msgs::msg::dds_::Image_/{hash}");
        assert_eq!(keys.data.as_str(), data);
        let token = format!(
            "@ros2_lv/7/{SESSION}/0/3/MS/%/%/laser_profiler/%camera%image_raw/\
             sensor_msgs::msg::dds_::Image_/{hash}/2::,5:,:,:,,"
        );
        assert_eq!(keys.token.as_str(), token);
        assert_eq!(keys.join_buffer_group().unwrap().as_str(), format!("{data}/_buf_cpu"));
        assert_eq!(keys.token.as_str(), format!("{token}/backends:cpu:"));
    }

    #[test]
    fn nodes_and_namespaces_are_mangled() {
        let token = |namespace| node(namespace).token().unwrap().as_str().to_owned();
        assert_eq!(token("/"), format!("@ros2_lv/7/{SESSION}/0/0/NN/%/%/laser_profiler"));
        assert_eq!(token("/a/b"), format!("@ros2_lv/7/{SESSION}/0/0/NN/%/%a%b/laser_profiler"));
    }

    #[test]
    fn quality_of_service_is_encoded_like_rmw_zenoh() {
        let text = |qos: QosProfile| wire_qos(&qos).encode();
        assert_eq!(text(QosProfile::reliable(10)), "::,10:,:,:,,");
        assert_eq!(text(QosProfile::latched(1)), ":1:,1:,:,:,,");
        assert_eq!(text(QosProfile::best_effort(0)), "2::,:,:,:,,");
        let all = QosProfile { history: History::KeepAll, ..QosProfile::reliable(3) };
        assert_eq!(text(all), "::2,:,:,:,,");
        let unset = QosTime { sec: 0, nsec: 0 };
        assert_eq!(text(QosProfile { deadline: unset, ..QosProfile::reliable(1) }), "::,1:,:,:,,");
        let timed = QosProfile { deadline: QosTime { sec: 1, nsec: 2 }, ..QosProfile::reliable(1) };
        assert_eq!(text(timed), "::,1:1,2:,:,,");
    }

    /// The published hash of the empty text is 99aa06d3014798d86001c324468d497f.
    #[test]
    fn identities_are_hashes_of_tokens_low_half_first() {
        let hash = XxHash3_128::oneshot(b"").to_le_bytes();
        assert_eq!(hash[..8], 0x6001_c324_468d_497f_u64.to_le_bytes());
        assert_eq!(hash[8..], 0x99aa_06d3_0147_98d8_u64.to_le_bytes());
        let (one, other) = (image(QosProfile::reliable(1)), image(QosProfile::reliable(2)));
        assert_ne!(one.id, other.id);
    }

    #[test]
    fn images_have_buffers() {
        assert!(has_buffer(sensor_msgs::Image::TYPE));
        assert!(has_buffer(sensor_msgs::CompressedImage::TYPE));
        assert!(!has_buffer(sensor_msgs::CameraInfo::TYPE));
        assert!(!has_buffer(std_msgs::Header::TYPE));
    }

    #[test]
    fn an_invalid_hash_is_rejected() {
        let qos = &QosProfile::reliable(1);
        let (kind, type_name) = (EndpointKind::Publisher, "a/msg/A");
        let endpoint = Endpoint { kind, name: "/a", type_name, hash: "none", qos };
        let keys = node("/").endpoint(1, &endpoint);
        assert!(keys.unwrap_err().to_string().contains("a/msg/A has an invalid type hash: none"));
    }
}
