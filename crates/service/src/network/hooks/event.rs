//! The events of jobs that webhooks tell.

use crate::base::records::JobState;

/// An event in the life of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum HookEvent {
    /// A worker started it; once for each attempt.
    Started,
    /// It succeeded.
    Succeeded,
    /// It failed.
    Failed,
    /// It was cancelled.
    Cancelled,
}

impl HookEvent {
    /// Every event, in the order in which they happen.
    pub const ALL: [HookEvent; 4] = [
        HookEvent::Started,
        HookEvent::Succeeded,
        HookEvent::Failed,
        HookEvent::Cancelled,
    ];

    /// The events that are told unless a client chooses: those that end a job.
    pub const ENDS: [HookEvent; 3] = [
        HookEvent::Succeeded,
        HookEvent::Failed,
        HookEvent::Cancelled,
    ];

    /// Its name in requests and in the database.
    pub fn as_str(self) -> &'static str {
        match self {
            HookEvent::Started => "started",
            HookEvent::Succeeded => "succeeded",
            HookEvent::Failed => "failed",
            HookEvent::Cancelled => "cancelled",
        }
    }

    /// The event of that name, with or without `job.` in front.
    pub fn parse(name: &str) -> Option<Self> {
        let name = name.strip_prefix("job.").unwrap_or(name);
        Self::ALL.into_iter().find(|event| event.as_str() == name)
    }

    /// The state of the job then.
    pub(super) fn state(self) -> JobState {
        match self {
            HookEvent::Started => JobState::Running,
            HookEvent::Succeeded => JobState::Succeeded,
            HookEvent::Failed => JobState::Failed,
            HookEvent::Cancelled => JobState::Cancelled,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_are_read_with_and_without_their_prefix() {
        for event in HookEvent::ALL {
            assert_eq!(HookEvent::parse(event.as_str()), Some(event));
            assert_eq!(
                HookEvent::parse(&format!("job.{}", event.as_str())),
                Some(event)
            );
        }
        assert_eq!(HookEvent::parse("ended"), None);
    }
}
