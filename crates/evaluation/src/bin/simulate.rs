//! Writes simulated scans whose truth is known.
//!
//! ```sh
//! cargo run --release -p ventriform-evaluation --bin simulate -- cases --seed 200 --n 14 --out CASES/200
//! ```
//!
//! In: a seed and a number. Out: a folder for each case, see [`ventriform_evaluation::simulator`]. Cases that are there
//! are kept. `--help` lists the kinds.

use anyhow::{Context, Result, bail};
use clap::{Args, Parser, Subcommand};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use ventriform_evaluation::simulator::gated::{self, GatedOrder};
use ventriform_evaluation::simulator::healthy::{self, OneDefect, Protocol};
use ventriform_evaluation::simulator::kinds::{self, Kind, Sampling};
use ventriform_evaluation::simulator::random::{Draws, Stream};
use ventriform_evaluation::simulator::study::StudyOptions;
use ventriform_evaluation::simulator::{case, pairs, serial, study, variants, walls};

/// Seeds of the cases of one order: more than cases that anyone asks for.
const CASES_OF_A_SEED: u64 = 100_000;
/// Height of the slices of healthy hearts, mm.
const HEALTHY_HEIGHT_MM: f64 = 256.0;

#[derive(Parser)]
#[command(about = "Writes simulated scans whose truth is known")]
struct Cli {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// Single scans of many kinds
    Cases {
        #[command(flatten)]
        order: Order,
        /// Kinds, taken in turn. Beyond these: hotgut, filter, drift, cut, camera, few,
        /// healthy, halfapex, oneapex, apexplus
        #[arg(long, value_delimiter = ',', default_values_t = usual_kinds())]
        kinds: Vec<String>,
        /// 64 voxels of 6.0 to 6.8 mm along an axis instead of 128 of 3.3 to 4.8
        #[arg(long)]
        coarse: bool,
    },
    /// Healthy men and women of one protocol, with cohort.csv
    Healthy {
        #[command(flatten)]
        order: Order,
        /// stress_nac, rest_nac, stress_ac, rest_ac or stress_smooth
        #[arg(long, default_value = "stress_nac")]
        protocol: String,
        /// Gates; 0: none
        #[arg(long, default_value_t = 0)]
        gates: usize,
        /// Voxels along an axis, 64 or 128
        #[arg(long, default_value_t = 64)]
        matrix: usize,
        /// One defect in each heart
        #[arg(long)]
        one_defect: bool,
        /// One dark segment at the base of each heart
        #[arg(long, conflicts_with = "one_defect")]
        basal: bool,
    },
    /// One heart at stress and at rest
    Pairs {
        #[command(flatten)]
        order: Order,
        /// Kinds, taken in turn
        #[arg(long, value_delimiter = ',', default_values_t = owned(&pairs::KINDS))]
        kinds: Vec<String>,
        /// Gates; 0: none
        #[arg(long, default_value_t = 8)]
        gates: usize,
        /// Voxels along an axis, 64 or 128
        #[arg(long, default_value_t = 64)]
        matrix: usize,
    },
    /// One heart twice, years apart
    Serial {
        #[command(flatten)]
        order: Order,
        /// Kinds, taken in turn
        #[arg(long, value_delimiter = ',', default_values_t = owned(&serial::KINDS))]
        kinds: Vec<String>,
        /// Gates; 0: none
        #[arg(long, default_value_t = 8)]
        gates: usize,
        /// Voxels along an axis, 64 or 128
        #[arg(long, default_value_t = 64)]
        matrix: usize,
    },
    /// Gated studies
    Gated {
        #[command(flatten)]
        order: Order,
        /// Kinds, taken in turn
        #[arg(long, value_delimiter = ',', default_values_t = owned(&gated::KINDS))]
        kinds: Vec<String>,
        /// Gates
        #[arg(long, default_value_t = 8)]
        gates: usize,
        /// Voxels along an axis, 64 or 128
        #[arg(long, default_value_t = 64)]
        matrix: usize,
    },
    /// Walls of 5 to 22 mm
    Walls {
        #[command(flatten)]
        order: Order,
        /// Gates; 0: none
        #[arg(long, default_value_t = 0)]
        gates: usize,
    },
    /// Two hearts in every way in which real scans differ
    Variants {
        /// The folder of the cases
        #[arg(long)]
        out: PathBuf,
        /// Variants
        #[arg(long, value_delimiter = ',', default_values_t = owned(&variants::VARIANTS))]
        names: Vec<String>,
    },
}

