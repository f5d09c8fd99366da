//! A thread that waits for Cyclone until it is dropped.
#![expect(unsafe_code, reason = "calls into Cyclone")]

use std::{
    ptr::null_mut,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
};

use cyclors::{
    DDS_ANY_STATE, dds_create_guardcondition, dds_create_readcondition, dds_create_waitset,
    dds_duration_t, dds_set_guardcondition, dds_waitset_attach, dds_waitset_wait,
};

use crate::{
    domain::Inner,
    entity::Entity,
    error::{Error, check},
};

struct Stop {
    is_set: AtomicBool,
    condition: Entity,
}

/// Handle of the thread. Dropping it waits until the thread has ended.
pub(crate) struct Worker {
    stop: Arc<Stop>,
    thread: Option<JoinHandle<()>>,
}

impl Worker {
    /// Starts a thread that calls `work` whenever one of the readers may have something to take. `work` takes one batch
    /// and returns true if there was one. The readers live as long as the thread.
    pub(crate) fn start(
        name: &str,
        inner: &Arc<Inner>,
        readers: Vec<Arc<Entity>>,
        mut work: impl FnMut() -> bool + Send + 'static,
    ) -> Result<Self, Error> {
        let operation = "wait for messages";
        let participant = inner.participant.handle();
        // SAFETY: creating entities takes any handle as parent.
        let (waitset, condition) =
            unsafe { (dds_create_waitset(participant), dds_create_guardcondition(participant)) };
        let waitset = Entity::own(operation, waitset)?;
        let condition = Entity::own(operation, condition)?;
        attach(&waitset, &condition)?;
        for reader in &readers {
            // SAFETY: as above. The condition is a child of the reader, and deleted with it.
            let arrived = unsafe { dds_create_readcondition(reader.handle(), DDS_ANY_STATE) };
            check(operation, arrived)?;
            // SAFETY: takes any handles.
            check(operation, unsafe { dds_waitset_attach(waitset.handle(), arrived, 0) })?;
        }
        let stop = Arc::new(Stop { is_set: AtomicBool::new(false), condition });
        let (stopped, domain) = (Arc::clone(&stop), Arc::clone(inner));
        let thread = thread::Builder::new().name(name.to_owned()).spawn(move || {
            // Stopping has priority, also where there is always something to take.
            while !stopped.is_set.load(Ordering::Acquire) {
                if !work() && !wait(&waitset) {
                    break;
                }
            }
            // In this order: all entities before their domain.
            drop((work, waitset, stopped, readers, domain));
        });
        let thread = thread.map_err(|error| Error::Refused {
            operation: "start a thread",
            reason: error.to_string(),
        })?;
        Ok(Self { stop, thread: Some(thread) })
    }
}

fn attach(waitset: &Entity, condition: &Entity) -> Result<(), Error> {
    // SAFETY: takes any handles.
    let attached = unsafe { dds_waitset_attach(waitset.handle(), condition.handle(), 0) };
    check("wait for messages", attached).map(drop)
}

fn wait(waitset: &Entity) -> bool {
    // SAFETY: takes any handle, and nothing is to be filled.
    let result = unsafe { dds_waitset_wait(waitset.handle(), null_mut(), 0, dds_duration_t::MAX) };
    if result < 0 {
        tracing::error!("waiting for DDS messages ends: {}", crate::error::text(result));
    }
    result >= 0
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.stop.is_set.store(true, Ordering::Release);
        // SAFETY: takes any handle.
        unsafe { dds_set_guardcondition(self.stop.condition.handle(), true) };
        let Some(thread) = self.thread.take() else { return };
        // A callback may drop this on its own thread, which cannot wait for itself.
        if thread.thread().id() != thread::current().id() && thread.join().is_err() {
            tracing::error!("a thread that receives DDS messages panicked");
        }
    }
}
