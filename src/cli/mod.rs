//! The `ventriform` command: arguments in, exit status out.

pub mod advice;
mod audit;
mod bar;
mod beat;
mod calibrate;
mod cohort_args;
mod compare;
mod data_args;
mod demo;
mod dicom_args;
mod doctor;
mod evaluate;
mod generate;
mod help;
mod inspect;
mod keys;
mod library;
mod limit_args;
mod log;
mod measure;
mod mesh_args;
mod migrate;
mod normals;
mod output;
mod parameter_args;
mod phantom;
mod reconstruct;
mod resolution;
mod segment;
mod serial;
mod serve;
mod statistics;
mod templates;
mod volume_args;

pub use bar::Bar;
pub use parameter_args::{FitArgs, ModelArgs, UnusableArgument};

use self::output::note;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use std::process::ExitCode;

/// Surface models of the left ventricle from cardiac SPECT
#[derive(Debug, Parser)]
#[command(
    name = "ventriform",
    version,
    after_help = "Start with:
  ventriform demo                            a model of a simulated scan, through the service
  ventriform generate scan.nii.gz -o lv.glb  a model of your own volume
  ventriform serve --data-dir data           the HTTP service

Exit status: 0 done; 1 failed, with the reason on standard error (also: doctor and backup found damage,
audit verify found a break, healthcheck found the service not ready); 2 arguments that cannot be used.
A reader that closes the pipe early (| head) is no failure."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Demo(demo::DemoArgs),
    Generate(Box<generate::GenerateArgs>),
    Segment(Box<segment::SegmentArgs>),
    Beat(Box<beat::BeatArgs>),
    Compare(Box<compare::CompareArgs>),
    Serial(Box<serial::SerialArgs>),
    Inspect(inspect::InspectArgs),
    Reconstruct(reconstruct::ReconstructArgs),
    Measure(measure::MeasureArgs),
    Calibrate(Box<calibrate::CalibrateArgs>),
    Evaluate(Box<evaluate::EvaluateArgs>),
    Templates(templates::TemplatesArgs),
    Normals(normals::NormalsArgs),
    Resolution(Box<resolution::ResolutionArgs>),
    Statistics(statistics::StatisticsArgs),
    Serve(Box<serve::ServeArgs>),
    Keys(keys::KeysArgs),
    Audit(audit::AuditArgs),
    Phantom(phantom::PhantomArgs),
    Healthcheck(Box<serve::HealthcheckArgs>),
    #[command(name = serve::COMPUTE_COMMAND, hide = true)]
    Compute(serve::ComputeArgs),
    Doctor(doctor::DoctorArgs),
    Backup(doctor::BackupArgs),
    Migrate(migrate::MigrateArgs),
    /// Print a completion script for a shell
    #[command(after_help = "Example: ventriform completions bash > ventriform.bash")]
    Completions {
        /// Shell to write the script for
        shell: clap_complete::Shell,
    },
    /// Print the manual page, of the program or of a command
    #[command(
        after_help = "Example: ventriform man > ventriform.1; ventriform man segment > ventriform-segment.1"
    )]
    Man {
        /// Command to print the page of
        #[arg(value_name = "COMMAND")]
        of: Option<String>,
    },
}

/// Exit status of a command whose arguments cannot be used, as clap has it.
const USAGE_STATUS: u8 = 2;

/// Runs the command that the arguments of the process name.
pub fn main() -> ExitCode {
    let matches = help::with_short_help(Cli::command()).try_get_matches();
    let cli = matches.and_then(|matches| {
        Cli::from_arg_matches(&matches).map_err(|error| error.format(&mut Cli::command()))
    });
    let cli = match cli {
        Ok(cli) => cli,
        Err(error) => return refuse(&error),
    };
    let outcome = match cli.command {
        Command::Generate(args) => generate::run(&args),
        Command::Segment(args) => segment::run(&args),
        Command::Beat(args) => beat::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Serial(args) => serial::run(&args),
        Command::Inspect(args) => inspect::run(&args),
        Command::Reconstruct(args) => reconstruct::run(&args),
        Command::Measure(args) => measure::run(&args),
        Command::Calibrate(args) => calibrate::run(&args),
        Command::Evaluate(args) => evaluate::run(&args),
        Command::Templates(args) => templates::run(&args),
        Command::Normals(args) => normals::run(&args),
        Command::Resolution(args) => resolution::run(&args),
        Command::Statistics(args) => statistics::run(&args),
        Command::Demo(args) => demo::run(&args),
        Command::Serve(args) => serve::run(&args),
        Command::Keys(args) => keys::run(&args),
        Command::Audit(args) => audit::run(&args),
        Command::Phantom(args) => phantom::run(&args),
        Command::Compute(args) => serve::compute(&args),
        Command::Healthcheck(args) => serve::check_health(&args),
        Command::Doctor(args) => doctor::run(&args),
        Command::Backup(args) => doctor::back_up(&args),
        Command::Migrate(args) => migrate::run(&args),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            let mut command = Cli::command();
            let name = command.get_name().to_owned();
            clap_complete::generate(shell, &mut command, name, &mut script);
            output::write_out(&script);
            Ok(())
        }
        Command::Man { of } => manual(of.as_deref()),
    };
    match outcome.and_then(|()| output::finish()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            note!("error: {}", help::failure(&advice::advised(&error)));
            if error.is::<UnusableArgument>() {
                ExitCode::from(USAGE_STATUS)
            } else {
                ExitCode::FAILURE
            }
        }
    }
}

