//! Where a clock is read and where an age is counted: exact lists, so that no new one is forgotten.
//!
//! Ages count by a trusted clock only (`base/records/clock.rs` of the service): a method that erases, gives up or forgets
//! what is old takes a `Cutoff` or a `TrustedNow`, which only a trusted clock makes. The compiler watches that; here is
//! who does so, who reads a clock that is not trusted and why, and which statements compare stamps.

use crate::imports::rust_files;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// The crates and folders that are searched.
const SEARCHED: [&str; 5] = [
    "crates/service/src",
    "crates/store/src",
    "crates/http/src",
    "crates/http_client/src",
    "src",
];

/// Who reads the clock of the machine, and what for. None of these is an age.
const RAW_CLOCKS: &[(&str, &str)] = &[
    (
        "crates/http/src/edge/connections/requests.rs",
        "the header Date",
    ),
    (
        "crates/http/src/edge/observe.rs",
        "ids of requests sort by time",
    ),
    (
        "crates/service/src/base/records/clock.rs",
        "the clock itself",
    ),
    ("crates/service/src/base/records/mod.rs", "its name"),
    (
        "crates/service/src/base/records/service_clock.rs",
        "the clock of the service",
    ),
    ("crates/service/src/telemetry/spans.rs", "the end of a span"),
    (
        "crates/store/src/doctor.rs",
        "names of folders in the quarantine",
    ),
    (
        "crates/store/src/kept.rs",
        "the stamp of the note beside the database",
    ),
    (
        "crates/store/src/missed.rs",
        "stamps of what a command does",
    ),
    (
        "crates/store/src/s3/doctor.rs",
        "names of folders in the quarantine",
    ),
    ("src/cli/dicom_args.rs", "the date of a DICOM object"),
    ("src/cli/keys.rs", "stamps of keys that a command makes"),
    ("src/cli/library.rs", "stamps of what a command adds"),
    ("src/cli/log/plain_line.rs", "the time of a line of the log"),
];

/// Who subtracts from a time all the same.
const DIFFERENCES: &[(&str, &str)] = &[
    ("records/service_clock.rs", "the offset of two clocks"),
    ("s3/shared.rs", "both by the clock of the bucket"),
    ("tables/peers.rs", "in a statement that takes a TrustedNow"),
];

/// The functions that take a moment or a time by which ages count.
const AGES: &[&str] = &[
    "crates/service/src/callers/storage.rs: prune",
    "crates/service/src/network/hooks/schedule.rs: next",
    "crates/service/src/network/intake/record.rs: failed_before",
    "crates/service/src/network/intake/record.rs: kept",
    "crates/service/src/items/erase.rs: by_retention",
    "crates/service/src/items/erase.rs: new",
    "crates/service/src/base/records/blobs.rs: tidy",
    "crates/service/src/base/records/catalogue.rs: expired",
    "crates/service/src/base/records/peers.rs: tidy",
    "crates/service/src/base/records/time_store.rs: note_trusted",
    "crates/service/src/network/worklist/storage.rs: delete_ended_workitems",
];

/// The fields that hold such a moment.
const AGE_FIELDS: &[&str] = &[
    "crates/service/src/network/hooks/record.rs: ended_since",
    "crates/service/src/network/hooks/record.rs: pending_since",
    "crates/service/src/items/erase.rs: before",
    "crates/service/src/base/records/erasure.rs: renewed_before",
];

/// The statements that compare a stamp with a moment: the file, the column and the comparison, and by which time.
const COMPARISONS: &[(&str, &str)] = &[
    // Whether a key is valid.
    ("tables/access.rs: expires_at >", "valid keys"),
    // Two stamps of one store.
    (
        "tables/access.rs: created_at >",
        "a key from after the operator opened the service",
    ),
    (
        "kept.rs: noted_at <=",
        "a note from before the store was opened",
    ),
    // By an age.
    ("tables/access.rs: recorded >=", "Cutoff of the retention"),
    ("tables/catalogue.rs: {since} <", "Cutoff of the retention"),
    ("tables/erasure.rs: renewed_at <", "Cutoff of the retention"),
    ("tables/hooks.rs: since <", "Cutoff of the greatest age"),
    ("tables/hooks.rs: ended_at <", "Cutoff of the history"),
    ("tables/intake.rs: changed_at <", "Cutoff of what is kept"),
    (
        "tables/worklist.rs: changed_at <",
        "Cutoff of the retention",
    ),
    ("tables/peers.rs: given_up_at <", "takes a TrustedNow"),
    // By a pause, which a clock that was ahead cannot make longer: `recall`.
    ("tables/archives.rs: next_attempt_at <=", "a pause"),
    ("tables/hooks.rs: next_attempt_at <=", "a pause"),
    ("tables/errands.rs: next_attempt_at >", "recall"),
    ("tables/errands.rs: since >", "recall"),
    ("tables/errands.rs: last_attempt_at >", "recall"),
    // By a lease, whose loss loses nothing; by the clock of the database's server.
    ("tables/jobs.rs: lease_expires_at <=", "a lease"),
    ("tables/peers.rs: expires_at >", "a lease"),
    ("tables/peers.rs: expires_at <=", "a lease"),
    ("tables/peers.rs: expires_at <", "takes a TrustedNow"),
    // The later of two stamps; a secret that signs beside another one; what a caller asks for.
    ("tables/catalogue.rs: renewed_at >", "the later stamp"),
    ("tables/jobs.rs: renewed_at >", "the later stamp"),
    ("tables/hooks.rs: former_until >", "signs a while longer"),
    ("tables/scan_search.rs: created_at >", "asked for"),
    ("tables/scan_search.rs: created_at <", "asked for"),
];

