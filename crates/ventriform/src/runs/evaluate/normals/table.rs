//! `cohort.csv`: who is in a cohort of healthy people, and how each was scanned.
//!
//! One line for each scan, after a line with the names of the columns, in any order:
//!
//! | column | what it holds |
//! |---|---|
//! | `case` | a name, once in the table |
//! | `file` | the scan, by its path in the folder; gates of one beat for figures of beats |
//! | `sex` | `M` or `F` |
//! | `protocol` | kind of stress or rest, camera and filter, in words: people of one group have the same |
//! | `tracer` | the same; `simulated` in it marks the limits as simulated |
//! | `attenuation_corrected` | `yes` or `no` |
//! | `healthy` | `yes` or `no` |
//! | `rest_case` | of a scan at stress, the case that is the same person at rest (column may be missing) |

use crate::heart::normals::Sex;
use csv::StringRecord;
use std::path::{Component, Path};

/// The table's name in the folder.
pub const TABLE_FILE: &str = "cohort.csv";
/// Longest table that is read, bytes.
const MOST_BYTES: u64 = 4 << 20;
/// Most cases.
const MOST_CASES: usize = 5000;
/// Columns that must be there.
const REQUIRED_COLUMNS: [&str; 7] = [
    "case",
    "file",
    "sex",
    "protocol",
    "tracer",
    "attenuation_corrected",
    "healthy",
];

/// A line of the table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CohortRow {
    /// The name.
    pub case: String,
    /// The scan, by its path in the folder.
    pub file: String,
    /// The person's sex.
    pub sex: Sex,
    /// The protocol.
    pub protocol: String,
    /// The tracer.
    pub tracer: String,
    /// Whether attenuation was corrected.
    pub attenuation_corrected: bool,
    /// Whether the person is healthy.
    pub healthy: bool,
    /// The same person at rest.
    pub rest_case: Option<String>,
}

/// Why a table cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The file cannot be read.
    #[error("{TABLE_FILE} in {folder}: {reason}")]
    File {
        /// The folder.
        folder: String,
        /// Why.
        reason: String,
    },
    /// It is no CSV.
    #[error("{TABLE_FILE}: {0}")]
    Csv(#[from] csv::Error),
    /// A column is missing.
    #[error("{TABLE_FILE} has no column {column}; it needs {}", REQUIRED_COLUMNS.join(", "))]
    Column {
        /// The column.
        column: &'static str,
    },
    /// A value cannot be used.
    #[error("{TABLE_FILE}, line {line}: {column} is {value:?}; {needed}")]
    Value {
        /// The line, from 1.
        line: u64,
        /// The column.
        column: &'static str,
        /// The value.
        value: String,
        /// The advice.
        needed: &'static str,
    },
    /// There are too many lines.
    #[error("{TABLE_FILE} has more than {MOST_CASES} cases")]
    TooLong,
}

impl CohortRow {
    /// Whether the scan is simulated, as its tracer says.
    pub fn is_simulated(&self) -> bool {
        self.tracer.to_ascii_lowercase().contains("simulated")
    }
}

/// The lines of the table in `folder`, in their order.
///
/// # Errors
/// [`TableError`].
pub fn read(folder: &Path) -> Result<Vec<CohortRow>, TableError> {
    let unreadable = |reason: String| TableError::File {
        folder: folder.display().to_string(),
        reason,
    };
    let path = folder.join(TABLE_FILE);
    let bytes = std::fs::metadata(&path)
        .map_err(|error| unreadable(error.to_string()))?
        .len();
    if bytes > MOST_BYTES {
        return Err(unreadable(format!("it has more than {MOST_BYTES} bytes")));
    }
    let bytes = std::fs::read(&path).map_err(|error| unreadable(error.to_string()))?;
    parse(&bytes)
}

