//! The action `~/scan`: a scan with limits, its progress and its result, beside the services that start and stop scans.
//!
//! `goals` keeps the goals and their results, `goal` checks and follows one of them, `recordings` keeps its files. A response to a goal has no room for
//! a reason, so refusals are logged.

mod goal;
mod goals;
mod recorded;
mod recordings;

use std::{
    sync::{Arc, Mutex, MutexGuard, PoisonError, Weak},
    thread::{self, JoinHandle},
    time::Instant,
};

use super::{error::LiveError, node::NodeState};
use crate::{
    msg::{
        action_msgs::{
            CANCEL_GOAL, CancelGoalRequest, CancelGoalResponse, GoalInfo, GoalStatusArray, cancel,
            status,
        },
        builtin_interfaces::Time,
        cdr,
        laser_profiler_msgs::scan::{
            self, FeedbackMessage, GetResultRequest, GetResultResponse, SendGoalRequest,
            SendGoalResponse,
        },
        qos::QosProfile,
        schema::Message,
    },
    node::{
        clock::RosClock,
        command::Command,
        endpoints::{self, answer},
        scan_watch::ScanWatch,
        topics::of_camera,
        watch::Watch,
    },
    ros::{
        names::NodeNames,
        transport::{OnRequest, Publication, Responder, Server, ServiceEndpoint, Transport},
    },
};
use goal::Plan;
use goals::{Goals, Waiting};

/// The action of one camera. Dropping it ends its goal and removes it from the graph.
pub(super) struct ScanAction {
    // Dropped after the goals have ended, so that their results are sent.
    servers: Vec<Box<dyn Server>>,
    shared: Arc<ActionState>,
}

/// The parts of the node that the action uses.
pub(super) struct ActionContext<'a> {
    pub(super) names: &'a NodeNames,
    pub(super) node: &'a Weak<NodeState>,
    pub(super) clock: &'a RosClock,
    pub(super) watch: &'a Watch,
}

struct ActionState {
    node: Weak<NodeState>,
    /// Name of the camera; empty for the only one.
    camera: String,
    clock: RosClock,
    watch: Watch,
    goals: Mutex<Goals>,
    /// Progress of the last goal's scan.
    scan: Mutex<ScanWatch>,
    /// Follows the active goal.
    follower: Mutex<Option<JoinHandle<()>>>,
    feedback: Mutex<Box<dyn Publication>>,
    /// Locked before the goals, so that the states are published in order.
    status: Mutex<Box<dyn Publication>>,
}

impl ScanAction {
    /// Offers the action of a camera.
    ///
    /// # Errors
    /// The middleware rejects a service or topic, or a remap rule gives one a name that ROS does not allow.
    pub(super) fn offer(
        transport: &dyn Transport,
        context: &ActionContext<'_>,
        camera: &str,
    ) -> Result<Self, LiveError> {
        let ActionContext { names, node, clock, watch } = *context;
        let name = |part: &str| of_camera(camera, &format!("~/scan/_action/{part}"));
        let feedback = endpoints::advertise::<FeedbackMessage>(
            transport,
            names,
            &name("feedback"),
            QosProfile::reliable(10),
        )?;
        let status = endpoints::advertise::<GoalStatusArray>(
            transport,
            names,
            &name("status"),
            QosProfile::latched(1),
        )?;
        let shared = Arc::new(ActionState {
            node: node.clone(),
            camera: camera.to_owned(),
            clock: clock.clone(),
            watch: watch.clone(),
            goals: Mutex::default(),
            scan: Mutex::default(),
            follower: Mutex::default(),
            feedback: Mutex::new(feedback),
            status: Mutex::new(status),
        });
        let mut servers = Vec::new();
        let (sending, canceling, asking) =
            (Arc::clone(&shared), Arc::clone(&shared), Arc::clone(&shared));
        let at_once: [(_, _, OnRequest); 2] = [
            ("send_goal", &scan::SEND_GOAL, Box::new(move |request| sending.send_goal(request))),
            ("cancel_goal", &CANCEL_GOAL, Box::new(move |request| canceling.cancel(request))),
        ];
        for (part, kind, on_request) in at_once {
            servers.push(endpoints::serve(transport, names, &name(part), kind, on_request)?);
        }
        let get_result =
            ServiceEndpoint { name: names.resolve(&name("get_result"))?, kind: &scan::GET_RESULT };
        let on_request = move |request: &[u8], responder| asking.get_result(request, responder);
        servers.push(transport.serve_late(&get_result, Box::new(on_request))?);
        Ok(Self { servers, shared })
    }
}

impl Drop for ScanAction {
    fn drop(&mut self) {
        self.shared.goals().close();
        // The worker has ended, and with it the scan.
        if let Some(follower) = lock(&self.shared.follower).take() {
            drop(follower.join());
        }
        self.servers.clear();
    }
}