/// Prints the manual page of the program, or of the command `of`.
fn manual(of: Option<&str>) -> anyhow::Result<()> {
    let mut program = Cli::command();
    program.build();
    let command = match of {
        None => program,
        Some(name) => {
            let found = program.find_subcommand(name).cloned();
            let Some(found) = found else {
                let reason = format!("there is no command {name}; `ventriform --help` lists them");
                return Err(UnusableArgument::new(reason).into());
            };
            found
                .name(format!("ventriform-{name}"))
                .version(env!("CARGO_PKG_VERSION"))
        }
    };
    let mut page = Vec::new();
    clap_mangen::Man::new(command).render(&mut page)?;
    output::write_out(&page);
    Ok(())
}

/// Prints help and version as clap lays them out, and refusals of arguments with the arguments' control
/// characters escaped.
fn refuse(error: &clap::Error) -> ExitCode {
    if error.use_stderr() {
        note!("{}", help::refusal(error).trim_end());
    } else {
        // A reader that has closed the pipe has read enough.
        error.print().ok();
    }
    ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(USAGE_STATUS))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn help_describes_every_argument_of_every_command() {
        let mut open = vec![Cli::command()];
        let mut described = 0;
        while let Some(mut command) = open.pop() {
            let name = command.get_name().to_owned();
            assert!(command.get_about().is_some(), "{name}");
            let help = command.render_long_help().to_string();
            for argument in command.get_arguments() {
                let text = argument.get_help().map(ToString::to_string);
                let text = text.unwrap_or_else(|| panic!("{name}: {}", argument.get_id()));
                assert!(text.len() > 8, "{name}: {}: {text}", argument.get_id());
                // A flag that the command refuses with a reason is taken, and not in its help.
                let hidden = argument.is_hide_set();
                let flag = argument.get_long().map(|long| format!("--{long} <"));
                let first = text.split_whitespace().next().unwrap();
                let shown = if hidden {
                    flag.is_none_or(|flag| help.contains(&flag))
                } else {
                    help.contains(first)
                };
                assert_ne!(shown, hidden, "{name}: {}", argument.get_id());
                described += usize::from(!hidden);
            }
            open.extend(command.get_subcommands().cloned());
        }
        assert!(described > 100, "{described}");
    }

    /// Lines of a screen.
    const SCREEN_LINES: usize = 40;

    /// Every command with its path, below the program.
    fn commands(above: &str, of: &clap::Command, all: &mut Vec<(String, clap::Command)>) {
        for command in of.get_subcommands().filter(|one| !one.is_hide_set()) {
            let path = format!("{above} {}", command.get_name());
            commands(&path, command, all);
            all.push((path, command.clone()));
        }
    }

    #[test]
    fn the_short_help_of_every_command_is_one_screen_and_the_long_one_has_all() {
        let program = help::with_short_help(Cli::command()).term_width(100);
        let mut all = vec![("ventriform".to_owned(), program.clone())];
        commands("ventriform", &program, &mut all);
        assert!(all.len() > 25, "{}", all.len());
        for (path, mut command) in all {
            command = command.term_width(100);
            let short = command.render_help().to_string();
            let lines = short.lines().count();
            assert!(lines <= SCREEN_LINES, "{path}: {lines}\n{short}");
            let long = command.render_long_help().to_string();
            for arg in command.get_arguments().filter(|arg| !arg.is_hide_set()) {
                if let Some(flag) = arg.get_long() {
                    assert!(long.contains(&format!("--{flag}")), "{path}: {flag}");
                }
            }
        }
    }

    #[test]
    fn the_messages_of_the_system_are_said_in_words() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "").unwrap();
        for error in [
            std::fs::read(folder.path().join("none")).unwrap_err(),
            std::fs::read(folder.path()).unwrap_err(),
            std::fs::read(file.join("below")).unwrap_err(),
        ] {
            let text = help::failure(&format!("scan.nii: {error}"));
            assert!(text.starts_with("scan.nii: "), "{text}");
            assert!(!text.contains("os error"), "{text}");
        }
    }

    #[test]
    fn no_flag_of_any_command_refuses_a_value_in_the_words_of_the_standard_library() {
        let program = Cli::command();
        let mut all = Vec::new();
        commands("ventriform", &program, &mut all);
        let raw = [
            "invalid digit",
            "invalid float",
            "invalid socket",
            "provided string was",
            "target type",
            "cannot parse",
            "empty string",
        ];
        let mut refused = 0;
        for (path, command) in all {
            let flags = command
                .get_arguments()
                .filter(|arg| arg.get_action().takes_values());
            for flag in flags.filter_map(|arg| arg.get_long()) {
                for value in ["abc", "-", "1e99", "99999999999999999999999999", "1:2", ""] {
                    let words = path.split(' ').chain([]).map(str::to_owned);
                    let given = [format!("--{flag}={value}")];
                    let parsed = Cli::command().try_get_matches_from(words.chain(given));
                    let Err(error) = parsed else { continue };
                    let text = help::refusal(&error);
                    if error.kind() != clap::error::ErrorKind::ValueValidation {
                        continue;
                    }
                    refused += 1;
                    assert!(text.contains(&format!("--{flag}")), "{text}");
                    let bare = raw.iter().find(|raw| text.contains(*raw));
                    assert!(bare.is_none(), "{path}: {text}");
                }
            }
        }
        assert!(refused > 300, "{refused}");
    }
}
