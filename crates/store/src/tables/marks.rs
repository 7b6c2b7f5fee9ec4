//! What the store must not forget with one of its other tables: its identity, whether it asks for credentials, and the
//! newest row of the audit trail that another place names.

use super::rows;
use crate::database::{SqlStore, Transaction};
use crate::query::{Target, query};
use ventriform_service::base::records::{StoreResult, Timestamp};
use ventriform_service::callers::Anchor;

/// Name of the mark with the database's identity.
const STORE: &str = "store";
/// Name of the mark about credentials.
const ACCESS: &str = "access";
/// Name of the mark with a row of the trail that another place names.
const KEPT_HEAD: &str = "kept_head";

/// Whether the service asks for credentials, as far as the marks say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Access {
    /// It has never done so.
    Open,
    /// It does.
    Closed,
    /// It did, until the operator opened it at that time.
    Opened(Timestamp),
}

impl Access {
    fn text(self) -> String {
        match self {
            Self::Open => "open".into(),
            Self::Closed => "closed".into(),
            Self::Opened(at) => format!("opened {at}"),
        }
    }

    /// What is no known word counts as closed.
    fn parse(text: &str) -> Self {
        let opened = text.strip_prefix("opened ").map(str::parse);
        match (text, opened) {
            ("open", _) => Self::Open,
            (_, Some(Ok(at))) => Self::Opened(at),
            _ => Self::Closed,
        }
    }
}

/// The marks of a database.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct Marks {
    /// Its identity; `None` before its first start, and if the marks were lost.
    pub store: Option<String>,
    /// Whether it asks for credentials.
    pub access: Option<Access>,
    /// A row of the trail that another place names.
    pub kept_head: Option<Anchor>,
}

/// The position and hash in `SEQUENCE:HASH`.
pub(crate) fn anchor_of(text: &str) -> Option<Anchor> {
    let (sequence, hash) = text.split_once(':')?;
    Some(Anchor {
        sequence: sequence.parse().ok()?,
        hash: hash.to_owned(),
    })
}

async fn set(to: &mut Transaction<'_>, name: &str, value: &str) -> StoreResult<()> {
    query(
        "INSERT INTO store_marks (name, value) VALUES ($1, $2)
         ON CONFLICT (name) DO UPDATE SET value = excluded.value",
    )
    .bind(name)
    .bind(value)
    .execute(to)
    .await?;
    Ok(())
}

/// Notes within a transaction whether credentials are asked for.
pub(super) async fn set_access(to: &mut Transaction<'_>, access: Access) -> StoreResult<()> {
    set(to, ACCESS, &access.text()).await
}

/// The row of the trail that another place names, if the trail lacked it.
pub(super) async fn kept_head(from: impl Into<Target<'_>> + Send) -> StoreResult<Option<Anchor>> {
    let row = query("SELECT value FROM store_marks WHERE name = $1")
        .bind(KEPT_HEAD)
        .fetch_optional(from)
        .await?;
    let text: Option<String> = row.map(|row| row.try_get(0)).transpose()?;
    Ok(text.as_deref().and_then(anchor_of))
}

impl SqlStore {
    /// The marks.
    pub(crate) async fn marks(&self) -> StoreResult<Marks> {
        let rows = query("SELECT name, value FROM store_marks")
            .fetch_all(&self.readers)
            .await?;
        let pairs = rows::all(rows, |row| {
            Ok((
                row.try_get::<String, _>("name")?,
                row.try_get::<String, _>("value")?,
            ))
        })?;
        let mut marks = Marks::default();
        for (name, value) in pairs {
            match name.as_str() {
                STORE => marks.store = Some(value),
                ACCESS => marks.access = Some(Access::parse(&value)),
                KEPT_HEAD => marks.kept_head = anchor_of(&value),
                _ => {}
            }
        }
        Ok(marks)
    }

    /// Writes the marks that are given.
    pub(crate) async fn mark(&self, marks: &Marks) -> StoreResult<()> {
        let mut transaction = self.writer.begin().await?;
        if let Some(store) = &marks.store {
            set(&mut transaction, STORE, store).await?;
        }
        if let Some(access) = marks.access {
            set_access(&mut transaction, access).await?;
        }
        if let Some(head) = &marks.kept_head {
            set(&mut transaction, KEPT_HEAD, &head.name()).await?;
            count_up_to(&mut transaction, head.sequence).await?;
        }
        transaction.commit().await
    }

    /// Whether anything in the database says that there was a key once: a row of a key, or an event of the trail.
    pub(crate) async fn had_keys(&self) -> StoreResult<bool> {
        let row = query(
            "SELECT EXISTS (SELECT 1 FROM api_keys) OR EXISTS (
                 SELECT 1 FROM audit WHERE json_extract(event, '$.key') IS NOT NULL
                     OR json_extract(event, '$.activity') IN ('key-created', 'key-revoked'))",
        )
        .on_postgres(
            "SELECT EXISTS (SELECT 1 FROM api_keys) OR EXISTS (
                 SELECT 1 FROM audit WHERE json_field(event, 'key') IS NOT NULL
                     OR json_field(event, 'activity') IN ('key-created', 'key-revoked'))",
        )
        .fetch_one(&self.readers)
        .await?;
        row.try_get(0)
    }
}

/// The next row of the audit trail has a greater number than `sequence`.
pub(crate) async fn count_up_to(to: &mut Transaction<'_>, sequence: i64) -> StoreResult<()> {
    query(
        "INSERT INTO sqlite_sequence (name, seq)
         SELECT 'audit', $1 WHERE NOT EXISTS (SELECT 1 FROM sqlite_sequence WHERE name = 'audit')",
    )
    .on_postgres("INSERT INTO audit_greatest (id, sequence) VALUES (1, $1) ON CONFLICT DO NOTHING")
    .bind(sequence)
    .execute(&mut *to)
    .await?;
    query("UPDATE sqlite_sequence SET seq = $1 WHERE name = 'audit' AND seq < $1")
        .on_postgres("UPDATE audit_greatest SET sequence = $1 WHERE sequence < $1")
        .bind(sequence)
        .execute(to)
        .await?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_read_as_they_are_written_and_other_words_close() {
        for access in [Access::Open, Access::Closed, Access::Opened(17)] {
            assert_eq!(Access::parse(&access.text()), access);
        }
        for damaged in ["", "opened", "opened soon", "OPEN"] {
            assert_eq!(Access::parse(damaged), Access::Closed, "{damaged}");
        }
    }
}
