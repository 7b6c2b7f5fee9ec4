//! The `ventriform` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    ventriform_program::cli::main()
}
