//! The urgency of a job.

/// Every waiting job of a higher priority starts before any of a lower one. Within one priority,
/// tenants take turns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Priority {
    /// Somebody waits for it, such as a physician with the patient.
    Urgent,
    /// The daily work.
    #[default]
    Routine,
    /// It starts when nothing else waits: a study's thousand scans, or a new computation of old ones.
    Bulk,
}

impl Priority {
    /// Every priority, the highest first.
    pub const ALL: [Priority; 3] = [Priority::Urgent, Priority::Routine, Priority::Bulk];

    /// Its name over HTTP.
    pub fn as_str(self) -> &'static str {
        match self {
            Priority::Urgent => "urgent",
            Priority::Routine => "routine",
            Priority::Bulk => "bulk",
        }
    }

    /// The priority with that name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|one| one.as_str() == name)
    }

    /// Its place in [`Priority::ALL`], by which the database sorts.
    pub fn rank(self) -> i64 {
        match self {
            Priority::Urgent => 0,
            Priority::Routine => 1,
            Priority::Bulk => 2,
        }
    }

    /// The priority of that rank.
    pub fn of_rank(rank: i64) -> Option<Self> {
        Self::ALL.into_iter().find(|one| one.rank() == rank)
    }
}
