//! A DDS domain for one test alone.

use std::{
    net::{Ipv4Addr, TcpListener},
    process,
    sync::{
        PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard,
        atomic::{AtomicU32, Ordering},
    },
};

/// Ports of higher domains overlap the ephemeral range.
const NUM_DOMAINS: u32 = 100;
/// First TCP port of the claims; TCP does not interfere with DDS.
const CLAIMS_FROM: u32 = 21_700;

static NEXT: AtomicU32 = AtomicU32::new(0);
/// Tests with many large messages run while no other test of this module does.
static MACHINE: RwLock<()> = RwLock::new(());

enum Share {
    Part { _guard: RwLockReadGuard<'static, ()> },
    Whole { _guard: RwLockWriteGuard<'static, ()> },
}

/// A domain that no other test has, in this process or another, while this lives.
pub(crate) struct Domain {
    pub(crate) id: u16,
    _claim: TcpListener,
    _share: Share,
}

impl Domain {
    /// A domain beside those of other tests.
    pub(crate) fn claim() -> Self {
        let guard = MACHINE.read().unwrap_or_else(PoisonError::into_inner);
        Self::with(Share::Part { _guard: guard })
    }

    /// A domain while no other test has one.
    pub(crate) fn claim_alone() -> Self {
        let guard = MACHINE.write().unwrap_or_else(PoisonError::into_inner);
        Self::with(Share::Whole { _guard: guard })
    }

    fn with(share: Share) -> Self {
        let first = process::id() + NEXT.fetch_add(1, Ordering::Relaxed);
        let mut ids = (0..NUM_DOMAINS).map(|offset| 1 + (first + offset) % NUM_DOMAINS);
        let claimed = ids.find_map(|id| {
            let port = u16::try_from(CLAIMS_FROM + id).unwrap();
            let claim = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).ok()?;
            Some((u16::try_from(id).unwrap(), claim))
        });
        let (id, claim) = claimed.expect("one domain of a hundred is free");
        Self { id, _claim: claim, _share: share }
    }
}
