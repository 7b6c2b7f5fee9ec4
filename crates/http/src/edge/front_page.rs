//! `GET /`: the page for browsers, a few commands for curl. `/docs`, `/assets/*`: the rest of the page.
//!
//! The page is built from `web/` and committed as `web/dist`, each file beside its compressed forms. The
//! names of what lies in `assets/` hold a hash of the content, so browsers keep those files for ever.
//!
//! The page names its files relative to itself, so it works under any path of a proxy. Where the path is
//! known ([`crate::wire::public_base`]), they are named from the root instead: a proxy may show the page at
//! `/heart`, from where `assets/` would lead to `/assets/`. The page's programs find the service from
//! their own address.

use crate::wire::negotiate;
use crate::wire::problem::not_found::no_such_path;
use crate::wire::public_base::PublicBase;
use axum::extract::Path;
use axum::http::{HeaderMap, HeaderValue, Uri, header};
use axum::response::{IntoResponse, Response};
use include_dir::{Dir, include_dir};

static PAGE_BUNDLE: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../../web/dist");

const INDEX_FILE: &str = "index.html";

const HTML_TYPE: &str = "text/html; charset=utf-8";

/// The beginning of the names of its files in the page.
const PAGE_ROOT: &str = "./";

/// Content security policy of the page: run the programs and styles that are files of this service, show pictures that
/// it fetched or drew itself, and call its own service. Nothing comes from elsewhere.
const PAGE_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; \
    connect-src 'self'; form-action 'none'; base-uri 'none'; frame-ancestors 'none'";

/// Cache control of files that never change.
const FOR_EVER: &str = "public, max-age=31536000, immutable";

/// Cache control of files that are asked for again each time.
const REVALIDATED_CACHE_CONTROL: &str = "no-cache";

/// The page if the client prefers HTML, else text.
pub async fn welcome(headers: HeaderMap) -> Response {
    let html = negotiate::best_offer(&headers, &["text/plain", "text/html"]) == Some(1);
    let page = html.then(|| index("./", &headers));
    let mut response = match page.flatten() {
        Some(page) => page,
        None => commands(&url()).into_response(),
    };
    let vary = HeaderValue::from_static("accept, accept-encoding");
    response.headers_mut().insert(header::VARY, vary);
    response
}

/// The documentation of the API: the same page, which reads `/openapi.json`.
pub async fn documentation(uri: Uri, headers: HeaderMap) -> Response {
    let root = if uri.path().ends_with('/') {
        "../"
    } else {
        "./"
    };
    match index(root, &headers) {
        Some(page) => page,
        None => no_such_path().await.into_response(),
    }
}

/// The page; `root` leads from where it is asked for to the root of the service.
fn index(root: &str, headers: &HeaderMap) -> Option<Response> {
    let prefix = PublicBase::current().map(|base| base.prefix().to_owned());
    let root = match prefix.as_deref() {
        None | Some("") => root.to_owned(),
        Some(prefix) => format!("{prefix}/"),
    };
    if root == PAGE_ROOT {
        return file(INDEX_FILE, HTML_TYPE, REVALIDATED_CACHE_CONTROL, headers);
    }
    let page = PAGE_BUNDLE.get_file(INDEX_FILE)?.contents_utf8()?;
    let page = page.replace(&format!("\"{PAGE_ROOT}"), &format!("\"{root}"));
    Some(described(
        page.into_response(),
        HTML_TYPE,
        REVALIDATED_CACHE_CONTROL,
    ))
}

/// A program, style or picture of the page.
pub async fn asset(Path(name): Path<String>, headers: HeaderMap) -> Response {
    let media_type = match name.rsplit('.').next() {
        Some("js") => "text/javascript",
        Some("css") => "text/css",
        Some("svg") => "image/svg+xml",
        _ => return no_such_path().await.into_response(),
    };
    match file(&format!("assets/{name}"), media_type, FOR_EVER, &headers) {
        Some(response) => response,
        None => no_such_path().await.into_response(),
    }
}

/// The picture that browsers ask every site for, also when they show a report.
pub async fn icon(headers: HeaderMap) -> Response {
    let assets = PAGE_BUNDLE
        .get_dir("assets")
        .into_iter()
        .flat_map(Dir::files);
    let mut names = assets.filter_map(|file| file.path().to_str());
    let name = names.find(|name| name.contains("/icon-") && name.ends_with(".svg"));
    match name.and_then(|name| file(name, "image/svg+xml", REVALIDATED_CACHE_CONTROL, &headers)) {
        Some(response) => response,
        None => no_such_path().await.into_response(),
    }
}

/// A file of the bundle, in the smallest form that the client can unpack; `None` if there is none.
fn file(
    name: &str,
    media_type: &'static str,
    kept: &'static str,
    headers: &HeaderMap,
) -> Option<Response> {
    let packed = [("br", ".br"), ("gzip", ".gz")]
        .into_iter()
        .find_map(|(coding, ending)| {
            let content = PAGE_BUNDLE.get_file(format!("{name}{ending}"))?;
            accepts(headers, coding).then_some((Some(coding), content))
        });
    let (coding, content) = packed.or_else(|| Some((None, PAGE_BUNDLE.get_file(name)?)))?;
    let mut response = described(content.contents().into_response(), media_type, kept);
    if let Some(coding) = coding {
        let coding = HeaderValue::from_static(coding);
        response
            .headers_mut()
            .insert(header::CONTENT_ENCODING, coding);
    }
    Some(response)
}

/// A part of the page with the headers that say what it is and may do.
fn described(mut response: Response, media_type: &'static str, kept: &'static str) -> Response {
    for (name, value) in [
        (header::CONTENT_TYPE, media_type),
        (header::CACHE_CONTROL, kept),
        (header::VARY, "accept-encoding"),
        (header::CONTENT_SECURITY_POLICY, PAGE_POLICY),
    ] {
        response
            .headers_mut()
            .insert(name, HeaderValue::from_static(value));
    }
    response
}

/// Whether `Accept-Encoding` names this coding and does not refuse it by `q=0`.
fn accepts(headers: &HeaderMap, coding: &str) -> bool {
    let values = headers.get_all(header::ACCEPT_ENCODING).iter();
    let mut offers = values
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(','));
    offers.any(|offer| {
        let (name, weight) = offer.split_once(';').unwrap_or((offer, ""));
        let weight = weight
            .trim()
            .strip_prefix("q=")
            .and_then(|text| text.parse::<f32>().ok());
        name.trim().eq_ignore_ascii_case(coding) && weight != Some(0.0)
    })
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
