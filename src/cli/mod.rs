//! The `ventriform` command: arguments in, exit status out.

mod bar;
mod model_args;

pub use bar::{Bar, overall};
pub use model_args::ModelArgs;
