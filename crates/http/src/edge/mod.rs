//! What every request passes: connections, who calls, from where, what is logged; and the page itself.

pub mod caller;
pub(crate) mod connections;
pub(crate) mod cryptography;
pub(crate) mod front_page;
pub(crate) mod guard;
pub(crate) mod observe;
pub(crate) mod quota;
pub(crate) mod watch;
