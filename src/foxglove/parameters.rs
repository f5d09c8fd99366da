//! The Parameters panel: requests in their order, on a thread that may wait for the node.

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

/// Requests that may wait: a slider that is dragged sends some sixty a second.
const MAX_WAITING: usize = 256;

/// Takes requests.
pub(super) struct Parameters(SyncSender<Request>);

enum Request {
    Get(Vec<String>, GetParametersResponder),
    Set(Vec<Parameter>, AnyClient, SetParametersResponder),
}

impl Parameters {
    /// Starts the thread that answers; it ends with the last of the senders.
    pub(super) fn start(shared: Weak<ServerState>) -> io::Result<Self> {
        let (sender, requests) = sync_channel(MAX_WAITING);
        thread::Builder::new()
            .name("view parameters".to_owned())
            .spawn(move || answer_all(&requests, &shared))?;
        Ok(Self(sender))
    }

    /// Queues a request; replies with an error if the queue is full.
    fn ask(&self, client: &AnyClient, request: Request) {
        if let Err(unasked) = self.0.try_send(request) {
            client.send_error(format!("{MAX_WAITING} requests are already queued: try again"));
            drop(unasked);
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
        self.ask(&client, Request::Get(names, responder));
    }

    fn set(
        &self,
        client: AnyClient,
        parameters: Vec<Parameter>,
        _request_id: Option<String>,
        responder: SetParametersResponder,
    ) {
        let asker = client.clone();
        self.ask(&client, Request::Set(parameters, asker, responder));
    }
}

fn answer_all(requests: &Receiver<Request>, shared: &Weak<ServerState>) {
    for request in requests {
        let Some(shared) = shared.upgrade() else { return };
        match request {
            Request::Get(names, responder) => responder.respond(shared.desk.parameters(&names)),
            Request::Set(wishes, client, responder) => {
                let names: Vec<_> = wishes.iter().map(|wish| wish.name.clone()).collect();
                for reason in shared.desk.set_parameters(wishes) {
                    client.send_error(reason);
                }
                // What is in force, accepted or not: a panel must not show what was refused.
                let in_force = shared.desk.parameters(&names);
                responder.respond(in_force.clone());
                shared.publish_parameters(in_force);
            }
        }
    }
}
