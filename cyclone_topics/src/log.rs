//! Cyclone's warnings and errors, in the log of this program.
#![expect(unsafe_code, reason = "Cyclone logs through a callback")]

use std::{cell::RefCell, ffi::c_void, panic, ptr::null_mut, slice, sync::Once};

use cyclors::{DDS_LC_ERROR, DDS_LC_FATAL, DDS_LC_WARNING, dds_log_data_t, dds_set_log_sink};

thread_local! {
    /// Lines that this thread logged while it joined a domain: the reason for a failure.
    static JOINING: RefCell<Option<Vec<String>>> = const { RefCell::new(None) };
}

/// Most lines kept of a failed joining.
const MAX_LINES: usize = 8;

/// Redirects Cyclone's log, once per process.
pub(crate) fn redirect() {
    static ONCE: Once = Once::new();
    // SAFETY: the callback is a function of this program and needs no data; it may be called on any thread at any time.
    ONCE.call_once(|| unsafe { dds_set_log_sink(Some(take), null_mut()) });
}

/// Runs `join` and returns with its result what Cyclone logged meanwhile on this thread.
pub(crate) fn listen<T>(join: impl FnOnce() -> T) -> (T, Vec<String>) {
    JOINING.set(Some(Vec::new()));
    let result = join();
    (result, JOINING.take().unwrap_or_default())
}

unsafe extern "C" fn take(_: *mut c_void, data: *const dds_log_data_t) {
    // A panic must not unwind into Cyclone.
    drop(panic::catch_unwind(|| {
        // SAFETY: Cyclone passes a valid record whose message, behind its header, has `size` bytes.
        let (priority, bytes) = unsafe {
            let data = &*data;
            (data.priority, slice::from_raw_parts(data.message.cast::<u8>(), data.size))
        };
        write(priority, String::from_utf8_lossy(bytes).trim_end_matches(['\n', '\0']));
    }));
}

fn write(priority: u32, line: &str) {
    let is_severe = priority & (DDS_LC_FATAL | DDS_LC_ERROR) != 0;
    let is_kept = JOINING.with_borrow_mut(|lines| match lines {
        Some(lines) if is_severe => {
            if lines.len() < MAX_LINES {
                lines.push(line.to_owned());
            }
            true
        }
        _ => false,
    });
    if is_kept {
        return;
    }
    if is_severe {
        tracing::error!("Cyclone DDS: {line}");
    } else if priority & DDS_LC_WARNING != 0 {
        tracing::warn!("Cyclone DDS: {line}");
    } else {
        tracing::debug!("Cyclone DDS: {line}");
    }
}
