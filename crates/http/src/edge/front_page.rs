//! `GET /`: the page for browsers, a few commands for curl. `/docs`, `/assets/*`: the rest of the page. `/examples/*`:
//! simulated scans that the page offers to those who have none at hand; each is made when it is asked for first.
//!
//! The page is built from `web/` and committed as `web/dist`, under names that stay the same. It is served under
//! `/assets/VERSION/`, where the version is a hash of all its files, so browsers keep them for ever, and never mix
//! those of two versions. The files are compressed when the page is asked for first.
//!
//! The page names its files relative to itself, so it works under any path of a proxy. Where the path is
//! known ([`crate::wire::public_base`]), they are named from the root instead: a proxy may show the page at
//! `/heart`, from where `assets/` would lead to `/assets/`. The page's programs find the service from
//! their own address.

use crate::wire::negotiate;
use crate::wire::packed::PackedFile;
use crate::wire::problem::Problem;
use crate::wire::problem::not_found::no_such_path;
use crate::wire::public_base::PublicBase;
use axum::extract::Path;
use axum::http::{HeaderMap, HeaderValue, Uri, header};
use axum::response::{Html, IntoResponse, Response};
use include_dir::{Dir, include_dir};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::sync::LazyLock;
use tokio::sync::OnceCell;
use ventriform::base::progress::Monitor;
use ventriform::runs::examples::Example;
use ventriform_service::base::records::hex;

static PAGE_FILES: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../../web/dist");

const INDEX_FILE: &str = "index.html";

/// The folder of the page's programs, styles and pictures.
const ASSETS_FOLDER: &str = "assets";

const ICON_FILE: &str = "icon.svg";

/// Hexadecimal digits of a version.
const VERSION_DIGITS: usize = 16;

/// Content security policy of the page: run the programs and styles that are files of this service, show pictures that
/// it fetched or drew itself, and call its own service. Nothing comes from elsewhere.
const PAGE_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; \
    connect-src 'self'; form-action 'none'; base-uri 'none'; frame-ancestors 'none'";

/// Cache control of files that never change.
const FOR_EVER: &str = "public, max-age=31536000, immutable";

/// Cache control of files that are asked for again each time.
const REVALIDATED_CACHE_CONTROL: &str = "no-cache";

/// The files of the page.
struct Page {
    version: String,
    index: &'static str,
    /// By their names in [`ASSETS_FOLDER`].
    assets: BTreeMap<&'static str, PackedFile>,
    /// The icon under the address where browsers look for it, which has no version.
    icon: Option<PackedFile>,
}

static PAGE: LazyLock<Page> = LazyLock::new(Page::pack);

impl Page {
    /// Hashes and compresses the files.
    fn pack() -> Self {
        let index = PAGE_FILES
            .get_file(INDEX_FILE)
            .and_then(|file| file.contents_utf8());
        let folder = PAGE_FILES.get_dir(ASSETS_FOLDER);
        let mut hash = Sha256::new();
        let mut assets = BTreeMap::new();
        for file in folder.into_iter().flat_map(Dir::files) {
            let name = file.path().file_name().and_then(|name| name.to_str());
            let Some((name, media_type)) = name.and_then(|name| Some((name, media_type(name)?)))
            else {
                continue;
            };
            for part in [name.as_bytes(), file.contents()] {
                hash.update((part.len() as u64).to_le_bytes());
                hash.update(part);
            }
            assets.insert(name, PackedFile::new(file.contents(), media_type, FOR_EVER));
        }
        let icon = PAGE_FILES.get_file(format!("{ASSETS_FOLDER}/{ICON_FILE}"));
        let icon = icon.zip(media_type(ICON_FILE)).map(|(file, media_type)| {
            PackedFile::new(file.contents(), media_type, REVALIDATED_CACHE_CONTROL)
        });
        let mut version = hex(&hash.finalize());
        version.truncate(VERSION_DIGITS);
        Self {
            version,
            index: index.unwrap_or_default(),
            assets,
            icon,
        }
    }

    /// The page itself; `root` leads from where it is asked for to the root of the service.
    fn index(&self, root: &str) -> Response {
        let prefix = PublicBase::current().map(|base| base.prefix().to_owned());
        let root = match prefix.as_deref() {
            None | Some("") => root.to_owned(),
            Some(prefix) => format!("{prefix}/"),
        };
        let assets = format!("\"{root}{ASSETS_FOLDER}/{}/", self.version);
        let page = self
            .index
            .replace(&format!("\"./{ASSETS_FOLDER}/"), &assets)
            .replace("\"./", &format!("\"{root}"));
        let mut response = with_policy(Html(page).into_response());
        let headers = response.headers_mut();
        let revalidated = HeaderValue::from_static(REVALIDATED_CACHE_CONTROL);
        headers.insert(header::CACHE_CONTROL, revalidated);
        response
    }
}

