//! Handles viewer events. The server calls these handlers between messages, so they must not block.

use std::sync::{Arc, Weak};

use foxglove::websocket::{
    ChannelView, Client, PlaybackControlRequest, PlaybackState, ServerListener,
};

use super::server::ServerState;

/// Receives viewer events.
pub(super) struct Listener(pub(super) Weak<ServerState>);

impl Listener {
    fn shared(&self) -> Option<Arc<ServerState>> {
        self.0.upgrade()
    }
}

impl ServerListener for Listener {
    fn on_client_connect(&self) {
        if let Some(shared) = self.shared() {
            shared.publish_notes();
            shared.desk.on_viewer();
        }
    }

    fn on_subscribe(&self, client: Client, channel: ChannelView<'_>) {
        if let Some(shared) = self.shared() {
            shared.channels.resend(u64::from(channel.id()), client.sink_id());
            shared.desk.on_subscribe(channel.topic());
        }
    }

    fn on_connection_graph_subscribe(&self) {
        if let Some(shared) = self.shared() {
            shared.want_graph();
        }
    }

    fn on_playback_control_request(
        &self,
        request: PlaybackControlRequest,
    ) -> Option<PlaybackState> {
        self.shared()?.desk.control(&request)
    }
}
