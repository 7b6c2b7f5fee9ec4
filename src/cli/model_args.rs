//! The model parameters as command-line flags, made from the table of names.

use crate::parameters::{Kind, ModelParameters, ParameterError, ParameterSpec, SPECS};
use clap::{Arg, ArgMatches, Args, Command, FromArgMatches};

/// The flags given, as name and text.
#[derive(Debug, Clone, Default)]
pub struct ModelArgs(Vec<(&'static str, String)>);

impl ModelArgs {
    /// Checks the flags.
    ///
    /// # Errors
    /// The first flag that cannot be used.
    pub fn parameters(&self) -> Result<ModelParameters, ParameterError> {
        ModelParameters::from_pairs(self.0.iter().map(|(name, text)| (*name, text.as_str())))
    }

    /// The flags as a query string's pairs.
    pub fn pairs(&self) -> &[(&'static str, String)] {
        &self.0
    }
}

impl Args for ModelArgs {
    fn augment_args(command: Command) -> Command {
        command.args(SPECS.iter().map(flag))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for ModelArgs {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let mut args = Self::default();
        args.update_from_arg_matches(matches)?;
        Ok(args)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        self.0 = SPECS
            .iter()
            .filter_map(|s| Some((s.name, matches.get_one::<String>(s.name)?.clone())))
            .collect();
        Ok(())
    }
}

/// The flag of one parameter: `--seed-point` and `--seed_point` are the same.
fn flag(spec: &'static ParameterSpec) -> Arg {
    let mut arg = Arg::new(spec.name)
        .long(spec.name.replace('_', "-"))
        .value_name(value_name(&spec.kind))
        .allow_hyphen_values(true)
        .help_heading("Model")
        .help(help(spec));
    if spec.name.contains('_') {
        arg = arg.alias(spec.name);
    }
    match spec.kind {
        Kind::Choice(words) => arg.value_parser(clap::builder::PossibleValuesParser::new(words)),
        _ => arg,
    }
}

fn value_name(kind: &Kind) -> &'static str {
    match kind {
        Kind::Integer { .. } => "N",
        Kind::Number { .. } => "X",
        Kind::Choice(_) => "WORD",
        Kind::Integers { count: 1 } => "N",
        Kind::Integers { count: 3 } => "I,J,K",
        Kind::Integers { .. } => "I0,J0,K0,I1,J1,K1",
        Kind::Text { .. } => "TEXT",
    }
}

fn help(spec: &ParameterSpec) -> String {
    let range = match spec.kind {
        Kind::Integer { max: u64::MAX, .. } => String::new(),
        Kind::Integer { min, max } => format!(" ({min} to {max})"),
        Kind::Number { min, max } => format!(" ({min} to {max})"),
        _ => String::new(),
    };
    if spec.default.is_empty() {
        format!("{}{range}", spec.summary)
    } else {
        format!("{}{range} [default: {}]", spec.summary, spec.default)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(line: &[&str]) -> Result<ModelArgs, clap::Error> {
        let command = ModelArgs::augment_args(Command::new("test"));
        ModelArgs::from_arg_matches(&command.try_get_matches_from(line)?)
    }

    #[test]
    fn every_parameter_has_a_flag_and_reaches_the_parser() {
        let args = parse(&[
            "test",
            "--points",
            "67",
            "--seed-point=1,2,3",
            "--label=-1",
            "--iso",
            "absolute:-3",
        ])
        .unwrap();
        assert_eq!(args.pairs().len(), 4);
        assert_eq!(args.parameters().unwrap_err().field, "label");
        assert!(parse(&["test", "--method", "papr"]).is_err());
        let snake = parse(&["test", "--mask_smoothing", "1.5"]).unwrap();
        assert_eq!(snake.parameters().unwrap().surface.mask_smoothing, 1.5);
    }
}
