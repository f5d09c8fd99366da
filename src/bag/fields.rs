//! Parser of the fields of a record's body. The mcap crate's parser allocates the length that a string states, up to
//! 4 GiB; this one never reads or allocates more than the body holds.

use std::collections::BTreeMap;

/// The unread rest of a record's body.
pub(super) struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    pub(super) fn of(body: &'a [u8]) -> Self {
        Self(body)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(super) fn bytes(&mut self, length: u64) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(usize::try_from(length).ok()?)?;
        self.0 = rest;
        Some(taken)
    }

    fn array<const LEN: usize>(&mut self) -> Option<[u8; LEN]> {
        let (taken, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*taken)
    }

    pub(super) fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    pub(super) fn string(&mut self) -> Option<String> {
        let length = self.u32()?;
        String::from_utf8(self.bytes(length.into())?.to_vec()).ok()
    }

    /// Texts by key. `None` if a key occurs twice.
    pub(super) fn string_map(&mut self) -> Option<BTreeMap<String, String>> {
        self.map(|entry| Some((entry.string()?, entry.string()?)))
    }

    /// Numbers by channel. `None` if a channel occurs twice.
    pub(super) fn channel_map(&mut self) -> Option<BTreeMap<u16, u64>> {
        self.map(|entry| Some((entry.u16()?, entry.u64()?)))
    }

    fn map<K: Ord, V>(&mut self, entry: fn(&mut Self) -> Option<(K, V)>) -> Option<BTreeMap<K, V>> {
        let length = self.u32()?;
        let mut entries = Self(self.bytes(length.into())?);
        let mut map = BTreeMap::new();
        while !entries.is_empty() {
            let (key, value) = entry(&mut entries)?;
            if map.insert(key, value).is_some() {
                return None;
            }
        }
        Some(map)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_taken_in_their_order() {
        let body = [
            1, 0, 2, 0, 0, 0, 3, 0, 0, 0, b'a', b'b', b'c', 10, 0, 0, 0, 7, 0, 9, 0, 0, 0, 0, 0, 0,
            0,
        ];
        let mut fields = Fields::of(&body);
        assert_eq!((fields.u16(), fields.u32()), (Some(1), Some(2)));
        assert_eq!(fields.string().as_deref(), Some("abc"));
        assert_eq!(fields.channel_map(), Some([(7, 9)].into()));
        assert!(fields.is_empty());
        assert_eq!(fields.u16(), None);
    }

    #[test]
    fn a_length_beyond_the_body_takes_nothing() {
        assert_eq!(Fields::of(&[255, 255, 255, 255, b'a']).string(), None);
        assert_eq!(Fields::of(&[255, 255, 255, 127]).string_map(), None);
        assert_eq!(Fields::of(&[0; 4]).bytes(u64::MAX), None);
    }

    #[test]
    fn a_repeated_key_is_refused() {
        let entry = [1, 0, 0, 0, b'k', 0, 0, 0, 0];
        let body = [&[18, 0, 0, 0][..], &entry, &entry].concat();
        assert_eq!(Fields::of(&body).string_map(), None);
        assert_eq!(
            Fields::of(&[9, 0, 0, 0].into_iter().chain(entry).collect::<Vec<_>>())
                .string_map()
                .unwrap()
                .len(),
            1
        );
    }
}
