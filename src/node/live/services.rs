//! The node's own services for scans and recordings: one set for all cameras, and one set for each of several cameras.

use std::{borrow::Cow, path::PathBuf, sync::Weak};

use super::node::NodeState;
use crate::{
    msg::{
        cdr,
        laser_profiler_msgs::{START_SCAN, StartScanRequest, StartScanResponse},
        schema::{Message, ServiceType},
        std_srvs::{
            SET_BOOL, SetBoolRequest, SetBoolResponse, TRIGGER, TriggerRequest, TriggerResponse,
        },
        unique_identifier_msgs::Uuid,
    },
    node::{
        command::{Answer, Command, Reply, ScanRequest},
        live_recording::{BagStatus, RecordingControl, RecordingError},
        topics::of_camera,
    },
    ros::{
        names::NodeNames,
        transport::{OnRequest, Server, ServiceEndpoint, Transport},
    },
};

use super::error::LiveError;

/// Creates the services; they last until the returned servers are dropped.
pub(super) fn offer(
    transport: &dyn Transport,
    names: &NodeNames,
    node: &Weak<NodeState>,
    cameras: &[String],
) -> Result<Vec<Box<dyn Server>>, LiveError> {
    let mut servers = Vec::new();
    // First all cameras together, then each by its name; a single camera has no name.
    let named = cameras.iter().map(String::as_str).filter(|name| !name.is_empty());
    for camera in std::iter::once("").chain(named) {
        let of = |node: &Weak<NodeState>| Target { node: node.clone(), camera: camera.to_owned() };
        let offered: [(&str, &'static ServiceType, OnRequest); 6] = [
            ("~/start_scan", &TRIGGER, trigger(of(node), start)),
            ("~/stop_scan", &TRIGGER, trigger(of(node), Command::StopScan)),
            ("~/reset", &TRIGGER, trigger(of(node), Command::Reset)),
            ("~/scan", &START_SCAN, scan(of(node))),
            ("~/record", &SET_BOOL, record(of(node))),
            ("~/snapshot", &TRIGGER, snapshot(of(node))),
        ];
        for (name, kind, on_request) in offered {
            let name = names.resolve(&of_camera(camera, name))?;
            servers.push(transport.serve(&ServiceEndpoint { name, kind }, on_request)?);
        }
    }
    Ok(servers)
}

/// Outcome of a service that acts on recorders.
struct RecordingAnswer {
    success: bool,
    /// One line about all recorders.
    message: String,
}

/// The cameras that a service addresses.
struct Target {
    node: Weak<NodeState>,
    /// Name of the camera; empty for every camera.
    camera: String,
}

impl Target {
    fn order(&self, command: impl Fn(Reply) -> Command) -> Answer {
        self.node.upgrade().map_or_else(
            || refusal("the node is shutting down"),
            |node| node.order(&self.camera, command),
        )
    }
}

impl Target {
    /// Calls `act` on the recorders of the addressed cameras. Succeeds if all of them do.
    fn of_recorders(
        &self,
        act: impl Fn(&RecordingControl) -> Result<Vec<String>, RecordingError>,
    ) -> RecordingAnswer {
        let refusal =
            |message: &str| RecordingAnswer { success: false, message: message.to_owned() };
        let Some(node) = self.node.upgrade() else {
            return refusal("the node is shutting down");
        };
        let recorders = node.recorders(&self.camera);
        if recorders.is_empty() {
            return refusal("the node is not configured: configure it first");
        }
        let (mut success, mut lines) = (true, Vec::new());
        for recorder in &recorders {
            match act(recorder) {
                Ok(done) => lines.extend(done),
                Err(error) => {
                    success = false;
                    lines.push(error.to_string());
                }
            }
        }
        if lines.is_empty() {
            lines.push("nothing was being recorded".to_owned());
        }
        RecordingAnswer { success, message: lines.join(", ") }
    }
}

pub(super) fn refusal(message: impl Into<String>) -> Answer {
    Answer { success: false, message: message.into(), scan_id: None }
}

fn start(reply: Reply) -> Command {
    Command::StartScan(ScanRequest::default(), reply)
}

fn trigger(target: Target, command: fn(Reply) -> Command) -> OnRequest {
    Box::new(move |request| {
        cdr::decode::<TriggerRequest>(request).ok()?;
        let Answer { success, message, .. } = target.order(command);
        encoded(&TriggerResponse { success, message: Cow::Owned(message) })
    })
}

fn record(target: Target) -> OnRequest {
    Box::new(move |request| {
        let SetBoolRequest { data } = cdr::decode(request).ok()?;
        let RecordingAnswer { success, message } = target.of_recorders(|recorder| {
            if data {
                recorder.start().map(|bags| paths(&bags))
            } else {
                recorder.stop().map(ended)
            }
        });
        encoded(&SetBoolResponse { success, message: Cow::Owned(message) })
    })
}

fn snapshot(target: Target) -> OnRequest {
    Box::new(move |request| {
        cdr::decode::<TriggerRequest>(request).ok()?;
        let RecordingAnswer { success, message } =
            target.of_recorders(|recorder| recorder.snapshot().map(|bags| paths(&bags)));
        encoded(&TriggerResponse { success, message: Cow::Owned(message) })
    })
}

fn paths(directories: &[PathBuf]) -> Vec<String> {
    directories.iter().map(|directory| directory.display().to_string()).collect()
}

fn ended(bags: Vec<BagStatus>) -> Vec<String> {
    let directories: Vec<_> = bags.into_iter().filter_map(|bag| bag.directory).collect();
    paths(&directories)
}

fn scan(target: Target) -> OnRequest {
    Box::new(move |request| {
        let request: StartScanRequest<'_> = cdr::decode(request).ok()?;
        let length_m = request.length;
        let answer = if length_m.is_finite() && length_m >= 0.0 {
            let part_id = request.part_id.into_owned();
            let length_m = (length_m > 0.0).then_some(length_m);
            let request = ScanRequest { part_id, length_m, ..ScanRequest::default() };
            target.order(|reply| Command::StartScan(request.clone(), reply))
        } else {
            refusal(format!("length is {length_m} m, but must be 0 (until stopped) or more"))
        };
        encoded(&StartScanResponse {
            success: answer.success,
            message: Cow::Owned(answer.message),
            scan_id: Uuid { uuid: answer.scan_id.unwrap_or_default() },
        })
    })
}

fn encoded(response: &impl Message) -> Option<Vec<u8>> {
    let mut data = Vec::new();
    cdr::encode(response, &mut data).ok()?;
    Some(data)
}
