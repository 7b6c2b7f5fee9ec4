//! `ventriform templates import`: adds models to the library in a service's data folder.

use super::data_args::StoreArgs;
use super::keys::AUDIT_AGENT;
use super::mesh_args::{MeshArgs, mesh_bytes};
use super::output::say;
use crate::server::store_settings;
use anyhow::{Context, Result, anyhow};
use clap::Args;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tokio::runtime::Runtime;
use ventriform::image::volume::ReadLimits;
use ventriform_service::base::records::{Failure, ProductRoom, SystemClock, Tenant};
use ventriform_service::callers::{Agent, Recorder};
use ventriform_service::items::{Items, NotAdded, TemplateSource};
use ventriform_service::work::{Engine, TEMPLATE_BYTES};
use ventriform_store::{IfNone, Store, require_store};

/// The arguments of `templates import`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  ventriform templates build cohort --points 150 -o templates
  ventriform templates import templates/*.json --data-dir ventriform-data
While the service runs, send the models to it instead:
  curl --data-binary @templates/t1_150.json -H 'content-type: application/json' \\
       'http://127.0.0.1:8080/v1/templates?name=t1_150'")]
pub struct ImportArgs {
    /// Closed meshes: JSON as `templates build` or `generate` write it, STL, PLY, OBJ, VTK, VTP or glTF; a
    /// file's name becomes the template's name
    #[arg(value_name = "MODEL", required = true)]
    models: Vec<PathBuf>,
    #[command(flatten)]
    store: StoreArgs,
    /// Fit the models in every job with `model=auto`, beside the built-in hearts; otherwise only jobs
    /// that name them do
    #[arg(long)]
    library: bool,
    /// Organ that the models show: left_ventricle, liver, kidney or generic
    #[arg(long, value_name = "WORD", default_value = "left_ventricle")]
    organ: String,
    #[command(flatten)]
    mesh: MeshArgs,
}

/// Runs the command.
///
/// # Errors
/// If a mesh cannot serve as a template, or the data folder is in use or cannot be written.
pub fn import(args: &ImportArgs) -> Result<()> {
    Runtime::new()?.block_on(async {
        let service = args.store.settings()?;
        let settings = &service.settings;
        if settings.database.0.is_none() {
            require_store(&settings.data_dir, IfNone::Make)
                .map_err(|error| service.explained(error))?;
        }
        ventriform_http::install_cryptography();
        let store = Store::open_with(&settings.data_dir, store_settings(settings)).await?;
        let items = Arc::new(Items::new(
            store.rows.clone(),
            store.blobs.clone(),
            Arc::new(SystemClock),
            None,
        ));
        let engine = Engine::new(ReadLimits::default());
        let room = ProductRoom {
            count: settings.template_limit,
            bytes: settings.quota_bytes.0.map(|size| size.0),
        };
        let clock = Arc::new(SystemClock);
        let recorder = Arc::new(Recorder::start(store.rows.clone(), clock.clone()));
        let agent = Agent::new(recorder, clock, Tenant::default(), AUDIT_AGENT);
        for path in &args.models {
            let added = add(&items, &engine, path, args, room);
            let id = Agent::scope(Some(agent.clone()), added)
                .await
                .with_context(|| format!("{}", path.display()))?;
            say!("{id} {}", name(path));
        }
        Ok(())
    })
}

async fn add(
    items: &Arc<Items>,
    engine: &Engine,
    path: &Path,
    args: &ImportArgs,
    room: ProductRoom,
) -> Result<String> {
    let organ = &args.organ;
    let mesh = mesh_bytes(path, TEMPLATE_BYTES, "give one with fewer triangles")?;
    let output = engine
        .reader
        .template(&mesh, organ, &args.mesh.into())
        .map_err(|failure| refused(&failure))?;
    let name = name(path);
    let source = TemplateSource {
        tenant: &Tenant::default(),
        name: &name,
        volume: None,
        library: args.library.then_some(true),
    };
    let added = items.add_template(source, organ, output, room).await;
    let (template, _) = added.map_err(|error| match error {
        NotAdded::Refused(failure) | NotAdded::TooMany(failure) | NotAdded::TooLarge(failure) => {
            refused(&failure)
        }
        NotAdded::Store(error) => error.into(),
    })?;
    Ok(template.item.id)
}

fn refused(failure: &Failure) -> anyhow::Error {
    anyhow!("{failure} {}", failure.fix.clone().unwrap_or_default())
}

fn name(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or(path.as_os_str());
    stem.to_string_lossy().into_owned()
}
