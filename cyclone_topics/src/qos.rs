//! Quality of service.
#![expect(unsafe_code, reason = "Cyclone's set of policies is read and written by C functions")]

use std::{
    ffi::c_void,
    ptr::{NonNull, null_mut},
    slice,
    time::Duration,
};

use cyclors::{
    DDS_DATA_REPRESENTATION_XCDR1, DDS_LENGTH_UNLIMITED, dds_create_qos, dds_delete_qos,
    dds_duration_t, dds_free, dds_qget_deadline, dds_qget_durability, dds_qget_liveliness,
    dds_qget_reliability, dds_qget_userdata, dds_qos_t, dds_qset_data_representation,
    dds_qset_deadline, dds_qset_durability, dds_qset_durability_service, dds_qset_history,
    dds_qset_lifespan, dds_qset_liveliness, dds_qset_reliability, dds_qset_resource_limits,
    dds_qset_userdata, dds_qset_writer_data_lifecycle,
};

/// Retransmission of lost messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Reliability {
    /// None.
    BestEffort,
    /// Until the readers have them.
    Reliable,
}

/// Delivery of earlier messages to late readers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Durability {
    /// None.
    Volatile,
    /// As many as the history has.
    TransientLocal,
}

/// Messages that are stored: by a writer until they are acknowledged, by a reader until they are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum History {
    /// The last ones. A writer never waits for its readers: a slow reader loses the oldest.
    KeepLast(u32),
    /// All, up to that many. A writer waits for its readers, at most `max_blocking`.
    KeepAll(u32),
}

/// Source of a writer's liveliness.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Liveliness {
    /// Cyclone.
    Automatic,
    /// Any writer of the participant.
    ManualByParticipant,
    /// The writer itself.
    ManualByTopic,
}

/// Quality of service of a reader or writer. Times of `None` are infinite.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Qos {
    /// Retransmission.
    pub reliability: Reliability,
    /// Longest time for which a writer that keeps all messages waits for slow readers.
    pub max_blocking: Duration,
    /// Delivery to late readers.
    pub durability: Durability,
    /// Stored messages.
    pub history: History,
    /// Longest time between two messages.
    pub deadline: Option<Duration>,
    /// Time after which a message expires.
    pub lifespan: Option<Duration>,
    /// Source of a writer's liveliness.
    pub liveliness: Liveliness,
    /// Longest time between two assertions.
    pub liveliness_lease: Option<Duration>,
    /// Bytes that others see in discovery.
    pub user_data: Vec<u8>,
}

/// A policy by which two endpoints may not fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "named like the policies")]
pub enum Policy {
    Reliability,
    Durability,
    Deadline,
    Liveliness,
}

/// Discovered quality of service of an endpoint: the policies that decide whether two endpoints fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Terms {
    /// Retransmission.
    pub reliability: Reliability,
    /// Delivery to late readers.
    pub durability: Durability,
    /// Longest time between two messages; `None`: infinite.
    pub deadline: Option<Duration>,
    /// Source of a writer's liveliness.
    pub liveliness: Liveliness,
    /// Longest time between two assertions; `None`: infinite.
    pub liveliness_lease: Option<Duration>,
}

impl Terms {
    /// Returns the first policy by which a writer that offers these terms does not satisfy a reader.
    pub fn conflict(&self, requested: &Self) -> Option<Policy> {
        let longer = |offered: Option<Duration>, requested: Option<Duration>| {
            offered.unwrap_or(Duration::MAX) > requested.unwrap_or(Duration::MAX)
        };
        if self.reliability < requested.reliability {
            Some(Policy::Reliability)
        } else if self.durability < requested.durability {
            Some(Policy::Durability)
        } else if longer(self.deadline, requested.deadline) {
            Some(Policy::Deadline)
        } else if self.liveliness < requested.liveliness
            || longer(self.liveliness_lease, requested.liveliness_lease)
        {
            Some(Policy::Liveliness)
        } else {
            None
        }
    }
}

