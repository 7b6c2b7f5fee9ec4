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
use ventriform_evaluation::simulator::kinds::{Kind, Sampling, draw};
use ventriform_evaluation::simulator::{case, kinds};

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
        /// Kinds, taken in turn
        #[arg(long, value_delimiter = ',', default_values_t = usual_kinds())]
        kinds: Vec<String>,
        /// 64 voxels of 6.0 to 6.8 mm along an axis instead of 128 of 3.3 to 4.8
        #[arg(long)]
        coarse: bool,
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
    /// Makes every case that is not there, from its number; its name and its seed.
    fn make(&self, name: impl Fn(usize) -> String + Sync, make: &Make) -> Result<()> {
        let numbers: Vec<usize> = (self.first..self.first + self.n).collect();
        // Cases one after the other within a thread: each uses all threads for its views.
        numbers
            .into_par_iter()
            .with_max_len(1)
            .try_for_each(|number| {
                let name = name(number);
                let folder = self.out.join(&name);
                if folder.join("params.json").exists() {
                    return Ok(());
                }
                let seed = self.seed * 100_000 + number as u64;
                make(&Case {
                    name: &name,
                    number,
                    seed,
                    folder: &folder,
                })
                .context(name.clone())?;
                eprintln!("{name}");
                Ok(())
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

type Make<'a> = dyn Fn(&Case) -> Result<()> + Sync + 'a;

fn usual_kinds() -> Vec<String> {
    Kind::ALL[..Kind::USUAL]
        .iter()
        .map(|kind| kind.name().to_owned())
        .collect()
}

fn main() -> Result<()> {
    match Cli::parse().what {
        What::Cases {
            order,
            kinds,
            coarse,
        } => {
            let kinds: Vec<Kind> = kinds.iter().map(|name| kind(name)).collect::<Result<_>>()?;
            let sampling = if coarse {
                Sampling::Coarse
            } else {
                Sampling::Fine
            };
            let kind = |number: usize| kinds[number % kinds.len()];
            let name = |number: usize| format!("{}{}_{number:03}", kind(number).name(), order.seed);
            order.make(name, &|one: &Case| {
                let parameters = draw(kind(one.number), one.name, one.seed, sampling);
                case::write(&parameters, one.folder)?;
                Ok(())
            })
        }
    }
}

fn kind(name: &str) -> Result<Kind> {
    let Some(kind) = Kind::from_name(name) else {
        let all: Vec<&str> = kinds::Kind::ALL.iter().map(|kind| kind.name()).collect();
        bail!("{name} is no kind of scan: {}", all.join(", "));
    };
    Ok(kind)
}
