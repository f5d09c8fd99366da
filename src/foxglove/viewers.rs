//! The connected viewers.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
};

use tokio_tungstenite::tungstenite::Message;

use super::{
    access::Rights,
    outbox::Outbox,
    protocol::{Level, Parameter, Reply},
};

/// A connected viewer.
pub(super) struct Viewer {
    pub(super) id: u64,
    pub(super) rights: Rights,
    pub(super) outbox: Outbox,
    /// Topics by the viewer's number of the subscription.
    pub(super) subscriptions: Mutex<BTreeMap<u32, u64>>,
    /// Parameters whose changes it is told.
    pub(super) watched: Mutex<BTreeSet<String>>,
    pub(super) wants_graph: AtomicBool,
}

impl Viewer {
    /// Sends a text.
    pub(super) fn tell(&self, reply: &Reply<'_>) {
        self.outbox.push(Message::text(reply.encode()));
    }

    /// Reports that a request failed.
    pub(super) fn fail(&self, reason: &str) {
        self.tell(&Reply::Status { level: Level::Error as u8, message: reason, id: None });
    }

    /// Reports the values of parameters that it watches.
    pub(super) fn tell_watched(&self, parameters: &[Parameter]) {
        let watched = lock(&self.watched);
        let parameters: Vec<_> =
            parameters.iter().filter(|it| watched.contains(&it.name)).collect();
        drop(watched);
        if !parameters.is_empty() {
            self.tell(&Reply::ParameterValues { parameters, id: None });
        }
    }
}

/// All connected viewers.
#[derive(Default)]
pub(super) struct Viewers {
    by_id: Mutex<BTreeMap<u64, Arc<Viewer>>>,
    num_connected: AtomicU64,
    is_closed: AtomicBool,
}

impl Viewers {
    /// Adds a viewer with these rights.
    pub(super) fn add(&self, rights: Rights) -> Arc<Viewer> {
        let id = self.num_connected.fetch_add(1, Ordering::Relaxed);
        let viewer = Arc::new(Viewer {
            id,
            rights,
            outbox: Outbox::default(),
            subscriptions: Mutex::default(),
            watched: Mutex::default(),
            wants_graph: AtomicBool::new(false),
        });
        lock(&self.by_id).insert(id, Arc::clone(&viewer));
        if self.is_closed.load(Ordering::SeqCst) {
            viewer.outbox.close();
        }
        viewer
    }

    /// Removes a viewer.
    pub(super) fn remove(&self, id: u64) {
        lock(&self.by_id).remove(&id);
    }

    /// Number of viewers.
    pub(super) fn len(&self) -> usize {
        lock(&self.by_id).len()
    }

    /// Returns all viewers.
    pub(super) fn all(&self) -> Vec<Arc<Viewer>> {
        lock(&self.by_id).values().cloned().collect()
    }

    /// Sends a text to all.
    pub(super) fn tell(&self, reply: &Reply<'_>) {
        self.send(&Message::text(reply.encode()));
    }

    /// Sends a message to all.
    pub(super) fn send(&self, message: &Message) {
        for viewer in self.all() {
            viewer.outbox.push(message.clone());
        }
    }

    /// Disconnects all, after what they wait for.
    pub(super) fn close(&self) {
        self.is_closed.store(true, Ordering::SeqCst);
        self.all().iter().for_each(|viewer| viewer.outbox.close());
    }
}

pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
