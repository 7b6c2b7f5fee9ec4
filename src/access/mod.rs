//! Who may use the service, and what each caller may do.

mod scope;

pub use scope::Scope;
