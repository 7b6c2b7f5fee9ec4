//! Ids: derived from the content, or random and ordered by time.

use sha2::{Digest, Sha256};

/// `prefix` followed by the first 128 bits of the SHA-256 of `parts`, as 32 hexadecimal digits.
/// Each part is hashed with its length, so `["ab", "c"]` and `["a", "bc"]` give different ids.
pub fn content_id<'a>(prefix: &str, parts: impl IntoIterator<Item = &'a [u8]>) -> String {
    let mut hash = Sha256::new();
    for part in parts {
        hash.update((part.len() as u64).to_le_bytes());
        hash.update(part);
    }
    let digest = hash.finalize();
    format!("{prefix}{}", hex(&digest[..16]))
}

/// `prefix` followed by a UUID of version 7 (random, ordered by time).
pub fn random_id(prefix: &str) -> String {
    format!("{prefix}{}", uuid::Uuid::now_v7().simple())
}

pub(crate) fn hex(bytes: &[u8]) -> String {
    use std::fmt::Write;
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_boundaries_of_parts_change_the_id() {
        let id = |parts: &[&str]| content_id("vol_", parts.iter().map(|p| p.as_bytes()));
        assert_eq!(id(&["ab", "c"]), id(&["ab", "c"]));
        assert_ne!(id(&["ab", "c"]), id(&["a", "bc"]));
        assert_eq!(id(&["ab"]).len(), "vol_".len() + 32);
    }
}
