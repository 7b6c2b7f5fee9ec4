//! The tables of parameters as command-line flags.

use clap::{Arg, ArgMatches, Args, Command, FromArgMatches};
use std::marker::PhantomData;
use ventriform::parameters::{
    BesideFit, FitParameters, Kind, ModelParameters, ParameterError, ParameterSpec, Parameters,
    WithFit,
};
use ventriform::runs::advice::Explain;

/// The flags of the parameters of a model.
pub type ModelArgs = TableArgs<ModelParameters>;
/// The flags of the parameters of a fit. `model` and `expert` are ids of stored files; the command
/// has flags of its own for them, which take paths.
pub type FitArgs = TableArgs<FitParameters>;

/// Arguments that cannot be used: the command ends as it does when clap refuses them.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct UnusableArgument(String);

impl UnusableArgument {
    /// Arguments that cannot be used for that reason.
    pub fn new(reason: String) -> Self {
        Self(reason)
    }
}

impl From<ParameterError> for UnusableArgument {
    fn from(error: ParameterError) -> Self {
        Self(error.with_advice())
    }
}

/// The flags that were given, as names and texts.
#[derive(Debug, Clone)]
pub struct TableArgs<P>(Vec<(&'static str, String)>, PhantomData<P>);

impl<P> Default for TableArgs<P> {
    fn default() -> Self {
        Self(Vec::new(), PhantomData)
    }
}

impl<P: Parameters> TableArgs<P> {
    /// Checks the flags.
    ///
    /// # Errors
    /// The first flag that cannot be used.
    pub fn parameters(&self) -> Result<P, ParameterError> {
        P::from_pairs(self.0.iter().map(|(name, text)| (*name, text.as_str())))
    }

    /// The names and texts of the flags.
    pub fn pairs(&self) -> &[(&'static str, String)] {
        &self.0
    }
}

/// The flags of the parameters of the fits of some work. Those that it has no use for are not in its help; they are
/// taken, so that [`with_fit`] refuses them with the reason.
#[derive(Debug, Clone)]
pub struct FitArgsOf<C>(FitArgs, PhantomData<C>);

impl<C: BesideFit> Args for FitArgsOf<C> {
    fn augment_args(command: Command) -> Command {
        let used: Vec<_> = WithFit::<C>::fit_specs().map(|spec| spec.name).collect();
        command
            .args(rows::<FitParameters>().map(|spec| flag(spec).hide(!used.contains(&spec.name))))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<C> FromArgMatches for FitArgsOf<C> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        Ok(Self(FitArgs::from_arg_matches(matches)?, PhantomData))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        self.0.update_from_arg_matches(matches)
    }
}

/// The parameters of work that fits models, from its own flags and those of its fits.
///
/// # Errors
/// The first flag that cannot be used.
pub fn with_fit<C: BesideFit>(
    own: &TableArgs<C>,
    fit: &FitArgsOf<C>,
) -> Result<WithFit<C>, UnusableArgument> {
    let pairs = own.pairs().iter().chain(fit.0.pairs());
    Ok(WithFit::from_pairs(
        pairs.map(|(name, text)| (*name, text.as_str())),
    )?)
}

/// The parameters that are flags: all but those that are ids of what a service stores.
fn rows<P: Parameters>() -> impl Iterator<Item = &'static ParameterSpec<P>> {
    P::PARAMETER_SPECS
        .iter()
        .filter(|spec| !matches!(spec.kind, Kind::Stored { .. }))
}

impl<P: Parameters> Args for TableArgs<P> {
    fn augment_args(command: Command) -> Command {
        command.args(rows::<P>().map(flag))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<P: Parameters> FromArgMatches for TableArgs<P> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let mut args = Self::default();
        args.update_from_arg_matches(matches)?;
        Ok(args)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        self.0 = rows::<P>()
            .filter_map(|s| Some((s, matches.get_one::<String>(s.name)?)))
            .map(|(spec, text)| match spec.kind {
                Kind::Choice(_) => (spec.name, text.replace('-', "_")),
                _ => (spec.name, text.clone()),
            })
            .collect();
        Ok(())
    }
}

/// The flag of one parameter: `--seed-point` and `--seed_point` are the same.
fn flag<P: Parameters>(spec: &'static ParameterSpec<P>) -> Arg {
    let mut arg = Arg::new(spec.name)
        .long(spec.name.replace('_', "-"))
        .value_name(value_name(&spec.kind))
        .allow_hyphen_values(true)
        .help_heading("Parameters")
        .help(help(spec));
    if spec.name.contains('_') {
        arg = arg.alias(spec.name);
    }
    for (other, own) in P::NAME_ALIASES {
        if *own == spec.name {
            arg = arg.visible_alias(*other);
        }
    }
    match spec.kind {
        Kind::Choice(words) => {
            let words = words
                .iter()
                .map(|word| clap::builder::PossibleValue::new(*word).alias(word.replace('_', "-")));
            arg.value_parser(clap::builder::PossibleValuesParser::new(words))
        }
        Kind::Switch => arg
            .num_args(0..=1)
            .require_equals(true)
            .default_missing_value("true")
            .allow_hyphen_values(false),
        _ => arg,
    }
}

fn value_name(kind: &Kind) -> &'static str {
    match kind {
        Kind::Integer { .. } => "N",
        Kind::Number { .. } => "X",
        Kind::Switch => "true|false",
        Kind::Choice(_) => "WORD",
        Kind::Direction(_) => "WORD|X,Y,Z",
        Kind::Integers { count: 1 } => "N",
        Kind::Integers { count: 3 } => "I,J,K",
        Kind::Integers { .. } => "I0,J0,K0,I1,J1,K1",
        Kind::Numbers { .. } => "X,Y,Z",
        Kind::Points { .. } => "X,Y,Z[,X,Y,Z...]",
        Kind::Text { .. } => "TEXT",
        Kind::Stored { .. } => "ID",
    }
}

fn help<P: Parameters>(spec: &ParameterSpec<P>) -> String {
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
        let fit = FitArgs::augment_args(Command::new("test"));
        let line = [
            "test",
            "--seed-point",
            "1,2,3",
            "--organ",
            "left-ventricle",
            "--axis=-1,0,0",
        ];
        let fit = FitArgs::from_arg_matches(&fit.try_get_matches_from(line).unwrap()).unwrap();
        assert_eq!(
            fit.parameters().unwrap().position.seed_point,
            Some([1, 2, 3])
        );
        let snake = parse(&["test", "--mask_smoothing", "1.5"]).unwrap();
        assert_eq!(snake.parameters().unwrap().surface.mask_smoothing, 1.5);
    }
}
