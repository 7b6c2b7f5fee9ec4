//! What a store keeps outside of its database, to notice that the database lost rows or is an older copy: the file
//! `kept.json` in the data folder, and an object of that name in the bucket.
//!
//! In: the marks and the end of the audit trail in the database, and the notes beside it. Out: whether callers without
//! credentials are refused, and the newest row of the trail that is known.
//!
//! - The service is **closed** if the database or any note says so: a note outlives a damaged or restored database, and
//!   the marks outlive a damaged table of keys.
//! - It is **open** if a note says so that belongs to this database and lies where it was written, or if nothing was
//!   ever noted, as before the first start.
//! - Else it is **in doubt**, and closed: the database was noted once, but its note is missing, damaged, a copy, or
//!   that of another database. A copy of a whole folder is told by the number of the note's inode, that of a bucket by
//!   its name.
//! - A note that names a row of the trail which the database lacks stays known in the database, and
//!   [`ventriform_service::callers::verify`] says so.
//!
//! Notes are written when the service opens, when access changes, every [`NOTE_EVERY`] if the trail has grown, and at
//! the end. Not guaranteed: a snapshot of a whole disk from before the first key looks like that time.

use crate::database::SqlStore;
use crate::note::{Beside, Found, NOTE_FILE, Note};
use crate::tables::{Access, Marks};
use std::sync::Weak;
use std::time::Duration;
use ventriform_service::base::records::{Clock, StoreResult, SystemClock, random_id};
use ventriform_service::callers::Anchor;

/// How often a running service looks whether the trail has grown beyond what is noted.
pub(crate) const NOTE_EVERY: Duration = Duration::from_secs(10);

/// How to go on with a service that is closed though it may never have had a key.
pub(crate) const HOW_TO_OPEN: &str = "make a key (`ventriform keys create`), or admit callers without \
     credentials on purpose (`ventriform keys open`)";

/// Why a service is closed though nothing says that it was.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Doubt(pub String);

/// What [`SqlStore::settle`] found.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Settled {
    /// Why the service was closed now, if it was in doubt.
    pub doubt: Option<Doubt>,
    /// The newest row of the trail that a note names and the database lacks.
    pub lost_head: Option<Anchor>,
    /// The end of the trail, if the database was put here from elsewhere: no note about it lies where it was written.
    pub restored: Option<Anchor>,
}

/// What [`SqlStore::judge`] found.
pub(crate) struct Judged {
    before: Marks,
    /// What the database is to be marked with.
    pub marks: Marks,
    pub settled: Settled,
}

impl Settled {
    fn log(&self) {
        if let Some(Doubt(why)) = &self.doubt {
            tracing::warn!(
                "callers without credentials are refused, since {why}. To go on, {HOW_TO_OPEN}"
            );
        }
        if let Some(end) = &self.restored {
            tracing::warn!(
                sequence = end.sequence,
                hash = end.hash,
                "the database is a restored copy, which ends with this row of the audit trail: keys that were revoked \
                 and items that were erased since are as they were before. `ventriform audit missed --from NEWER` says \
                 which, and with --apply does the same here"
            );
        }
        if let Some(head) = &self.lost_head {
            tracing::warn!(
                sequence = head.sequence,
                hash = head.hash,
                "the database lacks rows of the audit trail up to this one: it was damaged, or it is an older copy, in \
                 which what was revoked or erased since is as it was before. `ventriform audit missed --from NEWER` \
                 says what, and does it"
            );
        }
    }
}

impl SqlStore {
    /// Compares the database with the notes about it at `beside`, closes the service if any says so or if it is in
    /// doubt, and writes marks and notes anew. From now on notes are kept there. `lost` if a repair made the database
    /// anew, or lost what tells whether there was a key.
    ///
    /// # Errors
    /// If the database or a place fails.
    pub(crate) async fn settle(&self, beside: Beside, lost: bool) -> StoreResult<Settled> {
        let Judged {
            before,
            marks,
            settled,
        } = self.judge(&beside, lost).await?;
        // The note comes first: a database that is marked and has no note is in doubt.
        beside.write(&self.note_of(&marks).await?).await?;
        if marks != before {
            self.mark(&marks).await?;
        }
        settled.log();
        self.keep_beside(beside);
        Ok(settled)
    }

    /// What [`SqlStore::settle`] finds and would write.
    pub(crate) async fn judge(&self, beside: &Beside, lost: bool) -> StoreResult<Judged> {
        let (found, before) = (beside.read().await?, self.marks().await?);
        let (access, doubt) = self.settled_access(&before, &found, lost).await?;
        let lost_head = self.lost_head(&before, &found).await?;
        let known = found.iter().find_map(Found::note);
        let marks = Marks {
            store: before
                .store
                .clone()
                .or_else(|| known.map(|note| note.store.clone()))
                .or_else(|| Some(random_id("sto_"))),
            access: Some(access),
            kept_head: lost_head.clone().or_else(|| before.kept_head.clone()),
        };
        let moved = !lost && before.store.is_some() && !has_own_note(&before, &found);
        let restored = if moved {
            Some(self.trail_end().await?)
        } else {
            None
        };
        Ok(Judged {
            before,
            marks,
            settled: Settled {
                doubt,
                lost_head,
                restored,
            },
        })
    }