/// The texts of the searched files without their tests.
fn sources() -> impl Iterator<Item = (String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let files = SEARCHED.map(|folder| rust_files(&root.join(folder)));
    files.into_iter().flatten().map(move |file| {
        let text = fs::read_to_string(&file).expect("a source");
        let code = text.split("#[cfg(test)]").next().unwrap_or_default();
        let name = file.strip_prefix(root).expect("below the root");
        (
            name.display().to_string().replace('\\', "/"),
            code.to_owned(),
        )
    })
}

/// The lines that are no comments.
fn code_lines(text: &str) -> impl Iterator<Item = &str> {
    text.lines()
        .filter(|line| !line.trim_start().starts_with("//"))
}

#[test]
fn the_clock_of_the_machine_is_read_where_no_age_depends_on_it() {
    let reads = |line: &str| {
        ["SystemTime::now", "SystemClock", "now_utc", "Utc::now"]
            .iter()
            .any(|clock| line.contains(clock))
    };
    let found: BTreeSet<String> = sources()
        .filter(|(_, text)| code_lines(text).any(reads))
        .map(|(name, _)| name)
        .collect();
    let listed = RAW_CLOCKS.iter().map(|(name, _)| (*name).to_owned());
    assert_eq!(found, listed.collect());
}

#[test]
fn an_age_is_never_a_difference_of_two_numbers() {
    for (name, text) in sources() {
        let text: String = text.split_whitespace().collect();
        for difference in ["now().saturating_sub(", "now()-", "now.saturating_sub("] {
            let allowed = DIFFERENCES.iter().any(|(file, _)| name.ends_with(file));
            assert!(
                allowed || !text.contains(difference),
                "{name} counts an age by `{difference}`: use `Clock::trusted`"
            );
        }
    }
}

#[test]
fn whoever_takes_an_age_is_listed() {
    let (mut functions, mut fields) = (BTreeSet::new(), BTreeSet::new());
    for (name, text) in sources() {
        if !name.starts_with("crates/service/") || name.ends_with("records/clock.rs") {
            continue;
        }
        let mut last = String::new();
        let mut in_function = false;
        for line in code_lines(&text) {
            if let Some((_, rest)) = line.split_once("fn ") {
                let end = rest.find(['(', '<']).unwrap_or(rest.len());
                last = rest[..end].to_owned();
                in_function = true;
            }
            let takes = ["Cutoff", "TrustedNow"]
                .iter()
                .any(|kind| line.contains(kind));
            let is_use = line.contains("use ") || !line.contains(':');
            if takes && !is_use {
                let field = line.trim().trim_start_matches("pub ").split(':').next();
                match in_function {
                    true => functions.insert(format!("{name}: {last}")),
                    false => fields.insert(format!("{name}: {}", field.unwrap_or_default())),
                };
            }
            if line.ends_with(['{', ';']) {
                in_function = false;
            }
        }
    }
    let listed = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    assert_eq!(functions, listed(AGES));
    assert_eq!(fields, listed(AGE_FIELDS));
}

#[test]
fn every_statement_that_compares_stamps_is_listed() {
    let mut found = BTreeSet::new();
    for (name, text) in sources() {
        let Some(name) = name.strip_prefix("crates/store/src/") else {
            continue;
        };
        for line in code_lines(&text) {
            let words: Vec<&str> = line.split([' ', '"', '(', ')', ',']).collect();
            for pair in words.windows(2) {
                let column = pair[0].rsplit('.').next().unwrap_or_default();
                let is_stamp = column.ends_with("_at")
                    || column.ends_with("_until")
                    || ["since", "{since}", "recorded"].contains(&column);
                if is_stamp && ["<", "<=", ">", ">="].contains(&pair[1]) {
                    found.insert(format!("{name}: {column} {}", pair[1]));
                }
            }
        }
    }
    let listed = COMPARISONS
        .iter()
        .map(|(comparison, _)| (*comparison).to_owned());
    assert_eq!(found, listed.collect());
}
