//! Received messages, put together from the datagrams in which they came.
//!
//! The bindings leave out the structures of fragments; they are repeated here as Cyclone 11.0.1 has them in
//! `ddsi_radmin.h`. The tests receive messages of one and of many fragments, and lose some.
#![expect(unsafe_code, reason = "Cyclone's fragments are a chain of C structures")]

use std::{ffi::c_void, slice};

use cyclors::ddsi_rdata;

#[repr(C)]
union ChunkSize {
    size: u32,
    integer: i64,
    number: f64,
    pointer: *mut c_void,
}

#[repr(C)]
struct Chunk {
    buffer: *mut c_void,
    next: *mut c_void,
    size: ChunkSize,
}

/// A datagram. Its bytes follow.
#[repr(C)]
struct Datagram {
    references: u32,
    last_chunk: *mut c_void,
    is_traced: bool,
    chunk: Chunk,
}

/// A part of a message, within a datagram.
#[repr(C)]
struct Fragment {
    datagram: *const Datagram,
    next: *const Self,
    /// Place in the message, bytes.
    begin: u32,
    end: u32,
    /// Places in the datagram, bytes: of the submessage, and of this part of the message.
    submessage_at: u16,
    payload_at: u16,
    key_hash_at: u16,
}

/// Offset of the writer's sequence number in a `DATA` or `DATA_FRAG` submessage (RTPS 2.5, 9.4.5.4 and 9.4.5.5): behind
/// header, flags, reader and writer. Cyclone has brought it to this machine's byte order.
const SEQUENCE_AT: usize = 16;
const SUBMESSAGES_OF_DATA: [u8; 2] = [0x15, 0x16];

impl Fragment {
    /// # Safety
    /// The datagram of this fragment is still there, and `at` is within it.
    const unsafe fn at(&self, at: u16) -> *const u8 {
        // SAFETY: the bytes of a datagram follow the structure.
        unsafe { self.datagram.add(1).cast::<u8>().add(at as usize) }
    }

    /// # Safety
    /// As for `at`.
    unsafe fn sequence(&self) -> Option<i64> {
        // SAFETY: every received message has a submessage of at least 24 bytes, which begins at a multiple of four.
        let (kind, high, low) = unsafe {
            let start = self.at(self.submessage_at);
            let number = start.add(SEQUENCE_AT);
            (
                *start,
                number.cast::<i32>().read_unaligned(),
                number.add(4).cast::<u32>().read_unaligned(),
            )
        };
        let sequence = (i64::from(high) << 32) | i64::from(low);
        (SUBMESSAGES_OF_DATA.contains(&kind) && sequence > 0).then_some(sequence)
    }
}

/// Assembles a message of `size` bytes, and returns it with its number; `None` if fragments are missing or there is no
/// memory.
///
/// # Safety
/// `chain` begins a chain of fragments whose datagrams are still there.
pub(crate) unsafe fn assemble(
    chain: *const ddsi_rdata,
    size: usize,
) -> Option<(Vec<u8>, Option<i64>)> {
    // SAFETY: by the contract of this function.
    let first = unsafe { chain.cast::<Fragment>().as_ref()? };
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(size).ok()?;
    let mut next = Some(first);
    while let Some(fragment) = next {
        let (begin, end) = (fragment.begin as usize, fragment.end as usize);
        let have = bytes.len();
        // Fragments may overlap.
        if end > have {
            if begin > have || end > size {
                return None;
            }
            // SAFETY: the fragment's bytes from `begin` to `end` lie in its datagram from `payload_at`.
            let part = unsafe {
                let start = fragment.at(fragment.payload_at).add(have - begin);
                slice::from_raw_parts(start, end - have)
            };
            bytes.extend_from_slice(part);
        }
        // SAFETY: by the contract of this function.
        next = unsafe { fragment.next.as_ref() };
    }
    // SAFETY: by the contract of this function.
    (bytes.len() == size).then(|| (bytes, unsafe { first.sequence() }))
}
