//! The `ventriform` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    ventriform::cli::main()
}
