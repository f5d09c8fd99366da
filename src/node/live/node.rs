//! The state shared by services, parameters and the lifecycle, and its operations.

use std::{
    sync::{Mutex, MutexGuard, PoisonError, Weak},
    time::Instant,
};

use super::{
    camera::{Camera, REPLY_TIMEOUT},
    error::LiveError,
    services::refusal,
    session::{CameraSummary, Session},
    setup::Context,
};
use crate::{
    node::{
        command::{Answer, Command, Reply},
        lifecycle::{Failure, Managed},
        live_recording::RecordingControl,
    },
    ros::{
        camera_params::CameraParams,
        node_params::NodeParams,
        parameters::{ParameterError, Parameters},
    },
};

/// A node on the middleware.
pub(super) struct NodeState {
    pub(super) context: Context,
    state: Mutex<State>,
}

struct State {
    /// Effective values; before configuration, those that will apply.
    values: Parameters,
    params: NodeParams,
    /// The session; present between configure and cleanup.
    session: Option<Session>,
    is_active: bool,
    /// Summaries of ended sessions, one per camera.
    summaries: Vec<CameraSummary>,
}

impl NodeState {
    /// # Errors
    /// The values contradict one another.
    pub(super) fn new(context: Context, values: Parameters) -> Result<Self, ParameterError> {
        let (values, params) = context.effective(values)?;
        let summaries = values.cameras().iter().map(|name| CameraSummary::new(name)).collect();
        let state = State { values, params, session: None, is_active: false, summaries };
        Ok(Self { context, state: Mutex::new(state) })
    }

    /// Locks the state. Every change under the lock is atomic, so the state is valid even after a panic.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn configure(&self) -> Result<(), LiveError> {
        let state = &mut *self.lock();
        state.session = Some(Session::configure(&self.context, &state.params, &state.values)?);
        Ok(())
    }

    /// Activates the cameras. If recording is enabled, it starts before the first frame.
    pub(super) fn activate(&self) -> Result<(), LiveError> {
        if self.lock().params.recording.enabled {
            self.start_recordings();
        }
        let state = &mut *self.lock();
        let Some(session) = &state.session else { return Ok(()) };
        let active = session.activate();
        state.is_active = active.is_ok();
        active
    }

    /// Starts recording. A disk error stops nothing else; it is logged and appears in the diagnostics.
    fn start_recordings(&self) {
        for recorder in self.recorders("") {
            if let Err(error) = recorder.start() {
                tracing::error!("{error}");
            }
        }
    }

    fn end_recordings(&self) {
        for recorder in self.recorders("") {
            if let Err(error) = recorder.stop() {
                tracing::error!("{error}");
            }
        }
    }

    /// Returns the recorders of the named camera, or of all cameras if the name is empty.
    pub(super) fn recorders(&self, camera: &str) -> Vec<RecordingControl> {
        let state = self.lock();
        let cameras = state.session.iter().flat_map(Session::cameras);
        let meant = cameras.filter(|of| camera.is_empty() || of.name == camera);
        meant.map(|of| of.recording.clone()).collect()
    }

    /// Returns the number of profiles at which a scan of the named camera ends.
    pub(super) fn scan_max_profiles(&self, camera: &str) -> u64 {
        let cameras = &self.lock().params.cameras;
        let found = cameras.iter().find(|params| params.name == camera);
        found.map_or(0, |params| params.scanner.scan_max_profiles.into())
    }

    /// Returns the configured cameras.
    pub(super) fn cameras(&self) -> Vec<Camera> {
        self.lock().session.iter().flat_map(Session::cameras).cloned().collect()
    }

    /// Ends the scans, then the recordings, so that every result is recorded.
    pub(super) fn deactivate(&self) {
        {
            let state = &mut *self.lock();
            state.is_active = false;
            if let Some(session) = &state.session {
                session.deactivate();
            }
        }
        self.end_recordings();
    }

    pub(super) fn cleanup(&self) {
        let session = {
            let state = &mut *self.lock();
            state.is_active = false;
            state.session.take()
        };
        // Without the lock, because queued frames are still measured and written.
        let summaries = session.map(Session::end).unwrap_or_default();
        let state = &mut *self.lock();
        for (sum, ended) in state.summaries.iter_mut().zip(summaries) {
            sum.add(ended);
        }
    }

    /// Applies new parameters from the next frame on, where they can change at run time.
    pub(super) fn set(&self, values: &Parameters) -> Result<(), String> {
        let (values, params) =
            self.context.effective(values.clone()).map_err(|error| error.to_string())?;
        let mut guard = self.lock();
        let state = &mut *guard;
        if state.session.is_some() {
            fixed_while_configured(&state.params, &params)?;
        }
        self.context.choose_time(&params).map_err(|error| error.to_string())?;
        if let Some(session) = &state.session {
            session.set(&params, &values);
        }
        let was_enabled = state.params.recording.enabled;
        let is_enabled = params.recording.enabled;
        let is_active = state.is_active;
        (state.values, state.params) = (values, params);
        drop(guard);
        // Without the lock, because a disk may be slow.
        match (was_enabled, is_enabled) {
            (false, true) if is_active => self.start_recordings(),
            (true, false) if is_active => self.end_recordings(),
            _ => {}
        }
        Ok(())
    }

    /// Sends a command to the named camera, or to all of them.
    pub(super) fn order(&self, camera: &str, command: impl Fn(Reply) -> Command) -> Answer {
        let cameras: Vec<Camera> = {
            let state = self.lock();
            let Some(session) = state.session.as_ref().filter(|_| state.is_active) else {
                return refusal("the node is not active: activate it first");
            };
            let meant = |of: &&Camera| camera.is_empty() || of.name == camera;
            session.cameras().iter().filter(meant).cloned().collect()
        };
        // Without the lock, because a worker answers between two frames.
        let ordered: Vec<_> = cameras.iter().map(|of| of.order(&command)).collect();
        let deadline = Instant::now() + REPLY_TIMEOUT;
        let late = || refusal("the camera is busy: no reply within a second");
        let answers: Vec<_> = ordered
            .into_iter()
            .map(|ordered| ordered.answer(deadline).unwrap_or_else(late))
            .collect();
        let failed = answers.iter().find(|answer| !answer.success);
        failed.or(answers.first()).cloned().unwrap_or_else(|| refusal("there is no camera"))
    }

    /// True if a camera ended by itself.
    pub(super) fn has_failed(&self) -> bool {
        self.lock().session.as_ref().is_some_and(Session::has_failed)
    }

    /// Returns the summaries of all sessions, one per camera.
    pub(super) fn take_summaries(&self) -> Vec<CameraSummary> {
        std::mem::take(&mut self.lock().summaries)
    }
}