#[derive(Args)]
struct Order {
    /// The folder of the cases
    #[arg(long)]
    out: PathBuf,
    /// Seed of all cases
    #[arg(long)]
    seed: u64,
    /// How many
    #[arg(long, default_value_t = 14)]
    n: usize,
    /// The first one's number
    #[arg(long, default_value_t = 0)]
    first: usize,
}

impl Order {
    /// Makes every case that is not there.
    fn make(&self, name: impl Fn(usize) -> String + Sync, make: &Make) -> Result<()> {
        let numbers: Vec<usize> = (self.first..self.first + self.n).collect();
        numbers
            .into_par_iter()
            .with_max_len(1)
            .try_for_each(|number| {
                let name = name(number);
                let seed = self.seed * CASES_OF_A_SEED + number as u64;
                let folder = self.out.join(&name);
                let one = Case {
                    name: &name,
                    number,
                    seed,
                    folder: &folder,
                };
                one.unless_there(|| make(&one))
            })
    }
}

/// One case to make.
struct Case<'a> {
    name: &'a str,
    number: usize,
    seed: u64,
    folder: &'a Path,
}

impl Case<'_> {
    fn unless_there(&self, make: impl FnOnce() -> Result<()>) -> Result<()> {
        let done = |name: &str| self.folder.join(name).exists();
        if done("params.json") || done("pair.json") || done("serial.json") {
            return Ok(());
        }
        make().with_context(|| self.name.to_owned())?;
        eprintln!("{}", self.name);
        Ok(())
    }
}

type Make<'a> = dyn Fn(&Case) -> Result<()> + Sync + 'a;

fn usual_kinds() -> Vec<String> {
    Kind::ALL[..Kind::USUAL]
        .iter()
        .map(|kind| kind.name().to_owned())
        .collect()
}

fn owned(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}

