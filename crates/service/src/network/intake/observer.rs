//! Who is told of what happens, for metrics.

use super::Protocol;

/// How an association, or a connection that did not become one, ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum AssociationEnd {
    /// The caller released it.
    Released,
    /// The caller aborted it, or closed the connection.
    Broken,
    /// It was rejected: the caller is unknown, or too many are open.
    Rejected,
    /// The caller broke the protocol.
    Violation,
    /// It was idle or lasted for too long, or sent too much.
    Exceeded,
    /// The service shuts down.
    Shutdown,
}

impl AssociationEnd {
    /// Every end.
    pub const ALL: [Self; 6] = [
        Self::Released,
        Self::Broken,
        Self::Rejected,
        Self::Violation,
        Self::Exceeded,
        Self::Shutdown,
    ];

    /// Its name in metrics.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Released => "released",
            Self::Broken => "broken",
            Self::Rejected => "rejected",
            Self::Violation => "violation",
            Self::Exceeded => "exceeded",
            Self::Shutdown => "shutdown",
        }
    }
}

/// Is told of what happens. Its methods return at once.
pub trait IntakeObserver: Send + Sync + 'static {
    /// An association was accepted.
    fn associated(&self);

    /// An association, or a connection that did not become one, has ended.
    fn ended(&self, end: AssociationEnd, accepted: bool);

    /// An object came: `stored`, or the code of the refusal.
    fn object(&self, protocol: Protocol, outcome: &'static str, bytes: u64);

    /// A group became a volume, or could not.
    fn group(&self, made: bool);
}
