//! Tenants: the owners of jobs and stored items. What belongs to one tenant does not exist for
//! another.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Longest name of a tenant, characters.
const NAME_LENGTH: usize = 64;

/// The tenant of everything that is stored without naming one.
const DEFAULT_NAME: &str = "default";

/// A tenant's name: 1 to 64 characters of `a-z`, `0-9`, `-` and `_`.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Tenant(String);

/// A text is not a tenant's name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a tenant's name has 1 to {NAME_LENGTH} characters of a-z, 0-9, - and _")]
pub struct InvalidTenant;

impl Tenant {
    /// The name.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl Default for Tenant {
    fn default() -> Self {
        Self(DEFAULT_NAME.to_owned())
    }
}

impl TryFrom<String> for Tenant {
    type Error = InvalidTenant;

    fn try_from(name: String) -> Result<Self, InvalidTenant> {
        let allowed = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b"-_".contains(&b);
        if (1..=NAME_LENGTH).contains(&name.len()) && name.bytes().all(allowed) {
            Ok(Self(name))
        } else {
            Err(InvalidTenant)
        }
    }
}

impl FromStr for Tenant {
    type Err = InvalidTenant;

    fn from_str(name: &str) -> Result<Self, InvalidTenant> {
        Self::try_from(name.to_owned())
    }
}

impl From<Tenant> for String {
    fn from(tenant: Tenant) -> Self {
        tenant.0
    }
}

impl fmt::Display for Tenant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_short_names_of_plain_characters_are_tenants() {
        assert_eq!(Tenant::default(), "default".parse().unwrap());
        let longest = "a".repeat(NAME_LENGTH);
        for name in ["a", "clinic-2_b", longest.as_str()] {
            assert_eq!(name.parse::<Tenant>().unwrap().as_str(), name);
        }
        let too_long = "a".repeat(NAME_LENGTH + 1);
        for name in ["", "A", "a b", "a/b", "ä", "a\n", too_long.as_str()] {
            assert_eq!(name.parse::<Tenant>(), Err(InvalidTenant), "{name:?}");
        }
        assert!(serde_json::from_str::<Tenant>("\"A\"").is_err());
    }
}
