//! Unique identifiers without a clock or chance: UUIDs of version 8 (RFC 9562) from SHA-256, in
//! the root 2.25 (PS3.5 B.2).

use sha2::{Digest, Sha256};

/// Identifiers of the objects of one result.
#[derive(Debug, Clone)]
pub struct Uids {
    seed: [u8; 32],
}

impl Uids {
    /// Identifiers that depend on everything that decides the bytes of the objects: `fill` passes
    /// it on, piece by piece.
    pub fn over_all(fill: impl FnOnce(&mut dyn FnMut(&[u8]))) -> Self {
        let mut hash = Sha256::new();
        fill(&mut |bytes| {
            hash.update((bytes.len() as u64).to_le_bytes());
            hash.update(bytes);
        });
        Self {
            seed: hash.finalize().into(),
        }
    }

    /// The identifier called `name`.
    pub fn uid(&self, name: &str) -> String {
        self.over(name, &[])
    }

    /// The identifier called `name` of an object with further `content`.
    pub fn over(&self, name: &str, content: &[u8]) -> String {
        derived(&[&self.seed, name.as_bytes(), content])
    }
}

/// The identifier that belongs to `parts`.
pub fn derived(parts: &[&[u8]]) -> String {
    format!("2.25.{}", uuid(parts))
}

/// The same identifier as a URN (RFC 9562).
pub fn derived_urn(parts: &[&[u8]]) -> String {
    let digits = format!("{:032x}", uuid(parts));
    let mut urn = "urn:uuid".to_owned();
    for (range, before) in [
        (0..8, ':'),
        (8..12, '-'),
        (12..16, '-'),
        (16..20, '-'),
        (20..32, '-'),
    ] {
        urn.push(before);
        urn.push_str(&digits[range]);
    }
    urn
}

fn uuid(parts: &[&[u8]]) -> u128 {
    let mut hash = Sha256::new();
    for part in parts {
        hash.update((part.len() as u64).to_le_bytes());
        hash.update(part);
    }
    let digest = hash.finalize();
    let mut uuid = [0; 16];
    uuid.copy_from_slice(&digest[..16]);
    uuid[6] = 0x80 | uuid[6] & 0x0f;
    uuid[8] = 0x80 | uuid[8] & 0x3f;
    u128::from_be_bytes(uuid)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::values::is_uid;

    #[test]
    fn identifiers_are_valid_and_depend_on_every_part() {
        let uid = derived(&[b"a", b"b"]);
        assert!(is_uid(&uid), "{uid}");
        assert_eq!(uid, derived(&[b"a", b"b"]));
        assert_ne!(uid, derived(&[b"ab", b""]));
        let urn = derived_urn(&[b"a", b"b"]);
        let digits = urn.strip_prefix("urn:uuid:").unwrap().replace('-', "");
        let number = u128::from_str_radix(&digits, 16).unwrap();
        assert_eq!(uid, format!("2.25.{number}"));
        assert_eq!((urn.len(), &urn[23..24]), (45, "8"));
    }
}
