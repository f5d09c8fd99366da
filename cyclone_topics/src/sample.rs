//! Messages as bytes: what Cyclone calls to take, keep and send a message of a type that it does not know.
//!
//! Cyclone's own types parse messages. These only carry them, without a copy where there is none to make: a received
//! message is assembled from its fragments into the memory that the receiver gets, and a sent one is shared.
#![expect(
    unsafe_code,
    reason = "Cyclone's interface for types consists of C functions and structures"
)]

use std::{
    ffi::{c_char, c_void},
    ptr::{NonNull, copy_nonoverlapping, null_mut},
    slice,
    sync::{
        Arc,
        atomic::{AtomicU32, Ordering, fence},
    },
};

use cyclors::{
    ddsi_keyhash, ddsi_rdata, ddsi_serdata, ddsi_serdata_init, ddsi_serdata_kind,
    ddsi_serdata_kind_SDK_DATA as DATA, ddsi_serdata_kind_SDK_KEY as KEY, ddsi_serdata_ops,
    ddsi_serdata_unref, ddsi_sertype, ddsrt_iovec_t, ddsrt_msg_iovlen_t,
};

use crate::fragment;

/// Functions for messages of any type.
pub(crate) static SAMPLE_OPS: ddsi_serdata_ops = ddsi_serdata_ops {
    eqkey: Some(eqkey),
    get_size: Some(get_size),
    from_ser: Some(from_ser),
    from_ser_iov: Some(from_ser_iov),
    from_keyhash: Some(from_keyhash),
    from_sample: Some(from_sample),
    to_ser: Some(to_ser),
    to_ser_ref: Some(to_ser_ref),
    to_ser_unref: Some(to_ser_unref),
    to_sample: Some(to_sample),
    to_untyped: Some(to_untyped),
    untyped_to_sample: Some(untyped_to_sample),
    free: Some(free),
    print: Some(print),
    get_keyhash: Some(get_keyhash),
    // Only for shared memory, which is not configured.
    from_loaned_sample: None,
    from_psmx: None,
};

enum Payload {
    Received(Vec<u8>),
    Sent(Arc<[u8]>),
}

/// A message in Cyclone's hands. Begins with Cyclone's part, so that a pointer to one is a pointer to the other.
#[repr(C)]
struct Carried {
    base: ddsi_serdata,
    payload: Payload,
    sequence: Option<i64>,
}

impl Carried {
    /// Returns a message with one reference to it.
    fn create(
        kind_of: *const ddsi_sertype,
        kind: ddsi_serdata_kind,
        payload: Payload,
        sequence: Option<i64>,
    ) -> *mut ddsi_serdata {
        // SAFETY: the structure consists of numbers and pointers that may all be zero.
        let base = unsafe { std::mem::zeroed() };
        let carried = Box::into_raw(Box::new(Self { base, payload, sequence })).cast();
        // SAFETY: `carried` points to a structure of this kind; the type outlives it, as its topic does.
        unsafe { ddsi_serdata_init(carried, kind_of, kind) };
        carried
    }

    /// # Safety
    /// `data` was made by `create` and is not yet freed.
    const unsafe fn of<'a>(data: *const ddsi_serdata) -> &'a Self {
        // SAFETY: `create` made a whole `Carried`.
        unsafe { &*data.cast::<Self>() }
    }

    fn bytes(&self) -> &[u8] {
        match &self.payload {
            Payload::Received(bytes) => bytes,
            Payload::Sent(bytes) => bytes,
        }
    }
}

/// Makes a message to send; whoever takes it takes the one reference.
pub(crate) fn to_send(
    kind_of: *const ddsi_sertype,
    message: &Arc<[u8]>,
    source_time_ns: i64,
) -> *mut ddsi_serdata {
    let data = Carried::create(kind_of, DATA, Payload::Sent(Arc::clone(message)), None);
    // SAFETY: `data` is new: nobody else has it.
    unsafe {
        (*data).timestamp.v = source_time_ns;
        (*data).statusinfo = 0;
    }
    data
}

/// A received message, with a reference of its own.
pub(crate) struct Taken(NonNull<ddsi_serdata>);

