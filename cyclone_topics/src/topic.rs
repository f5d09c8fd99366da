//! Topics whose name and type name are chosen at run time.
#![expect(
    unsafe_code,
    reason = "Cyclone's interface for types consists of C functions and structures"
)]

use std::{
    ffi::c_void,
    ptr::{null, null_mut},
};

use cyclors::{
    DDS_DATA_REPRESENTATION_FLAG_XCDR1, DDSI_SERTYPE_FLAG_TOPICKIND_NO_KEY,
    dds_create_topic_sertype, dds_free_op_t, ddsi_sertype, ddsi_sertype_fini,
    ddsi_sertype_init_flags, ddsi_sertype_ops, ddsi_sertype_unref, ddsi_sertype_v0,
};

use crate::{
    entity::Entity,
    error::{Error, c_string},
    sample::SAMPLE_OPS,
};

struct TypeOps(ddsi_sertype_ops);

// SAFETY: functions, and a pointer that is null.
unsafe impl Sync for TypeOps {}

static TYPE_OPS: TypeOps = TypeOps(ddsi_sertype_ops {
    version: Some(ddsi_sertype_v0),
    arg: null_mut(),
    free: Some(free),
    zero_samples: Some(zero_samples),
    realloc_samples: Some(realloc_samples),
    free_samples: Some(free_samples),
    equal: Some(equal),
    hash: Some(hash),
    type_id: None,
    type_map: None,
    type_info: None,
    derive_sertype: None,
    get_serialized_size: None,
    serialize_into: None,
});

/// Creates a topic of plain CDR.
pub(crate) fn create(participant: &Entity, name: &str, type_name: &str) -> Result<Entity, Error> {
    let (name, type_name) = (c_string(name)?, c_string(type_name)?);
    // SAFETY: the structure consists of numbers and pointers that may all be zero; Cyclone fills it and copies the name.
    let mut kind = unsafe {
        let kind = Box::into_raw(Box::new(std::mem::zeroed::<ddsi_sertype>()));
        let flags = DDSI_SERTYPE_FLAG_TOPICKIND_NO_KEY;
        ddsi_sertype_init_flags(
            kind,
            type_name.as_ptr(),
            &raw const TYPE_OPS.0,
            &raw const SAMPLE_OPS,
            flags,
        );
        (*kind).allowed_data_representation = DDS_DATA_REPRESENTATION_FLAG_XCDR1;
        kind
    };
    // SAFETY: all pointers live through the call. It takes the type, or leaves it to us if it fails.
    let created = unsafe {
        let (participant, name) = (participant.handle(), name.as_ptr());
        let created =
            dds_create_topic_sertype(participant, name, &raw mut kind, null(), null(), null());
        if created < 0 {
            ddsi_sertype_unref(kind);
        }
        created
    };
    Entity::own("create a topic", created)
}

unsafe extern "C" fn free(kind: *mut ddsi_sertype) {
    // SAFETY: `create` made it from a box, and the last reference is gone.
    unsafe {
        ddsi_sertype_fini(kind);
        drop(Box::from_raw(kind));
    }
}

/// Called for types with the same name and functions: there is nothing else to compare.
unsafe extern "C" fn equal(_: *const ddsi_sertype, _: *const ddsi_sertype) -> bool {
    true
}

unsafe extern "C" fn hash(_: *const ddsi_sertype) -> u32 {
    0
}

// Samples in memory are not used: messages are read and written as bytes.

unsafe extern "C" fn zero_samples(_: *const ddsi_sertype, _: *mut c_void, _: usize) {}

unsafe extern "C" fn realloc_samples(
    _: *mut *mut c_void,
    _: *const ddsi_sertype,
    _: *mut c_void,
    _: usize,
    _: usize,
) {
}

unsafe extern "C" fn free_samples(
    _: *const ddsi_sertype,
    _: *mut *mut c_void,
    _: usize,
    _: dds_free_op_t,
) {
}
