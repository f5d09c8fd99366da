//! The Parameters panel. A separate thread handles its requests in order and may wait for the node.

use std::{
    io,
    sync::{
        Weak,
        mpsc::{Receiver, SyncSender, sync_channel},
    },
    thread,
};

use foxglove::websocket::{
    AnyClient, GetParametersResponder, Parameter, ParameterHandler, SetParametersResponder,
};

use super::server::ServerState;

/// Maximum number of queued requests. Dragging a slider sends about sixty per second.
const MAX_WAITING: usize = 256;

/// Queue of the panel's requests.
pub(super) struct Parameters(SyncSender<Request>);

enum Request {
    Get(Vec<String>, GetParametersResponder),
    Set(Vec<Parameter>, AnyClient, SetParametersResponder),
}

impl Parameters {
    /// Starts the thread that handles requests. It ends when the last sender is dropped.
    pub(super) fn start(shared: Weak<ServerState>) -> io::Result<Self> {
        let (sender, requests) = sync_channel(MAX_WAITING);
        thread::Builder::new()
            .name("view parameters".to_owned())
            .spawn(move || answer_all(&requests, &shared))?;
        Ok(Self(sender))
    }

    /// Queues a request; replies with an error if the queue is full.
    fn enqueue(&self, client: &AnyClient, request: Request) {
        if let Err(rejected) = self.0.try_send(request) {
            client.send_error(format!("{MAX_WAITING} requests are already queued: try again"));
            drop(rejected);
        }
    }
}

impl ParameterHandler for Parameters {
    fn get(
        &self,
        client: AnyClient,
        names: Vec<String>,
        _request_id: Option<String>,
        responder: GetParametersResponder,
    ) {
        self.enqueue(&client, Request::Get(names, responder));
    }

    fn set(
        &self,
        client: AnyClient,
        parameters: Vec<Parameter>,
        _request_id: Option<String>,
        responder: SetParametersResponder,
    ) {
        let requester = client.clone();
        self.enqueue(&client, Request::Set(parameters, requester, responder));
    }
}

fn answer_all(requests: &Receiver<Request>, shared: &Weak<ServerState>) {
    for request in requests {
        let Some(shared) = shared.upgrade() else { return };
        match request {
            Request::Get(names, responder) => responder.respond(shared.desk.parameters(&names)),
            Request::Set(parameters, client, responder) => {
                let names: Vec<_> = parameters.iter().map(|it| it.name.clone()).collect();
                for reason in shared.desk.set_parameters(parameters) {
                    client.send_error(reason);
                }
                // The reply holds the current values, because a panel must not show refused ones.
                let in_force = shared.desk.parameters(&names);
                responder.respond(in_force.clone());
                shared.publish_parameters(in_force);
            }
        }
    }
}
