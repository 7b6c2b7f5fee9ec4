//! The systems that may send, as the operator lists them.

use crate::base::records::Tenant;
use ipnet::IpNet;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::net::IpAddr;
use std::str::FromStr;

/// Longest AE title (PS3.5, 6.2).
const AE_TITLE_LENGTH: usize = 16;

/// An application entity title: 1 to 16 printable ASCII characters without backslash, not only
/// spaces; spaces at its ends have no meaning.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct AeTitle(String);

impl AeTitle {
    /// The title without spaces at its ends.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// The title in a PDU. PS3.8 pads titles with spaces at the end; older systems also pad at the start,
    /// with NUL, or copy a C string and whatever lies behind its end.
    ///
    /// # Errors
    /// If nothing is left, or it is no title.
    pub fn of_pdu(field: &str) -> Result<Self, &'static str> {
        let title = field.trim_start_matches([' ', '\0']);
        title.split('\0').next().unwrap_or_default().parse()
    }
}

impl FromStr for AeTitle {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let title = text.trim_matches(' ');
        let allowed = |b: u8| (b' '..=b'~').contains(&b) && b != b'\\';
        if (1..=AE_TITLE_LENGTH).contains(&title.len()) && title.bytes().all(allowed) {
            Ok(Self(title.to_owned()))
        } else {
            Err("an AE title has 1 to 16 ASCII characters without backslash")
        }
    }
}

impl TryFrom<String> for AeTitle {
    type Error = &'static str;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        text.parse()
    }
}

impl From<AeTitle> for String {
    fn from(title: AeTitle) -> Self {
        title.0
    }
}

impl fmt::Display for AeTitle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// A system that may send objects by C-STORE.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sender {
    /// Its calling AE title.
    pub ae_title: AeTitle,
    /// Addresses and networks that it calls from; none stands for any.
    #[serde(default, skip_serializing_if = "Vec::is_empty", with = "networks")]
    pub addresses: Vec<IpNet>,
    /// The tenant to which its objects belong.
    #[serde(default)]
    pub tenant: Tenant,
}

/// Networks and single addresses as text.
mod networks {
    use ipnet::IpNet;
    use serde::{Deserialize, Deserializer, Serializer};
    use std::net::IpAddr;

    pub fn serialize<S: Serializer>(networks: &[IpNet], to: S) -> Result<S::Ok, S::Error> {
        to.collect_seq(networks.iter().map(IpNet::to_string))
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<IpNet>, D::Error> {
        let texts = Vec::<String>::deserialize(from)?;
        let network = |text: &String| {
            let range = text.parse::<IpNet>().ok();
            range
                .or_else(|| text.parse::<IpAddr>().ok().map(IpNet::from))
                .ok_or_else(|| {
                    serde::de::Error::custom(format!(
                        "`{text}` is no address or network such as `10.0.0.0/8` or `192.0.2.1`"
                    ))
                })
        };
        texts.iter().map(network).collect()
    }
}

/// Who may send, and whose the objects are.
#[derive(Debug, Clone)]
pub struct Senders {
    /// The listed systems.
    pub listed: Vec<Sender>,
    /// Whether others may send too, for the default tenant.
    pub others: bool,
}

impl Senders {
    /// The tenant of a caller's objects; `None` if it may not send.
    pub fn tenant_of(&self, calling: &AeTitle, address: IpAddr) -> Option<Tenant> {
        let address = address.to_canonical();
        let mut named = self.listed.iter().filter(|s| s.ae_title == *calling);
        let known = named.find(|sender| {
            sender.addresses.is_empty() || sender.addresses.iter().any(|n| n.contains(&address))
        });
        match known {
            Some(sender) => Some(sender.tenant.clone()),
            // A title that is listed is not taken from elsewhere.
            None if self.listed.iter().any(|s| s.ae_title == *calling) => None,
            None => self.others.then(Tenant::default),
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

    fn sender(ae_title: &str, addresses: &[&str], tenant: &str) -> Sender {
        Sender {
            ae_title: ae_title.parse().unwrap(),
            addresses: addresses.iter().map(|n| n.parse().unwrap()).collect(),
            tenant: tenant.parse().unwrap(),
        }
    }

    #[test]
    fn a_sender_is_told_by_its_title_and_its_address() {
        let mut senders = Senders {
            listed: vec![
                sender("CAMERA", &["10.1.0.0/16"], "nuclear"),
                sender("CAMERA", &["10.2.0.0/16"], "branch"),
                sender("PACS", &[], "default"),
            ],
            others: false,
        };
        let tenant = |senders: &Senders, title: &str, address: &str| {
            let tenant = senders.tenant_of(&title.parse().unwrap(), address.parse().unwrap());
            tenant.map(String::from)
        };
        let of = |title, address| tenant(&senders, title, address);
        assert_eq!(of(" CAMERA ", "10.1.2.3").as_deref(), Some("nuclear"));
        assert_eq!(of("CAMERA", "::ffff:10.2.0.1").as_deref(), Some("branch"));
        assert_eq!(of("CAMERA", "10.3.0.1"), None);
        assert_eq!(of("camera", "10.1.2.3"), None);
        assert_eq!(of("PACS", "192.0.2.1").as_deref(), Some("default"));
        assert_eq!(of("OTHER", "10.1.2.3"), None);
        senders.others = true;
        assert_eq!(
            tenant(&senders, "OTHER", "10.1.2.3").as_deref(),
            Some("default")
        );
        assert_eq!(tenant(&senders, "CAMERA", "10.3.0.1"), None);
    }

    #[test]
    fn titles_are_short_and_printable() {
        for title in ["", "   ", "A\\B", "A\nB", "SEVENTEEN_LETTERS", "\u{e4}"] {
            assert!(title.parse::<AeTitle>().is_err(), "{title:?}");
        }
        assert_eq!(" A B ".parse::<AeTitle>().unwrap().as_str(), "A B");
    }

    #[test]
    fn titles_in_pdus_are_padded_in_many_ways() {
        for field in [
            "CAMERA          ",
            "          CAMERA",
            "CAMERA\0\0\0\0\0\0\0\0\0\0",
            "\0\0\0\0\0\0\0\0\0\0CAMERA",
            " \0 \0CAMERA \0 \0 ",
            "CAMERA\0\u{fffd}x~\n\\",
            "CAMERA",
        ] {
            assert_eq!(
                AeTitle::of_pdu(field).unwrap().as_str(),
                "CAMERA",
                "{field:?}"
            );
        }
        for none in ["", "                ", "\0\0", " \0 ", "A\nB", "A\\B"] {
            assert!(AeTitle::of_pdu(none).is_err(), "{none:?}");
        }
    }
}
