//! A participant in a domain.
#![expect(unsafe_code, reason = "calls into Cyclone")]

use std::{
    collections::BTreeSet,
    ffi::CString,
    ptr::null,
    sync::{Arc, Mutex, PoisonError},
};

use cyclors::{dds_create_domain, dds_create_participant};

use crate::{
    config::{Config, Interfaces},
    discovery::{Discovery, RemoteEndpoint, Watch},
    entity::{Entity, Guid},
    error::{Error, text},
    log,
    qos::{Policies, Qos},
    reader::{Reader, Received},
    sockets::Sockets,
    writer::Writer,
};

/// Highest number of a domain on the network. Numbers above it are only used within this process.
const MAX_DOMAIN_ID: u32 = 232;

/// Numbers of domains that this process has joined, and a lock on joining and leaving.
static JOINED: Mutex<BTreeSet<u32>> = Mutex::new(BTreeSet::new());

/// A domain with one participant. In this order they are deleted.
pub(crate) struct Inner {
    pub(crate) participant: Entity,
    _domain: Joined,
    pub(crate) max_sample_bytes: usize,
}

struct Joined {
    id: u32,
    entity: Option<Entity>,
}

impl Drop for Joined {
    fn drop(&mut self) {
        let mut joined = JOINED.lock().unwrap_or_else(PoisonError::into_inner);
        drop(self.entity.take());
        joined.remove(&self.id);
    }
}

/// A participant in a DDS domain. Readers and writers keep the domain joined, but their discovery ends with this.
pub struct Domain {
    watch: Watch,
    guid: Guid,
    receive_buffer_bytes: Option<usize>,
    inner: Arc<Inner>,
}

impl Domain {
    /// Joins a domain. Several participants of one process may join the same domain, each with its own configuration
    /// and sockets. `user_data` are seen by others in discovery of this participant. `on_discovery` is called on a
    /// thread of the domain when other participants and their endpoints appear, change and go; it must not block.
    ///
    /// # Errors
    /// Cyclone refuses the configuration, or finds no network or no free port; with its own reason.
    pub fn join(
        config: &Config,
        user_data: &[u8],
        on_discovery: impl FnMut(&Discovery) + Send + 'static,
    ) -> Result<Self, Error> {
        log::redirect();
        let failed = |reason| Error::Join { domain_id: config.domain_id, reason };
        let (domain, sockets) = open(config).map_err(failed)?;
        let receive_buffer_bytes = sockets.receive_buffer_bytes();
        let id = domain.id;
        let policies =
            Policies::of_participant(user_data).ok_or_else(|| failed("no memory".to_owned()))?;
        // SAFETY: the policies live through the call; there is no listener.
        let created = unsafe { dds_create_participant(id, policies.as_ptr(), null()) };
        let participant = Entity::own("create a participant", created)?;
        let guid = participant.guid()?;
        let max_sample_bytes = config.max_sample_bytes as usize;
        let inner = Arc::new(Inner { participant, _domain: domain, max_sample_bytes });
        let watch = Watch::start(&inner, guid, on_discovery)?;
        Ok(Self { watch, guid, receive_buffer_bytes, inner })
    }

    /// Creates a writer. Names are those of DDS.
    ///
    /// # Errors
    /// Cyclone refuses the names or the quality of service.
    pub fn writer(&self, topic: &str, type_name: &str, qos: &Qos) -> Result<Writer, Error> {
        Writer::open(&self.inner, topic, type_name, qos)
    }

    /// Creates a reader of `[topic, type]`, named as on DDS. Messages above `limit_bytes` are reported by their length.
    /// `on_received` is called on a thread of the reader; while it runs, the reader stores what its history allows.
    ///
    /// # Errors
    /// Cyclone refuses the names or the quality of service; the system cannot start a thread.
    pub fn reader(
        &self,
        topic: [&str; 2],
        qos: &Qos,
        limit_bytes: usize,
        on_received: impl FnMut(Received) + Send + 'static,
    ) -> Result<Reader, Error> {
        Reader::open(&self.inner, topic, qos, limit_bytes, on_received)
    }

    /// Identity of the participant.
    pub const fn guid(&self) -> Guid {
        self.guid
    }

    /// Returns the endpoints of other participants, in order of their identities.
    pub fn endpoints(&self) -> Vec<RemoteEndpoint> {
        self.watch.endpoints()
    }

    /// Returns the smallest receive buffer that the kernel granted to one of the domain's sockets, bytes; `None` if it
    /// cannot be read on this system.
    pub const fn receive_buffer_bytes(&self) -> Option<usize> {
        self.receive_buffer_bytes
    }
}

/// Creates the domain. Its number in this process is that on the network, unless this process has joined it already.
fn open(config: &Config) -> Result<(Joined, Sockets), String> {
    let mut joined = JOINED.lock().unwrap_or_else(PoisonError::into_inner);
    let others = MAX_DOMAIN_ID + 1..u32::MAX;
    let ids = std::iter::once(config.domain_id).chain(others);
    let id = ids.into_iter().find(|id| !joined.contains(id)).ok_or("too many domains")?;
    let external_id = (id != config.domain_id).then_some(config.domain_id);
    let xml = CString::new(config.xml(external_id)).map_err(|error| error.to_string())?;
    let before = Sockets::open();
    // SAFETY: the configuration lives through the call.
    let (created, lines) = log::listen(|| unsafe { dds_create_domain(id, xml.as_ptr()) });
    if created < 0 {
        return Err(lines.into_iter().chain([text(created)]).collect::<Vec<_>>().join("; "));
    }
    let entity = Entity::own("create a domain", created).map_err(|error| error.to_string())?;
    let sockets = Sockets::open().without(&before);
    if config.interfaces == Interfaces::Loopback {
        sockets.bind_to_loopback()?;
    }
    joined.insert(id);
    Ok((Joined { id, entity: Some(entity) }, sockets))
}