impl Taken {
    /// # Safety
    /// `data` is a message of a type with [`SAMPLE_OPS`], and comes with a reference.
    pub(crate) unsafe fn new(data: *mut ddsi_serdata) -> Option<Self> {
        NonNull::new(data).map(Self)
    }

    pub(crate) fn len(&self) -> usize {
        // SAFETY: by `new`, it is a message of this module, and the reference keeps it.
        unsafe { Carried::of(self.0.as_ptr()) }.bytes().len()
    }

    /// Returns the message and its number; without a copy unless another reader has it, too.
    pub(crate) fn into_parts(self) -> (Vec<u8>, Option<i64>) {
        let data = self.0.as_ptr();
        // SAFETY: as in `len`. The counter is an atomic one in C, too.
        let (count, sequence) =
            unsafe { (AtomicU32::from_ptr(&raw mut (*data).refc.v), Carried::of(data).sequence) };
        if count.load(Ordering::Acquire) == 1 {
            // SAFETY: this is the only reference, and only a holder of one can make another.
            let carried = unsafe { &mut *data.cast::<Carried>() };
            if let Payload::Received(bytes) = &mut carried.payload {
                return (std::mem::take(bytes), sequence);
            }
        }
        // SAFETY: as in `len`.
        (unsafe { Carried::of(data) }.bytes().to_vec(), sequence)
    }
}

impl Drop for Taken {
    fn drop(&mut self) {
        // SAFETY: gives up the reference that came with `new`.
        unsafe { ddsi_serdata_unref(self.0.as_ptr()) };
    }
}

// The functions. Each gets what Cyclone's description of it (ddsi_serdata.h) promises.

unsafe extern "C" fn from_ser(
    kind_of: *const ddsi_sertype,
    kind: ddsi_serdata_kind,
    chain: *const ddsi_rdata,
    size: usize,
) -> *mut ddsi_serdata {
    // SAFETY: Cyclone passes the fragments of one message, and keeps their datagrams during the call.
    let Some((bytes, sequence)) = (unsafe { fragment::assemble(chain, size) }) else {
        return null_mut();
    };
    Carried::create(kind_of, kind, Payload::Received(bytes), sequence)
}

unsafe extern "C" fn from_ser_iov(
    kind_of: *const ddsi_sertype,
    kind: ddsi_serdata_kind,
    num_parts: ddsrt_msg_iovlen_t,
    parts: *const ddsrt_iovec_t,
    size: usize,
) -> *mut ddsi_serdata {
    let mut bytes = Vec::new();
    if bytes.try_reserve_exact(size).is_err() {
        return null_mut();
    }
    for at in 0..num_parts {
        // SAFETY: Cyclone passes `num_parts` valid parts.
        let part = unsafe {
            let part = &*parts.add(at);
            slice::from_raw_parts(part.iov_base.cast::<u8>(), part.iov_len)
        };
        bytes.extend_from_slice(&part[..part.len().min(size - bytes.len())]);
    }
    Carried::create(kind_of, kind, Payload::Received(bytes), None)
}

/// The types have no key: this is a message without content.
unsafe extern "C" fn from_keyhash(
    kind_of: *const ddsi_sertype,
    _: *const ddsi_keyhash,
) -> *mut ddsi_serdata {
    Carried::create(kind_of, KEY, Payload::Received(Vec::new()), None)
}

/// Nothing is written but bytes, so that Cyclone never has a sample to convert.
unsafe extern "C" fn from_sample(
    _: *const ddsi_sertype,
    _: ddsi_serdata_kind,
    _: *const c_void,
) -> *mut ddsi_serdata {
    null_mut()
}

unsafe extern "C" fn eqkey(_: *const ddsi_serdata, _: *const ddsi_serdata) -> bool {
    true
}

unsafe extern "C" fn get_size(data: *const ddsi_serdata) -> u32 {
    // SAFETY: Cyclone passes a message of this module. Its length is below `max_sample_bytes`, a `u32`.
    unsafe { Carried::of(data) }.bytes().len() as u32
}

