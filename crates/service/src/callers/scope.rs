//! Scopes of callers.

use std::fmt;
use std::str::FromStr;

/// The scope of a caller. Each scope includes those before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Scope {
    /// Read everything of its tenant: `GET` and `HEAD`.
    Read,
    /// Also upload, file jobs, cancel them and erase what its tenant stored.
    Submit,
    /// Also sign readings.
    Sign,
    /// Also manage keys and read the audit trail.
    Admin,
}

impl Scope {
    /// Every scope, from the narrowest.
    pub const ALL: [Scope; 4] = [Scope::Read, Scope::Submit, Scope::Sign, Scope::Admin];

    /// Its name on the command line, in the database and over HTTP.
    pub fn as_str(self) -> &'static str {
        match self {
            Scope::Read => "read",
            Scope::Submit => "submit",
            Scope::Sign => "sign",
            Scope::Admin => "admin",
        }
    }

    /// Whether a caller with this scope may do what `needed` stands for.
    pub fn includes(self, needed: Scope) -> bool {
        self >= needed
    }
}

/// A word is not the name of a scope.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("give one of read, submit, sign, admin")]
pub struct InvalidScope;

impl FromStr for Scope {
    type Err = InvalidScope;

    fn from_str(name: &str) -> Result<Self, InvalidScope> {
        let named = |scope: &Scope| scope.as_str() == name;
        Self::ALL.into_iter().find(named).ok_or(InvalidScope)
    }
}

impl fmt::Display for Scope {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_scope_includes_the_narrower_ones_only() {
        for (index, scope) in Scope::ALL.into_iter().enumerate() {
            assert_eq!(scope.as_str().parse(), Ok(scope));
            for (other, needed) in Scope::ALL.into_iter().enumerate() {
                assert_eq!(scope.includes(needed), other <= index, "{scope} {needed}");
            }
        }
        assert_eq!("Admin".parse::<Scope>(), Err(InvalidScope));
    }
}
