//! Credentials, and the answers of the guard, which stands before every handler.

use super::answers::problem;
use utoipa::openapi::path::{Operation, PathItem};
use utoipa::openapi::security::{HttpAuthScheme, HttpBuilder, SecurityRequirement, SecurityScheme};
use utoipa::openapi::{Components, OpenApi};

/// The name of the scheme.
const BEARER_SCHEME: &str = "bearer";

/// The paths of the document that need no credentials.
const OPEN_PATHS: [&str; 2] = ["/healthz", "/readyz"];

/// Answers of every operation.
const COMMON_ANSWERS: [(u16, &str); 1] = [(421, "The Host header names another service")];

/// Answers of operations that need credentials.
const GUARDED_ANSWERS: [(u16, &str); 4] = [
    (401, "The credentials are missing or wrong"),
    (
        403,
        "The credentials do not allow this, or a page of another site sent the request",
    ),
    (
        429,
        "This caller has sent too many requests, or its tenant has too many waiting jobs",
    ),
    (
        503,
        "Something that this needs is out of order; Retry-After says when to try again",
    ),
];

/// Adds the scheme, and to every operation what it needs and how it is refused.
pub fn add_access(document: &mut OpenApi) {
    let scheme = HttpBuilder::new()
        .scheme(HttpAuthScheme::Bearer)
        .bearer_format("API key or JWT")
        .description(Some(
            "A key made by `ventriform keys create`, or a token of the service's OpenID Connect \
             issuer. A service on a loopback address needs none until its first key is made.",
        ))
        .build();
    document
        .components
        .get_or_insert_with(Components::new)
        .add_security_scheme(BEARER_SCHEME, SecurityScheme::Http(scheme));
    for (path, item) in &mut document.paths.paths {
        let open = OPEN_PATHS.contains(&path.as_str());
        for operation in operations(item) {
            refuse(operation, &COMMON_ANSWERS);
            if open {
                operation.security = Some(Vec::new());
                continue;
            }
            refuse(operation, &GUARDED_ANSWERS);
            let requirement = SecurityRequirement::new(BEARER_SCHEME, [] as [String; 0]);
            operation.security = Some(vec![requirement]);
            let uploads = operation.responses.responses.contains_key("413");
            if uploads {
                refuse(
                    operation,
                    &[(507, "The disk, or the quota of the tenant, is full")],
                );
            }
        }
    }
}

fn operations(item: &mut PathItem) -> impl Iterator<Item = &mut Operation> {
    let all = [
        &mut item.get,
        &mut item.head,
        &mut item.post,
        &mut item.put,
        &mut item.patch,
        &mut item.delete,
    ];
    all.into_iter().filter_map(Option::as_mut)
}

fn refuse(operation: &mut Operation, answers: &[(u16, &str)]) {
    for (status, description) in answers {
        let (status, response) = problem(*status, description);
        let responses = &mut operation.responses.responses;
        responses.entry(status).or_insert(response);
    }
}
