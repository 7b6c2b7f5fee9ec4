//! The HTTP interface reaches rows and files by the use cases of the service alone.
//!
//! The traits of the store, and the methods by which the service hands one out, are read from the sources, so that this
//! holds for those that come.

use crate::imports::rust_files;
use crate::src;
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

/// The lines of code of these files, trimmed, without comments and unit tests.
fn code_in(files: &[PathBuf]) -> Vec<String> {
    let mut code = Vec::new();
    for path in files {
        let text = fs::read_to_string(path).expect("a source file");
        let lines = text.split("#[cfg(test)]").next().unwrap_or("").lines();
        let lines = lines.map(str::trim).filter(|line| !line.starts_with("//"));
        code.extend(lines.map(str::to_owned));
    }
    code
}

/// Those of the crate in `folder`.
fn code_of(folder: &str) -> Vec<String> {
    code_in(&rust_files(&src(folder)))
}

/// The names in a line of code.
fn names(line: &str) -> impl Iterator<Item = &str> {
    line.split(|c: char| !c.is_alphanumeric() && c != '_')
}

/// The traits of the service that the store implements.
fn store_traits(service: &[String]) -> BTreeSet<String> {
    let declared = service.iter().filter_map(|line| {
        let rest = line.strip_prefix("pub trait ")?;
        names(rest).next()
    });
    let declared: BTreeSet<&str> = declared.collect();
    let store = code_of("crates/store");
    let implemented = store.iter().filter_map(|line| {
        let (name, _) = line.strip_prefix("impl ")?.split_once(" for ")?;
        declared.get(name.rsplit("::").next()?)
    });
    implemented.map(|name| (*name).to_owned()).collect()
}

/// The public fields of the struct of that name in a file of the service.
fn public_fields(file: &str, name: &str) -> Vec<String> {
    let code = code_in(&[src("crates/service").join(file)]);
    let head = format!("pub struct {name} {{");
    let at = code.iter().position(|line| *line == head);
    let fields = &code[at.unwrap_or_else(|| panic!("no `{head}`")) + 1..];
    let fields = fields.iter().take_while(|line| *line != "}");
    let public = fields.filter(|line| line.starts_with("pub "));
    public.cloned().collect()
}

/// The public functions that hand out one of these traits.
fn handed_out(code: &[String], traits: &BTreeSet<String>) -> Vec<String> {
    let is_public =
        |line: &&String| line.starts_with("pub fn ") || line.starts_with("pub async fn ");
    let returns = |line: &&String| {
        let returned = line.split_once(" -> ").map_or("", |(_, returned)| returned);
        names(returned).any(|name| traits.contains(name))
    };
    let found = code.iter().filter(is_public).filter(returns);
    found.cloned().collect()
}

#[test]
fn http_reaches_the_tables_by_use_cases_alone() {
    let (service, http) = (code_of("crates/service"), code_of("crates/http"));
    let traits = store_traits(&service);
    assert!(traits.len() > 10, "{traits:?}");
    assert!(traits.contains("Catalogue") && traits.contains("BlobStore"));
    let named = http
        .iter()
        .filter(|line| names(line).any(|name| traits.contains(name)));
    assert_eq!(
        named.collect::<Vec<_>>(),
        Vec::<&String>::new(),
        "traits of the store in http"
    );
    assert_eq!(handed_out(&service, &traits), Vec::<String>::new());
    assert_eq!(
        public_fields("use_cases/service.rs", "Service"),
        Vec::<String>::new()
    );
    // The service is given its stores in a struct of such fields, which shows that they would be found.
    assert!(public_fields("config/stores.rs", "Stores").len() > 5);
}
