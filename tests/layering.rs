//! Who may know whom: the `use` lines of `src/` against the table of ARCHITECTURE.md.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Each module of the crate and the modules it may use. Order is reading order: a domain
/// module uses what stands above it.
const MAY_USE: &[(&str, &[&str])] = &[
    ("geometry", &[]),
    ("mesh", &["geometry"]),
    ("progress", &[]),
    ("volume", &["geometry", "mesh", "progress"]),
    ("surface", &["geometry", "mesh", "progress", "volume"]),
    ("retile", &["geometry", "mesh", "progress", "surface"]),
    (
        "optimise",
        &["geometry", "mesh", "progress", "surface", "retile"],
    ),
    ("decimate", &["geometry", "mesh", "progress"]),
    (
        "deform",
        &[
            "geometry", "mesh", "progress", "volume", "surface", "retile", "optimise",
        ],
    ),
    (
        "polar",
        &["geometry", "mesh", "progress", "volume", "deform"],
    ),
    (
        "evaluate",
        &["geometry", "mesh", "progress", "volume", "deform"],
    ),
    (
        "segmentation",
        &[
            "geometry", "mesh", "progress", "volume", "deform", "polar", "evaluate",
        ],
    ),
    (
        "report",
        &[
            "geometry", "mesh", "progress", "volume", "surface", "retile", "optimise", "deform",
        ],
    ),
    ("export", &["geometry", "mesh", "progress"]),
    (
        "parameters",
        &[
            "geometry", "progress", "volume", "surface", "retile", "optimise", "deform", "polar",
        ],
    ),
    (
        "pipeline",
        &[
            "geometry",
            "mesh",
            "progress",
            "volume",
            "surface",
            "retile",
            "optimise",
            "deform",
            "polar",
            "segmentation",
            "report",
            "export",
            "parameters",
        ],
    ),
    (
        "jobs",
        &[
            "geometry",
            "mesh",
            "progress",
            "volume",
            "surface",
            "retile",
            "optimise",
            "deform",
            "segmentation",
            "report",
            "export",
            "parameters",
            "pipeline",
        ],
    ),
    ("store", &["jobs"]),
    ("config", &["jobs", "volume"]),
    (
        "http",
        &[
            "config",
            "jobs",
            "store",
            "volume",
            "parameters",
            "report",
            "export",
            "pipeline",
        ],
    ),
    (
        "cli",
        &[
            "polar",
            "evaluate",
            "segmentation",
            "config",
            "http",
            "jobs",
            "store",
            "volume",
            "parameters",
            "pipeline",
            "report",
            "export",
            "progress",
            "deform",
            "mesh",
            "geometry",
            "surface",
            "retile",
            "optimise",
            "decimate",
        ],
    ),
];

/// Crates that only the service and the command line may name: the domain knows no network,
/// no database, no runtime, no terminal.
const SERVICE_CRATES: &[&str] = &[
    "axum",
    "axum_server",
    "tokio",
    "tokio_stream",
    "tokio_util",
    "tower",
    "tower_http",
    "sqlx",
    "object_store",
    "utoipa",
    "utoipa_axum",
    "utoipa_swagger_ui",
    "reqwest",
    "clap",
    "indicatif",
    "tracing",
    "tracing_subscriber",
    "uuid",
    "time",
    "futures",
    "bytes",
];

const SERVICE_MODULES: &[&str] = &["jobs", "store", "config", "http", "cli"];

/// Standard-library facilities that would make a result depend on more than its input.
const IMPURE: &[&str] = &["std::time", "std::env", "std::net", "HashMap", "HashSet"];

#[test]
fn modules_use_only_what_the_table_allows() {
    let allowed: BTreeMap<_, BTreeSet<_>> = MAY_USE
        .iter()
        .map(|(module, uses)| (*module, uses.iter().copied().collect()))
        .collect();
    let mut violations = Vec::new();
    for (module, path, line) in source_lines() {
        let Some(uses) = allowed.get(module.as_str()) else {
            violations.push(format!(
                "{}: module `{module}` is not in the table",
                path.display()
            ));
            continue;
        };
        for used in crate_modules_named(&line) {
            if used != module && !uses.contains(used.as_str()) {
                violations.push(format!(
                    "{}: `{module}` uses `{used}`: {line}",
                    path.display()
                ));
            }
        }
    }
    violations.dedup();
    assert!(violations.is_empty(), "{}", violations.join("\n"));
}

