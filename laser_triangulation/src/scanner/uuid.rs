//! Identities that equal inputs reproduce.

/// The UUID of version 8 (RFC 9562) made of the first 16 bytes of a SHA-256 digest.
pub fn uuid_v8(digest: &[u8; 32]) -> [u8; 16] {
    let mut id = [0; 16];
    id.copy_from_slice(&digest[..16]);
    id[6] = id[6] & 0x0f | 0x80;
    id[8] = id[8] & 0x3f | 0x80;
    id
}