fn media_type(name: &str) -> Option<&'static str> {
    match name.rsplit('.').next()? {
        "js" => Some("text/javascript"),
        "css" => Some("text/css"),
        "svg" => Some("image/svg+xml"),
        _ => None,
    }
}

/// The page if the client prefers HTML, else text.
pub async fn welcome(headers: HeaderMap) -> Response {
    let html = negotiate::best_offer(&headers, &["text/plain", "text/html"]) == Some(1);
    let mut response = if html {
        PAGE.index("./")
    } else {
        commands(&url()).into_response()
    };
    let vary = HeaderValue::from_static("accept");
    response.headers_mut().insert(header::VARY, vary);
    response
}

/// The documentation of the API: the same page, which reads `/openapi.json`.
pub async fn documentation(uri: Uri) -> Response {
    let below = uri.path().ends_with('/');
    PAGE.index(if below { "../" } else { "./" })
}

/// A program, style or picture of the page.
pub async fn asset(Path((version, name)): Path<(String, String)>, headers: HeaderMap) -> Response {
    match PAGE.assets.get(&*name).filter(|_| version == PAGE.version) {
        Some(file) => with_policy(file.answer(&headers)),
        None => no_such_path().await.into_response(),
    }
}

/// The media type of the examples.
const DICOM_MEDIA_TYPE: &str = "application/dicom";

/// The files of the examples that were asked for, in the order of [`Example::ALL`].
static EXAMPLES: [OnceCell<PackedFile>; Example::ALL.len()] =
    [const { OnceCell::const_new() }; Example::ALL.len()];

/// A simulated scan as a DICOM file.
pub async fn example(Path(name): Path<String>, headers: HeaderMap) -> Response {
    let mut known = Example::ALL.into_iter().zip(&EXAMPLES);
    let Some((example, cell)) = known.find(|(example, _)| example.file_name() == name) else {
        return no_such_path().await.into_response();
    };
    let made = cell.get_or_try_init(|| async {
        let simulated = tokio::task::spawn_blocking(move || {
            let file = example.file(&Monitor::silent());
            let packed = |bytes: Vec<u8>| {
                PackedFile::new(bytes, DICOM_MEDIA_TYPE, REVALIDATED_CACHE_CONTROL)
            };
            file.map(packed).map_err(|error| error.to_string())
        });
        simulated.await.map_err(|error| error.to_string())?
    });
    match made.await {
        Ok(file) => file.answer(&headers),
        Err(error) => Problem::internal(&error).into_response(),
    }
}

/// The picture that browsers ask every site for, also when they show a report.
pub async fn icon(headers: HeaderMap) -> Response {
    match &PAGE.icon {
        Some(file) => with_policy(file.answer(&headers)),
        None => no_such_path().await.into_response(),
    }
}

fn with_policy(mut response: Response) -> Response {
    let policy = HeaderValue::from_static(PAGE_POLICY);
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_SECURITY_POLICY, policy);
    response
}

/// The address under which the client reached the service.
fn url() -> String {
    PublicBase::current().map_or_else(String::new, |base| base.url())
}

fn commands(url: &str) -> String {
    format!(
        "ventriform {version}: surface models of the left ventricle from cardiac SPECT

A model of 150 points, as GLB:
  curl -fsS --data-binary @spect.nii.gz -H 'Prefer: wait=60' -H 'Accept: model/gltf-binary' \
  '{url}/v1/models?points=150' -o lv.glb
The same in the background; the answer names the job:
  curl -fsS --data-binary @spect.nii.gz '{url}/v1/models?points=150'
The wall of the ventricle as mask.nii.gz, found with the best model of the library:
  curl -fsS --data-binary @spect.nii.gz -H 'Prefer: wait=60' '{url}/v1/segmentations?model=auto' -o mask.nii.gz
Volumes, ejection fraction and motion of the wall of a gated study:
  curl -fsS --data-binary @gated.nii.gz -H 'Prefer: wait=60' '{url}/v1/beats' -o beat.json
Rest and stress of one patient, compared:
  curl -fsS -F stress=@stress.dcm -F rest=@rest.dcm -H 'Prefer: wait=60' '{url}/v1/comparisons' -o comparison.json
The jobs and their progress:
  curl -fsS '{url}/v1/jobs'
Stored models, segmentations and beats:
  curl -fsS '{url}/v1/models'; curl -fsS '{url}/v1/segmentations'; curl -fsS '{url}/v1/beats'
The report on a model (or a segmentation) as an HTML page:
  curl -fsS '{url}/v1/models/ID/report.html' -o report.html

All paths: {url}/docs, {url}/openapi.json
",
        version = env!("CARGO_PKG_VERSION"),
    )
}