impl ActionState {
    fn goals(&self) -> MutexGuard<'_, Goals> {
        lock(&self.goals)
    }

    fn now(&self) -> Time {
        Time::from_ns(self.clock.now_ns())
    }

    fn send_goal(self: &Arc<Self>, request: &[u8]) -> Option<Vec<u8>> {
        let request: SendGoalRequest<'_> = cdr::decode(request).ok()?;
        let info = GoalInfo { goal_id: request.goal_id, stamp: self.now() };
        let begun = self.begin(info, &request);
        if let Err(reason) = &begun {
            tracing::warn!("~/scan: a goal is rejected: {reason}");
        }
        answer(&SendGoalResponse { accepted: begun.is_ok(), stamp: info.stamp })
    }

    /// Starts a goal. `Err`: the reason to reject it.
    fn begin(
        self: &Arc<Self>,
        info: GoalInfo,
        request: &SendGoalRequest<'_>,
    ) -> Result<(), String> {
        let node = self.node.upgrade().ok_or("the node is shutting down")?;
        let scan = ScanWatch::default();
        // Two requests at a time may come on two threads.
        self.goals().reserve(info.goal_id)?;
        let begun = goal::request(&node, &self.camera, &request.goal, scan.clone())
            .and_then(|scan_request| Plan::begin(&node, &self.camera, scan_request, &request.goal));
        let plan = match begun {
            Ok(plan) => plan,
            Err(reason) => {
                self.goals().release();
                return Err(reason);
            }
        };
        *lock(&self.scan) = scan.clone();
        self.goals().begin(info);
        self.publish_status();
        let following = Arc::clone(self);
        let follow = move || {
            let _guard = following.watch.guard("the thread of ~/scan");
            goal::follow(&following, info, &scan, &plan);
        };
        match thread::Builder::new().name("scan action".to_owned()).spawn(follow) {
            Ok(thread) => {
                // The one before has ended: there is one goal at a time.
                *lock(&self.follower) = Some(thread);
                Ok(())
            }
            Err(error) => {
                self.stop_scan();
                self.finish(info, status::ABORTED, GetResultResponse::default());
                Err(format!("cannot start a thread: {error}"))
            }
        }
    }

    /// Ends the scan of the active goal, unless it has ended: then another one may run.
    fn stop_scan(&self) {
        if lock(&self.scan).has_ended() {
            return;
        }
        let Some(node) = self.node.upgrade() else { return };
        // A busy worker stops later; one that has ended has stopped.
        let answer = node.order(&self.camera, Command::StopScan);
        if !answer.success {
            tracing::warn!("~/scan: the scan does not end at once: {}", answer.message);
        }
    }

    fn cancel(&self, request: &[u8]) -> Option<Vec<u8>> {
        let CancelGoalRequest { goal_info } = cdr::decode(request).ok()?;
        let response = self.goals().cancel(goal_info);
        if response.return_code == cancel::NONE && !response.goals_canceling.is_empty() {
            self.publish_status();
            // Ends the scan, which wakes who follows it.
            self.stop_scan();
        }
        answer::<CancelGoalResponse>(&response)
    }

    fn get_result(&self, request: &[u8], responder: Responder) {
        let Ok(GetResultRequest { goal_id }) = cdr::decode(request) else {
            return responder.respond(None);
        };
        let waiting = self.goals().result(goal_id, Instant::now(), responder);
        match waiting {
            Waiting::Until => {}
            Waiting::No(responder, result) => responder.respond(Some(result)),
            Waiting::Unknown(responder) => {
                let unknown = GetResultResponse { status: status::UNKNOWN, ..Default::default() };
                responder.respond(answer(&unknown));
            }
        }
    }

    /// Notes the result of a goal, publishes its state and answers who waits.
    fn finish(&self, info: GoalInfo, state: i8, result: GetResultResponse<'_>) {
        let result = GetResultResponse { status: state, ..result };
        let bytes = answer(&result).unwrap_or_default();
        let waiting = self.goals().finish(info.goal_id, state, bytes.clone(), Instant::now());
        self.publish_status();
        for responder in waiting {
            responder.respond(Some(bytes.clone()));
        }
    }

    fn publish_status(&self) {
        let publication = &mut **lock(&self.status);
        let status = GoalStatusArray { status_list: self.goals().statuses(Instant::now()) };
        self.send(publication, &status);
    }

    fn send<M: Message>(&self, publication: &mut dyn Publication, message: &M) {
        if let Err(error) = endpoints::send(publication, message, self.clock.now_ns()) {
            tracing::warn!("~/scan: {error}");
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