/// Copies `size` bytes from `at`, with zeros behind the end: Cyclone rounds lengths up to four bytes.
unsafe extern "C" fn to_ser(data: *const ddsi_serdata, at: usize, size: usize, out: *mut c_void) {
    // SAFETY: Cyclone passes a message of this module.
    let bytes = unsafe { Carried::of(data) }.bytes();
    let part = &bytes[at.min(bytes.len())..(at + size).min(bytes.len())];
    let out = out.cast::<u8>();
    // SAFETY: `out` has `size` bytes, and `part` at most as many.
    unsafe {
        copy_nonoverlapping(part.as_ptr(), out, part.len());
        out.add(part.len()).write_bytes(0, size - part.len());
    }
}

/// Lends `size` bytes from `at`. Where they reach behind the end, it lends a copy with zeros.
unsafe extern "C" fn to_ser_ref(
    data: *const ddsi_serdata,
    at: usize,
    size: usize,
    lent: *mut ddsrt_iovec_t,
) -> *mut ddsi_serdata {
    // SAFETY: Cyclone passes a message of this module.
    let bytes = unsafe { Carried::of(data) }.bytes();
    let start = if let Some(part) = bytes.get(at..at + size) {
        part.as_ptr().cast_mut()
    } else {
        let mut copy = vec![0; size].into_boxed_slice();
        let part = &bytes[at.min(bytes.len())..];
        copy[..part.len()].copy_from_slice(part);
        Box::into_raw(copy).cast::<u8>()
    };
    // SAFETY: `lent` is there to be filled. The counter is an atomic one in C, too; it cannot reach its maximum,
    // because every reference is a datagram in memory.
    unsafe {
        *lent = ddsrt_iovec_t { iov_base: start.cast(), iov_len: size };
        let data = data.cast_mut();
        AtomicU32::from_ptr(&raw mut (*data).refc.v).fetch_add(1, Ordering::Relaxed);
        data
    }
}

unsafe extern "C" fn to_ser_unref(data: *mut ddsi_serdata, lent: *const ddsrt_iovec_t) {
    // SAFETY: Cyclone passes what `to_ser_ref` has returned and filled.
    unsafe {
        let lent = &*lent;
        let own = Carried::of(data).bytes().as_ptr_range();
        let start = lent.iov_base.cast::<u8>();
        if !own.contains(&start.cast_const()) {
            drop(Box::from_raw(std::ptr::slice_from_raw_parts_mut(start, lent.iov_len)));
        }
        ddsi_serdata_unref(data);
    }
}

unsafe extern "C" fn to_sample(
    _: *const ddsi_serdata,
    _: *mut c_void,
    _: *mut *mut c_void,
    _: *mut c_void,
) -> bool {
    false
}

unsafe extern "C" fn untyped_to_sample(
    _: *const ddsi_sertype,
    _: *const ddsi_serdata,
    _: *mut c_void,
    _: *mut *mut c_void,
    _: *mut c_void,
) -> bool {
    false
}

/// Without a key, all messages belong to one instance: this is what Cyclone remembers of it.
unsafe extern "C" fn to_untyped(data: *const ddsi_serdata) -> *mut ddsi_serdata {
    // SAFETY: Cyclone passes a message of this module, with its type.
    let kind_of = unsafe { (*data).type_ };
    let untyped = Carried::create(kind_of, KEY, Payload::Received(Vec::new()), None);
    // SAFETY: `untyped` is new: nobody else has it. It must not keep the type, which it may outlive.
    unsafe { (*untyped).type_ = std::ptr::null() };
    untyped
}

unsafe extern "C" fn free(data: *mut ddsi_serdata) {
    // The last of the other references may have been given up on another thread.
    fence(Ordering::Acquire);
    // SAFETY: `Carried::create` made it from a box, and the last reference is gone.
    drop(unsafe { Box::from_raw(data.cast::<Carried>()) });
}

/// Messages are not printed in traces.
unsafe extern "C" fn print(
    _: *const ddsi_sertype,
    _: *const ddsi_serdata,
    out: *mut c_char,
    size: usize,
) -> usize {
    if size > 0 {
        // SAFETY: `out` has `size` bytes.
        unsafe { *out = 0 };
    }
    0
}

unsafe extern "C" fn get_keyhash(_: *const ddsi_serdata, out: *mut ddsi_keyhash, _: bool) {
    // SAFETY: `out` is there to be filled, and zeros are a hash.
    unsafe { out.write_bytes(0, 1) };
}