/// Refuses changes that need another subscription or another geometry.
fn fixed_while_configured(old: &NodeParams, new: &NodeParams) -> Result<(), String> {
    for (old, new) in old.cameras.iter().zip(&new.cameras) {
        let changed = [
            ("image_transport", old.image_transport != new.image_transport),
            ("calibration_file", old.calibration_file != new.calibration_file),
            ("extraction.background_file", old.background_file != new.background_file),
            ("motion.source", is_other_source(old, new)),
            ("motion.joint", old.moved.joint != new.moved.joint),
            ("motion.axis", old.scanner.motion.axis != new.scanner.motion.axis),
            ("motion.part_frame", old.moved.part_frame != new.moved.part_frame),
            ("motion.sensor_frame", old.moved.sensor_frame != new.moved.sensor_frame),
            ("max_frame_bytes", old.max_frame_bytes != new.max_frame_bytes),
        ];
        if let Some((name, _)) = changed.iter().find(|(_, is_changed)| *is_changed) {
            return Err(format!(
                "{} changes only while the node is unconfigured: clean it up first",
                new.full_name(name)
            ));
        }
    }
    Ok(())
}

/// True if the source of positions changes and either source is measured.
fn is_other_source(old: &CameraParams, new: &CameraParams) -> bool {
    let [old, new] = [old, new].map(|camera| camera.scanner.motion.source);
    old != new && (old.is_measured() || new.is_measured())
}

/// The node as the lifecycle's [`Managed`].
pub(super) struct Handle(pub(super) Weak<NodeState>);

impl Handle {
    fn with<T>(&self, act: impl FnOnce(&NodeState) -> Result<T, LiveError>) -> Result<T, Failure> {
        let node = self.0.upgrade().ok_or_else(|| Failure("the node has ended".to_owned()))?;
        act(&node).map_err(|error| Failure(error.to_string()))
    }
}

impl Managed for Handle {
    fn configure(&self) -> Result<(), Failure> {
        self.with(NodeState::configure)
    }

    fn activate(&self) -> Result<(), Failure> {
        self.with(NodeState::activate)
    }

    fn deactivate(&self) -> Result<(), Failure> {
        self.with(|node| {
            node.deactivate();
            Ok(())
        })
    }

    fn cleanup(&self) -> Result<(), Failure> {
        self.with(|node| {
            node.cleanup();
            Ok(())
        })
    }

    fn shutdown(&self) -> Result<(), Failure> {
        self.cleanup()
    }
}
