//! Settings that are lists of tables: `[[senders]]` in the file, an array of inline tables as a flag or
//! variable.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Tables of one kind, in the order of the file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Tables<T>(pub Vec<T>);

/// A file with the tables alone.
#[derive(Serialize, Deserialize)]
struct Alone<T> {
    tables: Vec<T>,
}

impl<T: DeserializeOwned> FromStr for Tables<T> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let alone = toml::from_str::<Alone<T>>(&format!("tables = {text}"));
        match alone {
            Ok(alone) => Ok(Self(alone.tables)),
            Err(error) => Err(error.message().to_owned()),
        }
    }
}

impl<T: Serialize> fmt::Display for Tables<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match toml::Value::try_from(&self.0) {
            Ok(tables) => tables.fmt(f),
            Err(_) => Err(fmt::Error),
        }
    }
}

#[cfg(test)]
#[allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]
mod tests {
    use super::*;
    use crate::network::intake::{Rule, Sender};

    #[test]
    fn tables_read_back_as_printed() {
        let senders = r#"[{ ae_title = "CAMERA", addresses = ["10.0.0.1"], tenant = "nuclear" }]"#;
        let senders: Tables<Sender> = senders.parse().unwrap();
        assert_eq!(senders.0[0].tenant.as_str(), "nuclear");
        assert_eq!(senders.to_string().parse(), Ok(senders));
        let rules = r#"[{ modality = "NM", kind = "segmentation", parameters = { model = "auto", "step" = 0.5 } }]"#;
        let rules: Tables<Rule> = rules.parse().unwrap();
        assert_eq!(rules.to_string().parse(), Ok(rules));
        let none: Tables<Rule> = "[]".parse().unwrap();
        assert_eq!(none.to_string(), "[]");
    }

    #[test]
    fn what_is_wrong_in_a_table_is_named() {
        let read = |text: &str| text.parse::<Tables<Sender>>().unwrap_err();
        assert!(read(r#"[{ ae_title = "A", adresses = [] }]"#).contains("adresses"));
        assert!(read(r#"[{ ae_title = "A\\B" }]"#).contains("AE title"));
        assert!(read(r#"[{ ae_title = "A", addresses = ["nowhere"] }]"#).contains("nowhere"));
        assert!(read("yes").contains("expected"));
    }
}
