//! Where a database on a server is: the URL, and the limits of its connections.

use std::fmt::{self, Debug, Display, Formatter};
use std::str::FromStr;
use std::time::Duration;
use url::Url;

/// The address of a server, and the means of reaching it.
#[derive(Debug, Clone, PartialEq)]
pub struct PostgresSettings {
    /// Where it is, and who connects.
    pub url: PostgresUrl,
    /// Largest number of connections.
    pub connections: u32,
    /// Time for which the start waits for the server.
    pub patience: Duration,
}

/// The URL of a database: `postgres://user:password@host:port/name`. Printed without the password.
#[derive(Clone, PartialEq, Eq)]
pub struct PostgresUrl(String);

impl FromStr for PostgresUrl {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = ["postgres://", "postgresql://"];
        if !known.iter().any(|scheme| text.starts_with(scheme)) {
            return Err("give a URL such as postgres://user@host:5432/database".into());
        }
        if text.contains("password=") {
            return Err("write the password before the @, or give it as PGPASSWORD".into());
        }
        // The parser's message may show parts of the URL.
        let url = Url::parse(text).map_err(|_| {
            "it is not a valid URL of PostgreSQL; characters such as @ : / in a name or password are written \
             as %40 %3A %2F"
        })?;
        let no_path = url.path().trim_start_matches('/').is_empty();
        let in_query =
            (url.query_pairs()).any(|(name, value)| name == "dbname" && !value.is_empty());
        if no_path && !in_query {
            return Err("name the database: postgres://user@host:5432/database".into());
        }
        Ok(Self(text.to_owned()))
    }
}

impl PostgresUrl {
    /// The URL as it was given, for the driver alone: it may hold a password.
    pub fn with_password(&self) -> &str {
        &self.0
    }
}

impl Display for PostgresUrl {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let start = self.0.find("://").map_or(0, |colon| colon + 3);
        let (scheme, rest) = self.0.split_at(start);
        let authority = rest.split(['/', '?', '#']).next().unwrap_or_default();
        let (user, place) = match authority.rfind('@') {
            Some(at) => (authority.split([':', '@']).next(), &rest[at..]),
            None => (None, rest),
        };
        write!(f, "{scheme}{}{place}", user.unwrap_or_default())
    }
}

impl Debug for PostgresUrl {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        Display::fmt(self, f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_url_is_checked_and_printed_without_its_password() {
        let url: PostgresUrl = "postgres://me:s3cret@db.example:5433/heart"
            .parse()
            .unwrap();
        assert_eq!(url.to_string(), "postgres://me@db.example:5433/heart");
        assert!(!format!("{url:?}").contains("s3cret"));
        for text in [
            "postgresql://db/heart",
            "postgres:///heart?host=/run/postgresql&user=me",
            "postgres://me@[::1]/heart?sslmode=verify-full&options=-csearch_path%3Dheart",
        ] {
            assert_eq!(text.parse::<PostgresUrl>().unwrap().to_string(), text);
        }
        for bad in [
            "",
            "heart",
            "mysql://a/b",
            "postgres://me@host:5432",
            "postgres://me@host:99999/x",
            "postgres://host/heart?password=s3cret",
        ] {
            let refused = bad.parse::<PostgresUrl>();
            assert!(refused.is_err(), "{bad}");
            assert!(!refused.unwrap_err().contains("99999"));
        }
    }
}