/// The lines of a table.
///
/// # Errors
/// [`TableError`].
pub fn parse(bytes: &[u8]) -> Result<Vec<CohortRow>, TableError> {
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_reader(bytes);
    let head = reader.headers()?.clone();
    let place = |name: &str| {
        head.iter()
            .position(|column| column.trim_start_matches('\u{feff}') == name)
    };
    for column in REQUIRED_COLUMNS {
        place(column).ok_or(TableError::Column { column })?;
    }
    let mut rows: Vec<CohortRow> = Vec::new();
    for record in reader.records() {
        let record = record?;
        let row = row(&record, &place)?;
        if rows.len() == MOST_CASES {
            return Err(TableError::TooLong);
        }
        if rows.iter().any(|other| other.case == row.case) {
            return Err(wrong(
                &record,
                "case",
                &row.case,
                "every case needs its own name",
            ));
        }
        rows.push(row);
    }
    Ok(rows)
}

fn wrong(
    record: &StringRecord,
    column: &'static str,
    value: &str,
    needed: &'static str,
) -> TableError {
    TableError::Value {
        line: record.position().map_or(0, csv::Position::line),
        column,
        value: value.to_owned(),
        needed,
    }
}

fn row(
    record: &StringRecord,
    place: &dyn Fn(&str) -> Option<usize>,
) -> Result<CohortRow, TableError> {
    let text = |column: &str| {
        place(column)
            .and_then(|at| record.get(at))
            .unwrap_or_default()
    };
    let named = |column: &'static str| match text(column) {
        "" => Err(wrong(record, column, "", "write what it is")),
        text => Ok(text.to_owned()),
    };
    let yes = |column: &'static str| match text(column).to_ascii_lowercase().as_str() {
        "yes" | "true" | "1" => Ok(true),
        "no" | "false" | "0" => Ok(false),
        other => Err(wrong(record, column, other, "write yes or no")),
    };
    let file = named("file")?;
    let inside = Path::new(&file)
        .components()
        .all(|part| matches!(part, Component::Normal(_)));
    if !inside {
        return Err(wrong(
            record,
            "file",
            &file,
            "write the path within the folder",
        ));
    }
    Ok(CohortRow {
        case: named("case")?,
        file,
        sex: Sex::parse(text("sex"))
            .ok_or_else(|| wrong(record, "sex", text("sex"), "write M or F"))?,
        protocol: named("protocol")?,
        tracer: named("tracer")?,
        attenuation_corrected: yes("attenuation_corrected")?,
        healthy: yes("healthy")?,
        rest_case: Some(text("rest_case").to_owned()).filter(|case| !case.is_empty()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER_LINE: &str = "case,file,sex,protocol,tracer,attenuation_corrected,healthy";

    fn parsed(lines: &str) -> Result<Vec<CohortRow>, TableError> {
        parse(format!("{HEADER_LINE}\n{lines}\n").as_bytes())
    }

    #[test]
    fn lines_are_read_in_their_order() {
        let rows =
            parsed("a,a/s.nii.gz,M,stress,Tc (simulated),no,yes\nb,b.nii,female,rest,Tl,YES,no")
                .unwrap();
        assert_eq!((rows[0].sex, rows[1].sex), (Sex::M, Sex::F));
        assert!(rows[0].healthy && !rows[1].healthy && rows[1].attenuation_corrected);
        assert!(rows[0].is_simulated() && !rows[1].is_simulated());
    }

    #[test]
    fn what_cannot_be_used_is_named_with_its_line() {
        for (line, column) in [
            ("a,../s.nii,M,p,t,no,yes", "file"),
            ("a,/s.nii,M,p,t,no,yes", "file"),
            ("a,s.nii,X,p,t,no,yes", "sex"),
            ("a,s.nii,M,,t,no,yes", "protocol"),
            ("a,s.nii,M,p,t,maybe,yes", "attenuation_corrected"),
            ("a,s.nii,M,p,t,no,", "healthy"),
            ("b,s.nii,M,p,t,no,no\nb,s.nii,M,p,t,no,no", "case"),
        ] {
            let error = parsed(line).unwrap_err().to_string();
            assert!(error.contains(column) && error.contains("line"), "{error}");
        }
        let missing = parse(b"case,file\na,b\n").unwrap_err().to_string();
        assert!(missing.contains("no column sex"), "{missing}");
    }
}