impl Qos {
    /// Returns the terms on which this endpoint matches others.
    pub const fn terms(&self) -> Terms {
        Terms {
            reliability: self.reliability,
            durability: self.durability,
            deadline: self.deadline,
            liveliness: self.liveliness,
            liveliness_lease: self.liveliness_lease,
        }
    }
}

/// Cyclone's set of policies.
pub(crate) struct Policies(NonNull<dds_qos_t>);

const INFINITE: dds_duration_t = dds_duration_t::MAX;

fn duration(time: Option<Duration>) -> dds_duration_t {
    time.and_then(|time| i64::try_from(time.as_nanos()).ok()).unwrap_or(INFINITE)
}

fn finite(time: dds_duration_t) -> Option<Duration> {
    u64::try_from(time).ok().filter(|_| time < INFINITE).map(Duration::from_nanos)
}

fn count(number: u32) -> i32 {
    i32::try_from(number).unwrap_or(i32::MAX)
}

impl Policies {
    /// Returns the defaults; `None` without memory.
    fn new() -> Option<Self> {
        // SAFETY: it has no conditions.
        NonNull::new(unsafe { dds_create_qos() }).map(Self)
    }

    /// Returns the policies of a participant, whose user data are seen in discovery.
    pub(crate) fn of_participant(user_data: &[u8]) -> Option<Self> {
        let policies = Self::new()?;
        policies.set_user_data(user_data);
        Some(policies)
    }

    fn set_user_data(&self, bytes: &[u8]) {
        // SAFETY: the set is valid, and the bytes are copied.
        unsafe { dds_qset_userdata(self.0.as_ptr(), bytes.as_ptr().cast::<c_void>(), bytes.len()) };
    }

    /// Returns the policies of an endpoint.
    pub(crate) fn of(qos: &Qos) -> Option<Self> {
        let policies = Self::new()?;
        policies.set_history(qos);
        policies.set_user_data(&qos.user_data);
        let to = policies.0.as_ptr();
        let representations = [DDS_DATA_REPRESENTATION_XCDR1 as i16];
        // SAFETY: the set is valid, and what is pointed to is copied.
        unsafe {
            dds_qset_reliability(to, qos.reliability as u32, duration(Some(qos.max_blocking)));
            dds_qset_durability(to, qos.durability as u32);
            dds_qset_deadline(to, duration(qos.deadline));
            dds_qset_lifespan(to, duration(qos.lifespan));
            dds_qset_liveliness(to, qos.liveliness as u32, duration(qos.liveliness_lease));
            dds_qset_data_representation(to, 1, representations.as_ptr());
            // A writer that goes leaves its messages valid, as in ROS.
            dds_qset_writer_data_lifecycle(to, false);
        }
        Some(policies)
    }

    fn set_history(&self, qos: &Qos) {
        const KEEP_LAST: u32 = cyclors::dds_history_kind_DDS_HISTORY_KEEP_LAST;
        const KEEP_ALL: u32 = cyclors::dds_history_kind_DDS_HISTORY_KEEP_ALL;
        let unlimited = DDS_LENGTH_UNLIMITED;
        let (kind, depth, limit) = match qos.history {
            History::KeepLast(depth) => (KEEP_LAST, count(depth.max(1)), unlimited),
            History::KeepAll(limit) => (KEEP_ALL, 1, count(limit.max(1))),
        };
        let to = self.0.as_ptr();
        // SAFETY: the set is valid.
        unsafe {
            dds_qset_history(to, kind, depth);
            dds_qset_resource_limits(to, limit, unlimited, limit);
            // Late readers receive what this history keeps.
            dds_qset_durability_service(to, 0, kind, depth, limit, unlimited, limit);
        }
    }

    pub(crate) const fn as_ptr(&self) -> *const dds_qos_t {
        self.0.as_ptr()
    }
}

impl Drop for Policies {
    fn drop(&mut self) {
        // SAFETY: this owns the set.
        unsafe { dds_delete_qos(self.0.as_ptr()) };
    }
}

