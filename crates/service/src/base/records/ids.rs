//! Ids: derived from the content, or random and ordered by time.

use super::{FileRecord, Resource};
use sha2::{Digest, Sha256};
pub use ventriform::base::text::hex;

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

/// The id of a volume of these files. Of one file: the first 32 digits of its SHA-256. Of several:
/// the same of the list of their kinds and hashes; the kind is the name from its first dot on.
pub fn volume_id(files: &[FileRecord]) -> String {
    let prefix = Resource::Volume.prefix();
    if let [file] = files {
        return format!("{prefix}{}", file.sha256.get(..32).unwrap_or_default());
    }
    let mut hash = Sha256::new();
    for file in files {
        let kind = file.name.split_once('.').map_or("", |(_, kind)| kind);
        hash.update(format!("{kind}:{}\n", file.sha256));
    }
    format!("{prefix}{}", hex(&hash.finalize()[..16]))
}

/// `prefix` followed by a UUID of version 7 (random, ordered by time).
pub fn random_id(prefix: &str) -> String {
    format!("{prefix}{}", uuid::Uuid::now_v7().simple())
}

/// 32 random bytes: the SHA-256 of three random UUIDs, 366 random bits.
pub fn random_key() -> [u8; 32] {
    let mut hash = Sha256::new();
    for _ in 0..3 {
        hash.update(uuid::Uuid::new_v4().as_bytes());
    }
    hash.finalize().into()
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
