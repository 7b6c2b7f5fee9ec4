//! The archives of the settings file: `[[archives]]`.

use super::ConfigError;
use crate::base::records::Tenant;
use crate::network::archive::{Archive, Archives};
use std::path::Path;

/// The key of the file.
pub(super) const ARCHIVES_KEY: &str = "archives";

/// The key of an entry that holds a list.
const TENANTS_KEY: &str = "tenants";

/// Reads the entries.
///
/// # Errors
/// The first field that cannot be used.
pub(super) fn read(path: &Path, value: toml::Value) -> Result<Archives, ConfigError> {
    let error = |field: String, reason: String| ConfigError::BadField {
        path: path.to_owned(),
        field,
        reason,
    };
    let toml::Value::Array(entries) = value else {
        let reason = "write each archive under a heading `[[archives]]`";
        return Err(error(ARCHIVES_KEY.into(), reason.into()));
    };
    let mut archives = Archives::default();
    for (number, entry) in entries.iter().enumerate() {
        let at = |field: &str, reason: String| {
            error(format!("{ARCHIVES_KEY}[{number}].{field}"), reason)
        };
        let toml::Value::Table(entry) = entry else {
            return Err(at("name", "write `[[archives]]` before its keys".into()));
        };
        let mut tenants = Vec::new();
        for (key, value) in entry {
            match value {
                toml::Value::Array(names) if key == TENANTS_KEY => {
                    for name in names {
                        let name = name.as_str().unwrap_or_default().parse::<Tenant>();
                        tenants.push(name.map_err(|e| at(key, e.to_string()))?);
                    }
                    if names.is_empty() {
                        return Err(at(key, "leave it out to serve every tenant".into()));
                    }
                }
                _ if key == TENANTS_KEY => {
                    return Err(at(key, "it must be a list of names".into()));
                }
                toml::Value::String(_) if Archive::SETTING_KEYS.contains(&key.as_str()) => {}
                _ if Archive::SETTING_KEYS.contains(&key.as_str()) => {
                    return Err(at(key, "it must be a text in quotes".into()));
                }
                _ => {
                    let known = Archive::SETTING_KEYS.join(", ");
                    let reason = format!("there is no such key; known are {known}, {TENANTS_KEY}");
                    return Err(at(key, reason));
                }
            }
        }
        let given = |key: &str| entry.get(key).and_then(toml::Value::as_str);
        let archive =
            Archive::read(given, tenants).map_err(|fault| at(fault.field, fault.reason))?;
        if archives.0.iter().any(|other| other.name == archive.name) {
            let reason = format!("there is another archive called `{}`", archive.name);
            return Err(at("name", reason));
        }
        archives.0.push(archive);
    }
    Ok(archives)
}

/// The entries as TOML that reads back.
pub(super) fn print(archives: &Archives) -> String {
    let mut text = String::new();
    for archive in &archives.0 {
        text += &format!("\n[[{ARCHIVES_KEY}]]\n");
        for (key, value) in archive.entry() {
            text += &format!("{key} = {value:?}\n");
        }
        if !archive.tenants.is_empty() {
            let names: Vec<&str> = archive.tenants.iter().map(Tenant::as_str).collect();
            text += &format!("{TENANTS_KEY} = {names:?}\n");
        }
    }
    text
}