    async fn settled_access(
        &self,
        marks: &Marks,
        found: &[Found],
        lost: bool,
    ) -> StoreResult<(Access, Option<Doubt>)> {
        if marks.access == Some(Access::Closed) {
            return Ok((Access::Closed, None));
        }
        // A note in a bucket that was out of reach when the operator opened the service says how it was before.
        let is_older = |note: &Note| match marks.access {
            Some(Access::Opened(at)) => note.noted_at <= at,
            _ => false,
        };
        let mut notes = found.iter().filter_map(Found::note);
        if notes.any(|note| note.closed && !is_older(note)) {
            let doubt =
                format!("the note `{NOTE_FILE}` says that it did, and the database has forgotten");
            return Ok((Access::Closed, Some(Doubt(doubt))));
        }
        let open = marks.access.unwrap_or(Access::Open);
        let whole = has_own_note(marks, found);
        if whole && marks.access.is_some() {
            return Ok((open, None));
        }
        // The marks are lost, or this is the first start.
        if marks.access.is_none() && self.had_keys().await? {
            return Ok((Access::Closed, None));
        }
        let is_first = !lost
            && marks.store.is_none()
            && found.iter().all(|found| matches!(found, Found::Nothing));
        if whole || is_first {
            return Ok((open, None));
        }
        let why = found.iter().find_map(|found| match found {
            Found::Doubtful { why, .. } => Some(*why),
            Found::Whole(_) => Some("it is that of another database"),
            Found::Nothing => None,
        });
        let why = why.unwrap_or("it is missing");
        let doubt = format!(
            "it is not known whether it ever had a key: the note `{NOTE_FILE}` beside the database does not tell, as \
             {why}"
        );
        Ok((Access::Closed, Some(Doubt(doubt))))
    }

    /// The newest row that a note about this database names and the database lacks.
    async fn lost_head(&self, marks: &Marks, found: &[Found]) -> StoreResult<Option<Anchor>> {
        let mut newest: Option<Anchor> = None;
        for note in found.iter().filter_map(Found::note) {
            let own = marks
                .store
                .as_ref()
                .is_none_or(|store| note.store == *store);
            let head = note.head();
            if own && !self.confirms(&head).await? {
                newest = newest
                    .into_iter()
                    .chain([head])
                    .max_by_key(|head| head.sequence);
            }
        }
        Ok(newest)
    }

    pub(crate) async fn note_of(&self, marks: &Marks) -> StoreResult<Note> {
        let mut end = self.trail_end().await?;
        if let Some(kept) = &marks.kept_head
            && kept.sequence >= end.sequence
        {
            end = kept.clone();
        }
        Ok(Note {
            store: marks.store.clone().unwrap_or_default(),
            closed: marks.access == Some(Access::Closed),
            sequence: end.sequence,
            hash: end.hash,
            noted_at: SystemClock.now(),
            place: None,
        })
    }

    /// Writes the notes anew, if this store keeps any.
    pub(crate) async fn note_beside(&self) -> StoreResult<()> {
        let Some(beside) = self.beside() else {
            return Ok(());
        };
        loop {
            let marks = self.marks().await?;
            if marks.store.is_none() {
                // It was not settled yet; the next start does that.
                return Ok(());
            }
            let note = self.note_of(&marks).await?;
            beside.write(&note).await?;
            // Another process may have changed it meanwhile, and written its note before this one.
            if self.marks().await?.access == marks.access {
                return Ok(());
            }
        }
    }

    /// What the notes say, to be compared with what they said before.
    async fn noted_state(&self) -> StoreResult<(Anchor, Option<Access>)> {
        Ok((self.trail_end().await?, self.marks().await?.access))
    }

    /// The newest rows of the trail that the notes name, and the one that the database itself keeps, each with its
    /// place.
    pub(crate) async fn kept_heads(&self) -> StoreResult<Vec<(String, Anchor)>> {
        let marks = self.marks().await?;
        let mut heads = Vec::new();
        if let Some(beside) = self.beside() {
            for found in beside.read().await? {
                if let Some(note) = found.note()
                    && marks.store.as_ref() == Some(&note.store)
                {
                    heads.push((format!("the note {NOTE_FILE}"), note.head()));
                }
            }
        }
        if let Some(head) = marks.kept_head
            && heads.iter().all(|(_, other)| *other != head)
        {
            heads.push(("what the store keeps beside its trail".into(), head));
        }
        Ok(heads)
    }
}

/// Whether a note about the database with these marks lies where it was written.
fn has_own_note(marks: &Marks, found: &[Found]) -> bool {
    found.iter().any(|found| match found {
        Found::Whole(note) => marks
            .store
            .as_ref()
            .is_none_or(|store| note.store == *store),
        _ => false,
    })
}

/// Keeps the notes up to date while the store is in use.
pub(crate) async fn keep(store: Weak<SqlStore>) {
    let mut noted = None;
    loop {
        tokio::time::sleep(NOTE_EVERY).await;
        let Some(rows) = store.upgrade() else { return };
        let state = rows.noted_state().await;
        let changed = match state {
            Ok(state) if noted.as_ref() == Some(&state) => continue,
            Ok(state) => state,
            // Requests meet the same fault, and say so.
            Err(_) => continue,
        };
        match rows.note_beside().await {
            Ok(()) => noted = Some(changed),
            Err(error) => {
                tracing::warn!(%error, "the note beside the database could not be written")
            }
        }
    }
}
