//! A change that is made for somebody, and its row of the audit trail, are one transaction: every method of the store
//! that writes either appends a row in its transaction, or is listed here with the reason why it needs none.
//!
//! `changes_and_their_rows_are_one` (tests/api/contract.rs) shows on both engines that those with a row undo the change
//! if the row cannot be written. Nobody but the recorder appends rows that belong to no change.

use crate::imports::rust_files;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// The methods that write without a row, and why.
const WITHOUT_ROW: &[(&str, &str)] = &[
    // What the service does of itself, with what was ordered under a row.
    ("tables/archives.rs: note_series", "what was fetched"),
    ("tables/archives.rs: pull_begun", "counts an attempt"),
    ("tables/archives.rs: pull_failed", "will be tried again"),
    ("tables/errands.rs: errand_begun", "counts an attempt"),
    ("tables/errands.rs: recall", "corrects a pause"),
    ("tables/hooks.rs: expire", "gives up messages"),
    (
        "tables/hooks.rs: settle",
        "a message, which says no more than ids",
    ),
    (
        "tables/intake.rs: failed",
        "of received objects, which have a row",
    ),
    (
        "tables/intake.rs: filed",
        "the job and the volume have rows",
    ),
    ("tables/intake.rs: made", "the volume has a row"),
    ("tables/intake.rs: released", "the volume has a row"),
    (
        "tables/jobs.rs: abandon",
        "a worker; the job's filing has a row",
    ),
    (
        "tables/jobs.rs: claim",
        "a worker; the job's filing has a row",
    ),
    (
        "tables/jobs.rs: crashed",
        "a worker; the job's filing has a row",
    ),
    (
        "tables/jobs.rs: finish",
        "a worker; the job's filing has a row",
    ),
    (
        "tables/jobs.rs: hand_back",
        "a worker; the job's filing has a row",
    ),
    (
        "tables/jobs.rs: progress",
        "a worker; the job's filing has a row",
    ),
    ("tables/jobs.rs: release_dead", "leases of dead workers"),
    (
        "tables/jobs.rs: renew_lease",
        "a worker; the job's filing has a row",
    ),
    (
        "tables/scans.rs: note_scan",
        "read of a header after a repair",
    ),
    // Secrets that are made once, when they are first needed.
    ("tables/hooks.rs: signing_secret", "made once"),
    ("tables/scans.rs: deidentification_secret", "made once"),
    // Marks of the store itself, and of the processes on it.
    ("tables/access.rs: close_access", "in doubt, closed"),
    ("tables/custody.rs: amend", "the size of files"),
    ("tables/marks.rs: mark", "marks of the store"),
    ("tables/peers.rs: change_place", "a migration"),
    ("tables/peers.rs: heartbeat", "a process lives"),
    ("tables/peers.rs: lead", "a process leads"),
    ("tables/peers.rs: leave", "a process ends"),
    ("tables/peers.rs: note_place", "where the files are"),
    ("tables/peers.rs: pin", "a request reads"),
    ("tables/peers.rs: tidy", "dead processes"),
    ("tables/peers.rs: unpin", "a request has read"),
    ("tables/times.rs: note_trusted", "the time"),
    // Derived from rows that are there.
    ("tables/totals.rs: recount", "sums of rows that have theirs"),
    (
        "tables/owners.rs: restore_sources",
        "from the product's row",
    ),
    ("tables/owners.rs: restore_tombstones", "from receipts"),
    (
        "tables/scan_erasure.rs: plan_scan_erasure",
        "reads under the lock",
    ),
    // The rows of the trail themselves.
    ("missed.rs: take_over", "rows of a newer trail, as they are"),
];

/// What a method calls that appends a row to its transaction.
const ROWS: [&str; 7] = [
    "record(&muttransaction",
    "record_outcome(&muttransaction",
    "record_first(&muttransaction",
    "append(&muttransaction",
    "write_receipt(&muttransaction",
    // Both end with a receipt.
    "erase(&muttransaction",
    // The trail's own methods.
    "append(to",
];

/// What a method does that writes.
const WRITES: [&str; 5] = [
    "writer.begin()",
    ".write(&self",
    ".write_all(&self",
    ".write_optional(&self",
    ".write_beside(&self",
];

/// Who appends rows by themselves: the recorder, for what is read or refused; a repair, to a draft that nobody uses
/// yet; a command, for the end of a trail that was followed.
const APPENDERS: [&str; 3] = [
    "crates/service/src/callers/audit/recorder.rs",
    "crates/store/src/doctor.rs",
    "crates/store/src/missed.rs",
];

/// The code of a file without comments, tests and white space between words.
fn code(file: &Path) -> String {
    let text = fs::read_to_string(file).expect("a source");
    let code = text.split("#[cfg(test)]").next().unwrap_or_default();
    let lines = code.lines().map(str::trim);
    let lines = lines.filter(|line| !line.starts_with("//"));
    lines.collect::<Vec<_>>().join("\n")
}

/// The functions of a file with what follows each up to the next, without white space.
fn functions(file: &Path) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    for part in code(file).split("fn ").skip(1) {
        let end = part.find(['(', '<']).unwrap_or_default();
        let body: String = part.split_whitespace().collect();
        found.insert(part[..end].to_owned(), body);
    }
    found
}

#[test]
fn every_write_of_the_store_has_a_row_of_the_trail_or_needs_none() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/store/src");
    let mut files = rust_files(&root.join("tables"));
    files.extend(["missed.rs", "sqlite_repair.rs"].map(|name| root.join(name)));
    let (mut without, mut with) = (BTreeSet::new(), 0);
    for file in files {
        let name = file.strip_prefix(&root).expect("below the root");
        let name = name.display().to_string().replace('\\', "/");
        for (function, body) in functions(&file) {
            let any = |texts: &[&str]| texts.iter().any(|text| body.contains(text));
            if any(&WRITES) && !any(&ROWS) {
                without.insert(format!("{name}: {function}"));
            } else if any(&WRITES) {
                with += 1;
            }
        }
    }
    let listed = WITHOUT_ROW.iter().map(|(name, _)| (*name).to_owned());
    assert_eq!(without, listed.collect());
    assert!(with > 30, "{with}");
}

#[test]
fn rows_are_appended_by_themselves_by_nobody_else() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = BTreeSet::new();
    for folder in [
        "crates/service/src",
        "crates/store/src",
        "crates/http/src",
        "src",
    ] {
        for file in rust_files(&root.join(folder)) {
            let code: String = code(&file).split_whitespace().collect();
            if ["rows.append(&", "store.append(&", "self.append(&"]
                .iter()
                .any(|call| code.contains(call))
            {
                let name = file.strip_prefix(root).expect("below the root");
                found.insert(name.display().to_string().replace('\\', "/"));
            }
        }
    }
    assert_eq!(found, APPENDERS.map(str::to_owned).into());
}
