//! Other participants and their endpoints, from the topics on which Cyclone tells what it discovers.
#![expect(unsafe_code, reason = "calls into Cyclone")]

use std::{
    collections::BTreeMap,
    ffi::{CStr, c_char},
    mem::MaybeUninit,
    ptr::{null, null_mut},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use cyclors::{
    DDS_BUILTIN_TOPIC_DCPSPARTICIPANT, DDS_BUILTIN_TOPIC_DCPSPUBLICATION,
    DDS_BUILTIN_TOPIC_DCPSSUBSCRIPTION, dds_builtintopic_endpoint_t,
    dds_builtintopic_participant_t, dds_create_reader, dds_entity_t,
    dds_instance_state_DDS_IST_ALIVE as ALIVE, dds_return_loan, dds_sample_info_t, dds_take,
};

use crate::{
    domain::Inner,
    entity::{Entity, Guid},
    error::Error,
    qos::{self, Terms},
    worker::Worker,
};

/// Most endpoints that are remembered: a hostile participant can announce any number.
const MAX_ENDPOINTS: usize = 10_000;
/// Endpoints taken at once.
const AT_ONCE: usize = 16;

/// Side of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Side {
    /// Sending.
    Writer,
    /// Receiving.
    Reader,
}

/// An endpoint of another participant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RemoteEndpoint {
    /// Identity.
    pub guid: Guid,
    /// Identity of its participant.
    pub participant: Guid,
    /// Side.
    pub side: Side,
    /// Topic, as on DDS.
    pub topic: String,
    /// Type, as on DDS.
    pub type_name: String,
    /// Terms on which it matches others.
    pub terms: Terms,
    /// Bytes that it shows in discovery, such as a type hash.
    pub user_data: Vec<u8>,
}

/// A change among other participants and their endpoints.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Discovery {
    /// An endpoint has appeared, or has changed.
    Found(RemoteEndpoint),
    /// An endpoint is gone.
    Lost(Guid),
    /// A participant has appeared, or has changed.
    Joined(Guid),
    /// A participant has left, or was silent for longer than its lease. Its endpoints are lost, too, before or after.
    Left(Guid),
}

type Table = Arc<Mutex<BTreeMap<Guid, RemoteEndpoint>>>;

/// The thread that follows discovery.
pub(crate) struct Watch {
    _worker: Worker,
    table: Table,
}

impl Watch {
    pub(crate) fn start(
        inner: &Arc<Inner>,
        own: Guid,
        mut on_discovery: impl FnMut(&Discovery) + Send + 'static,
    ) -> Result<Self, Error> {
        let open = |topic: dds_entity_t| {
            // SAFETY: these topics are always there; there are no policies and no listener.
            let created =
                unsafe { dds_create_reader(inner.participant.handle(), topic, null(), null()) };
            Entity::own("follow discovery", created).map(Arc::new)
        };
        let writers = open(DDS_BUILTIN_TOPIC_DCPSPUBLICATION)?;
        let readers = open(DDS_BUILTIN_TOPIC_DCPSSUBSCRIPTION)?;
        let participants = open(DDS_BUILTIN_TOPIC_DCPSPARTICIPANT)?;
        let table = Table::default();
        let all = [&writers, &readers, &participants].map(Arc::clone).to_vec();
        let shared = Arc::clone(&table);
        let mut is_full = false;
        let take_batch = move || {
            let mut is_busy = false;
            let kinds = [
                (&writers, Kind::Endpoint(Side::Writer)),
                (&readers, Kind::Endpoint(Side::Reader)),
                (&participants, Kind::Participant),
            ];
            for (reader, kind) in kinds {
                if let Some(changes) = take(reader, kind) {
                    is_busy = true;
                    for change in changes.into_iter().filter(|change| !is_of(change, own)) {
                        match enter(&mut lock(&shared), &change) {
                            Entry::Made => on_discovery(&change),
                            Entry::NoChange => {}
                            Entry::NoRoom if is_full => {}
                            Entry::NoRoom => {
                                is_full = true;
                                tracing::warn!(
                                    "more than {MAX_ENDPOINTS} DDS endpoints: no more are followed"
                                );
                            }
                        }
                    }
                }
            }
            is_busy
        };
        let worker = Worker::start("dds discovery", inner, all, take_batch)?;
        Ok(Self { _worker: worker, table })
    }