#[test]
fn the_domain_knows_no_service_and_no_clock() {
    let mut violations = Vec::new();
    for (module, path, line) in source_lines() {
        if SERVICE_MODULES.contains(&module.as_str()) {
            continue;
        }
        let named = SERVICE_CRATES
            .iter()
            .map(|name| format!("{name}::"))
            .chain(IMPURE.iter().map(|name| (*name).to_owned()));
        for name in named {
            let at_word = line.find(&name).is_some_and(|at| {
                !line[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':')
            });
            if at_word {
                violations.push(format!("{}: {line}", path.display()));
            }
        }
    }
    assert!(violations.is_empty(), "{}", violations.join("\n"));
}

#[test]
fn every_module_opens_with_its_method() {
    for path in rust_files(Path::new(env!("CARGO_MANIFEST_DIR")).join("src")) {
        let text = fs::read_to_string(&path).expect("a source file");
        assert!(
            text.starts_with("//!"),
            "{} has no module page",
            path.display()
        );
        assert!(!text.contains("STUB"), "{} is a stub", path.display());
    }
}

#[test]
fn the_finder_of_uses_finds_them() {
    assert_eq!(
        crate_modules_named("use crate::mesh::{self, TriMesh};"),
        ["mesh"]
    );
    assert_eq!(
        crate_modules_named("use crate::{mesh::TriMesh, volume};"),
        ["mesh", "volume"]
    );
    assert_eq!(
        crate_modules_named("let x = crate::http::serve();"),
        ["http"]
    );
    assert!(crate_modules_named("use super::mesh;").is_empty());
}

/// (top-level module, file, line) of every line of code in `src/`, tests and comments left
/// out.
fn source_lines() -> Vec<(String, PathBuf, String)> {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut lines = Vec::new();
    for path in rust_files(src.clone()) {
        let inside = path.strip_prefix(&src).expect("a path inside src");
        let module = inside
            .iter()
            .next()
            .and_then(|part| Path::new(part).file_stem())
            .map(|stem| stem.to_string_lossy().into_owned())
            .unwrap_or_default();
        if module == "lib" || module == "main" {
            continue;
        }
        let text = fs::read_to_string(&path).expect("a source file");
        let code = text.split("#[cfg(test)]\nmod tests").next().unwrap_or("");
        for line in code.lines().map(str::trim).filter(|l| !l.starts_with("//")) {
            lines.push((module.clone(), inside.to_owned(), line.to_owned()));
        }
    }
    assert!(!lines.is_empty());
    lines
}

/// Every source file but the `tests.rs` of modules whose tests fill a file of their own.
fn rust_files(folder: PathBuf) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder").flatten() {
        let path = entry.path();
        if path.is_dir() {
            files.extend(rust_files(path));
        } else if path.extension().is_some_and(|e| e == "rs") && !path.ends_with("tests.rs") {
            files.push(path);
        }
    }
    files.sort();
    files
}

/// The modules of this crate that a line names by `crate::...`.
fn crate_modules_named(line: &str) -> Vec<String> {
    let word = |text: &str| -> String {
        text.chars()
            .take_while(|c| c.is_alphanumeric() || *c == '_')
            .collect()
    };
    let mut found = Vec::new();
    for after in line.split("crate::").skip(1) {
        if let Some(group) = after.strip_prefix('{') {
            let mut depth = 0;
            let mut start = true;
            for (at, c) in group.char_indices() {
                match c {
                    '{' => depth += 1,
                    '}' => depth -= 1,
                    ',' if depth == 0 => start = true,
                    ' ' => {}
                    _ if start => {
                        found.push(word(&group[at..]));
                        start = false;
                    }
                    _ => {}
                }
                if depth < 0 {
                    break;
                }
            }
        } else {
            found.push(word(after));
        }
    }
    found.retain(|name| name.chars().next().is_some_and(|c| c.is_lowercase()));
    found
}
