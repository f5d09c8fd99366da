//! The space on a recording's disk: what is written between two checks never takes what must stay free.

use std::path::Path;

use super::{error::RecordingError, place};

/// Largest number of bytes between two checks.
const CHECK_BYTES: u64 = 8 << 20;
/// Part of the room that one recording may use between two checks: four of them may share a disk.
const SHARE: u64 = 4;
/// Overhead of a message in its file, bytes: its record and its index entry, generously.
const MESSAGE_BYTES: u64 = 64;

/// Room on a disk, as of the last check.
#[derive(Debug, Default)]
pub(super) struct Space {
    /// Free bytes that may be used; 0 before the first check.
    room_bytes: u64,
    /// Bytes used since then, in the file or not yet.
    used_bytes: u64,
}

impl Space {
    /// Takes the room for a message of `bytes` bytes. Returns false if the disk must be checked first.
    pub(super) fn take(&mut self, bytes: usize) -> bool {
        let used_bytes = self.used_bytes.saturating_add(bytes as u64).saturating_add(MESSAGE_BYTES);
        let fits = used_bytes <= (self.room_bytes / SHARE).min(CHECK_BYTES);
        if fits {
            self.used_bytes = used_bytes;
        }
        fits
    }

    /// Checks the disk before a message of `bytes` bytes is written, and takes its room. Everything before must be in
    /// the file.
    ///
    /// # Errors
    /// After the message and `closing_bytes` for the end of the bag, less than `min_free_bytes` would be free.
    pub(super) fn check(
        &mut self,
        directory: &Path,
        min_free_bytes: u64,
        closing_bytes: u64,
        bytes: usize,
    ) -> Result<(), RecordingError> {
        let used_bytes = (bytes as u64).saturating_add(MESSAGE_BYTES);
        let needed_bytes = closing_bytes.saturating_add(used_bytes.saturating_mul(SHARE));
        let free_bytes = place::require_space(directory, min_free_bytes, needed_bytes)?;
        let room_bytes = free_bytes - min_free_bytes - closing_bytes;
        *self = Self { room_bytes, used_bytes };
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_of_the_room_may_be_used_between_two_checks() {
        let mut space = Space::default();
        assert!(!space.take(0), "not checked yet");
        space.room_bytes = 4 * 1000;
        assert!(space.take(500 - MESSAGE_BYTES as usize));
        assert!(space.take(500 - MESSAGE_BYTES as usize));
        assert!(!space.take(0), "a quarter is used");
        space = Space { room_bytes: u64::MAX, used_bytes: 0 };
        assert!(!space.take(CHECK_BYTES as usize), "others use the disk, too");
        assert!(!space.take(usize::MAX));
    }

    #[test]
    fn a_message_that_leaves_too_little_is_refused() {
        let place = tempfile::tempdir().unwrap();
        let mut space = Space::default();
        space.check(place.path(), 0, 0, 1000).unwrap();
        assert!(space.room_bytes > 0 && space.used_bytes > 1000);
        let free_bytes = place::free_bytes(place.path()).unwrap();
        // The disk may change meanwhile, by less than this.
        let closing_bytes = free_bytes + (1 << 40);
        assert!(space.check(place.path(), 0, closing_bytes, 0).is_err());
        assert!(space.check(place.path(), 0, u64::MAX, usize::MAX).is_err());
    }
}