fn main() -> Result<()> {
    match Cli::parse().what {
        What::Cases {
            order,
            kinds,
            coarse,
        } => cases(&order, &kinds, coarse),
        What::Healthy {
            order,
            protocol,
            gates,
            matrix,
            one_defect,
            basal,
        } => {
            let protocol = Protocol::from_name(&protocol)
                .with_context(|| format!("{protocol} is no protocol"))?;
            let (letter, defect) = match (one_defect, basal) {
                (true, _) => ('d', Some(OneDefect::OfTerritory)),
                (_, true) => ('b', Some(OneDefect::Basal)),
                _ => ('n', None),
            };
            let options = options(gates, HEALTHY_HEIGHT_MM);
            order.make(
                |number| format!("{letter}{}_{number:03}", order.seed),
                &|one: &Case| {
                    let female = one.number % 2 == 1;
                    let parameters =
                        healthy::draw(one.name, one.seed, female, &protocol, matrix, defect);
                    study::write(&parameters, &options, one.folder).map(drop)
                },
            )?;
            healthy::write_table(&order.out)
        }
        What::Pairs {
            order,
            kinds,
            gates,
            matrix,
        } => two_scans(&order, &kinds, &|kind, one| {
            pairs::write(kind, one.name, one.seed, gates, matrix, one.folder).map(drop)
        }),
        What::Serial {
            order,
            kinds,
            gates,
            matrix,
        } => two_scans(&order, &kinds, &|kind, one| {
            serial::write(kind, one.name, one.seed, gates, matrix, one.folder).map(drop)
        }),
        What::Gated {
            order,
            kinds,
            gates,
            matrix,
        } => {
            let kind = |number: usize| &kinds[number % kinds.len()];
            let name = |number: usize| format!("{}{}_{number:03}", kind(number), order.seed);
            let wanted = GatedOrder {
                gates,
                matrix,
                heart: None,
            };
            order.make(name, &|one: &Case| {
                gated_case(kind(one.number), one, &wanted)
            })
        }
        What::Walls { order, gates } => order.make(
            |number| format!("w{}_{number:03}", order.seed),
            &|one: &Case| {
                if gates == 0 {
                    return case::write(&walls::draw(one.name, one.seed), one.folder).map(drop);
                }
                let heart = walls::heart(&mut Draws::new(one.seed, Stream::Kind));
                gated_case(
                    "healthy",
                    one,
                    &GatedOrder {
                        gates,
                        matrix: 64,
                        heart: Some(heart),
                    },
                )
            },
        ),
        What::Variants { out, names } => {
            let unknown = names
                .iter()
                .find(|name| !variants::VARIANTS.contains(&name.as_str()));
            if let Some(name) = unknown {
                bail!("{name} is no variant: {}", variants::VARIANTS.join(", "));
            }
            let all: Vec<_> = (variants::HEARTS.iter())
                .flat_map(|heart| names.iter().map(move |name| (name, heart)))
                .collect();
            all.into_par_iter()
                .with_max_len(1)
                .try_for_each(|(variant, heart)| {
                    let parameters = variants::draw(variant, heart);
                    let folder = out.join(&parameters.case);
                    let one = Case {
                        name: &parameters.case,
                        number: 0,
                        seed: 0,
                        folder: &folder,
                    };
                    one.unless_there(|| case::write(&parameters, &folder).map(drop))
                })
        }
    }
}

/// Makes cases of two scans each, of these kinds in turn.
fn two_scans(
    order: &Order,
    kinds: &[String],
    write: &(dyn Fn(&str, &Case) -> Result<()> + Sync),
) -> Result<()> {
    let kind = |number: usize| &kinds[number % kinds.len()];
    let name = |number: usize| format!("{}_{}_{number:03}", kind(number), order.seed);
    order.make(name, &|one: &Case| write(kind(one.number), one))
}

fn cases(order: &Order, kinds: &[String], coarse: bool) -> Result<()> {
    let kinds: Vec<Kind> = kinds.iter().map(|name| kind(name)).collect::<Result<_>>()?;
    let sampling = if coarse {
        Sampling::Coarse
    } else {
        Sampling::Fine
    };
    let kind = |number: usize| kinds[number % kinds.len()];
    let name = |number: usize| format!("{}{}_{number:03}", kind(number).name(), order.seed);
    order.make(name, &|one: &Case| {
        let parameters = kinds::draw(kind(one.number), one.name, one.seed, sampling);
        case::write(&parameters, one.folder).map(drop)
    })
}

fn gated_case(kind: &str, one: &Case, wanted: &GatedOrder) -> Result<()> {
    let drawn = gated::draw(kind, one.name, one.seed, wanted).with_context(|| {
        format!(
            "{kind} is no kind of gated study: {}",
            gated::KINDS.join(", ")
        )
    })?;
    study::write(&drawn.parameters, &drawn.options, one.folder).map(drop)
}

fn options(gates: usize, height_mm: f64) -> StudyOptions {
    StudyOptions {
        gates,
        loss: 0.0,
        height_mm: Some(height_mm),
        truth_images: gates > 0,
    }
}

fn kind(name: &str) -> Result<Kind> {
    let Some(kind) = Kind::from_name(name) else {
        let all: Vec<&str> = Kind::ALL.iter().map(|kind| kind.name()).collect();
        bail!("{name} is no kind of scan: {}", all.join(", "));
    };
    Ok(kind)
}