/// Reads the terms and the user data of a discovered endpoint.
///
/// # Safety
/// `from` is null or a valid set.
pub(crate) unsafe fn read(from: *const dds_qos_t) -> (Terms, Vec<u8>) {
    // Defaults of DDS, for policies that are not there.
    let (mut reliability, mut durability, mut liveliness) = (0, 0, 0);
    let (mut blocking, mut deadline, mut lease) = (0, INFINITE, INFINITE);
    // SAFETY: the set is null, which reads nothing, or valid; all numbers live through the calls.
    unsafe {
        dds_qget_reliability(from, &raw mut reliability, &raw mut blocking);
        dds_qget_durability(from, &raw mut durability);
        dds_qget_deadline(from, &raw mut deadline);
        dds_qget_liveliness(from, &raw mut liveliness, &raw mut lease);
    }
    let terms = Terms {
        reliability: if reliability == 0 { Reliability::BestEffort } else { Reliability::Reliable },
        durability: if durability == 0 { Durability::Volatile } else { Durability::TransientLocal },
        deadline: finite(deadline),
        liveliness: match liveliness {
            0 => Liveliness::Automatic,
            1 => Liveliness::ManualByParticipant,
            _ => Liveliness::ManualByTopic,
        },
        liveliness_lease: finite(lease),
    };
    // SAFETY: by the contract of this function.
    (terms, unsafe { user_data(from) })
}

/// # Safety
/// As for [`read`].
unsafe fn user_data(from: *const dds_qos_t) -> Vec<u8> {
    let (mut bytes, mut length) = (null_mut(), 0);
    // SAFETY: as for `read`; the bytes are a copy that is ours to free.
    unsafe {
        if !dds_qget_userdata(from, &raw mut bytes, &raw mut length) || bytes.is_null() {
            return Vec::new();
        }
        let data = slice::from_raw_parts(bytes.cast::<u8>(), length).to_vec();
        dds_free(bytes);
        data
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn reliable(depth: u32) -> Qos {
        Qos {
            reliability: Reliability::Reliable,
            max_blocking: Duration::from_millis(20),
            durability: Durability::Volatile,
            history: History::KeepLast(depth),
            deadline: None,
            lifespan: None,
            liveliness: Liveliness::Automatic,
            liveliness_lease: None,
            user_data: Vec::new(),
        }
    }

    #[test]
    fn terms_survive_cyclone() {
        let qos = Qos {
            durability: Durability::TransientLocal,
            deadline: Some(Duration::from_millis(1500)),
            liveliness: Liveliness::ManualByTopic,
            liveliness_lease: Some(Duration::from_secs(7)),
            user_data: b"typehash=RIHS01_00;".to_vec(),
            ..reliable(3)
        };
        let policies = Policies::of(&qos).unwrap();
        // SAFETY: the set is valid.
        let (terms, user_data) = unsafe { read(policies.as_ptr()) };
        assert_eq!(terms, qos.terms());
        assert_eq!(user_data, qos.user_data);
    }

    #[test]
    fn offers_must_be_at_least_what_is_requested() {
        let terms = reliable(1).terms();
        let second = Some(Duration::from_secs(1));
        for (offered, expected) in [
            (terms, None),
            (Terms { reliability: Reliability::BestEffort, ..terms }, Some(Policy::Reliability)),
            (Terms { durability: Durability::TransientLocal, ..terms }, None),
            (Terms { deadline: second, ..terms }, None),
            (Terms { liveliness: Liveliness::ManualByTopic, ..terms }, None),
        ] {
            assert_eq!(offered.conflict(&terms), expected, "{offered:?}");
        }
        for (requested, expected) in [
            (Terms { durability: Durability::TransientLocal, ..terms }, Policy::Durability),
            (Terms { deadline: second, ..terms }, Policy::Deadline),
            (Terms { liveliness: Liveliness::ManualByTopic, ..terms }, Policy::Liveliness),
            (Terms { liveliness_lease: second, ..terms }, Policy::Liveliness),
        ] {
            assert_eq!(terms.conflict(&requested), Some(expected), "{requested:?}");
        }
    }
}