    pub(crate) fn endpoints(&self) -> Vec<RemoteEndpoint> {
        lock(&self.table).values().cloned().collect()
    }
}

fn lock(table: &Table) -> MutexGuard<'_, BTreeMap<Guid, RemoteEndpoint>> {
    table.lock().unwrap_or_else(PoisonError::into_inner)
}

fn is_of(change: &Discovery, participant: Guid) -> bool {
    match change {
        Discovery::Found(endpoint) => endpoint.participant == participant,
        Discovery::Joined(guid) | Discovery::Left(guid) => *guid == participant,
        // Unknown: not in the table.
        Discovery::Lost(_) => false,
    }
}

/// Kind of what a topic of discovery lists.
#[derive(Clone, Copy)]
enum Kind {
    Endpoint(Side),
    Participant,
}

enum Entry {
    Made,
    NoChange,
    NoRoom,
}

fn enter(table: &mut BTreeMap<Guid, RemoteEndpoint>, change: &Discovery) -> Entry {
    match change {
        Discovery::Found(endpoint) => {
            if table.len() >= MAX_ENDPOINTS && !table.contains_key(&endpoint.guid) {
                return Entry::NoRoom;
            }
            table.insert(endpoint.guid, endpoint.clone());
            Entry::Made
        }
        Discovery::Lost(guid) => {
            if table.remove(guid).is_some() {
                Entry::Made
            } else {
                Entry::NoChange
            }
        }
        // They are not listed.
        Discovery::Joined(_) | Discovery::Left(_) => Entry::Made,
    }
}

/// Takes some changes; `None` if there are none.
fn take(reader: &Entity, kind: Kind) -> Option<Vec<Discovery>> {
    let mut samples = [null_mut(); AT_ONCE];
    let mut infos = [const { MaybeUninit::<dds_sample_info_t>::uninit() }; AT_ONCE];
    // SAFETY: takes any handle. There is room for that many samples, which Cyclone lends because they are null.
    let count = unsafe {
        let infos = infos.as_mut_ptr().cast();
        dds_take(reader.handle(), samples.as_mut_ptr(), infos, AT_ONCE, AT_ONCE as u32)
    };
    let count = usize::try_from(count).ok().filter(|count| *count > 0)?;
    let changes = samples.iter().zip(&infos).take(count).map(|(sample, info)| {
        // SAFETY: Cyclone has filled the first `count` of both, with samples of the topic's type. Without valid data,
        // only the key is there.
        unsafe {
            let info = info.assume_init_ref();
            let is_there = info.valid_data && info.instance_state == ALIVE;
            match kind {
                Kind::Participant => {
                    let guid = (*sample.cast::<dds_builtintopic_participant_t>()).key.v;
                    if is_there { Discovery::Joined(guid) } else { Discovery::Left(guid) }
                }
                Kind::Endpoint(side) => {
                    let endpoint = &*sample.cast::<dds_builtintopic_endpoint_t>();
                    if is_there {
                        Discovery::Found(found(endpoint, side))
                    } else {
                        Discovery::Lost(endpoint.key.v)
                    }
                }
            }
        }
    });
    let changes = changes.collect();
    // SAFETY: gives back what was lent.
    unsafe { dds_return_loan(reader.handle(), samples.as_mut_ptr(), count as i32) };
    Some(changes)
}

/// # Safety
/// `endpoint` is a valid sample of Cyclone's.
unsafe fn found(endpoint: &dds_builtintopic_endpoint_t, side: Side) -> RemoteEndpoint {
    // SAFETY: by the contract of this function.
    let (topic, type_name, (terms, user_data)) = unsafe {
        (string(endpoint.topic_name), string(endpoint.type_name), qos::read(endpoint.qos))
    };
    RemoteEndpoint {
        guid: endpoint.key.v,
        participant: endpoint.participant_key.v,
        side,
        topic,
        type_name,
        terms,
        user_data,
    }
}

/// # Safety
/// `text` is null or a string that ends with NUL.
unsafe fn string(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: by the contract of this function.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}
