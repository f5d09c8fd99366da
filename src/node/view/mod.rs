//! The live view: serves the node's results and images to Foxglove.
//!
//! A [`replay`] view plays a recording and measures it with the parameters that viewers set. For a live node,
//! `transport` serves the traffic between the node and its middleware.

mod camera;
mod desk;
mod lanes;
mod playback;
mod player;
mod recording;
pub(crate) mod replay;
pub(crate) mod live;
mod transport;

pub(crate) use crate::foxglove::{Address, Entrance, TlsFiles, Token, ViewError};

use std::sync::Arc;

use crate::{
    bag::Topic,
    foxglove::{Channel, ChannelDescription, Server},
    msg::{qos::Durability, schema::MessageType},
    ros::transport::TopicEndpoint,
};

/// Maximum number of messages of a recorded latched topic that late viewers receive; every publisher of `/tf_static`
/// sends its own.
const MAX_LATCHED: usize = 64;

/// Display of the camera's images.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Images {
    /// Full images on their own topic.
    Full,
    /// Small images at 15 Hz at most on `~/preview`, with their centrelines on `~/preview_annotations`.
    #[default]
    Preview,
    /// No images.
    None,
}

impl Images {
    /// Names of all variants.
    pub(crate) const NAMES: [&str; 3] = ["full", "preview", "none"];

    /// Returns the variant of that name.
    pub(crate) fn from_name(name: &str) -> Option<Self> {
        [Self::Full, Self::Preview, Self::None]
            .into_iter()
            .zip(Self::NAMES)
            .find_map(|(images, known)| (known == name).then_some(images))
    }
}

/// Options of the view.
#[derive(Clone, Debug)]
pub(crate) struct ViewRequest {
    /// Where viewers come in.
    pub(crate) entrance: Entrance,
    /// Display of images.
    pub(crate) images: Images,
}

/// Serves a topic of the node.
fn serve(server: &Server, topic: &TopicEndpoint) -> Result<Arc<Channel>, ViewError> {
    let is_latched = topic.qos.durability == Durability::TransientLocal;
    serve_type(server, &topic.name, topic.kind, usize::from(is_latched))
}

fn serve_type(
    server: &Server,
    name: &str,
    kind: &MessageType,
    num_kept: usize,
) -> Result<Arc<Channel>, ViewError> {
    server.open(ChannelDescription {
        name: name.to_owned(),
        type_name: kind.name.to_owned(),
        schema: kind.schema().into_bytes(),
        num_kept,
    })
}

/// Serves a topic of a recording.
fn serve_recorded(server: &Server, topic: &Topic) -> Result<Arc<Channel>, ViewError> {
    server.open(ChannelDescription {
        name: topic.name.clone(),
        type_name: topic.type_name.clone(),
        schema: topic.schema.clone(),
        num_kept: if topic.is_latched() { MAX_LATCHED } else { 0 },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_gives_its_variant() {
        let all = Images::NAMES.map(|name| Images::from_name(name).unwrap());
        assert_eq!(all, [Images::Full, Images::Preview, Images::None]);
        assert_eq!(Images::from_name("small"), None);
    }
}
