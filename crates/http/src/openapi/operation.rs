//! The documentation of one operation, built by code: for handlers that serve several kinds of
//! things, whose attributes could not name each kind.

use axum::routing::MethodRouter;
use utoipa::openapi::path::{
    HttpMethod, OperationBuilder, Parameter, ParameterBuilder, ParameterIn, Paths,
};
use utoipa::openapi::schema::{Object, Schema, Type};
use utoipa::openapi::{Content, Ref, RefOr, Required, ResponseBuilder};
use utoipa::{IntoParams, IntoResponses, ToSchema};
use utoipa_axum::router::UtoipaMethodRouter;

/// The description of one method of one path.
pub struct Documented {
    path: String,
    method: HttpMethod,
    operation: OperationBuilder,
    schemas: Vec<(String, RefOr<Schema>)>,
}

impl Documented {
    /// An operation without parameters and answers.
    pub fn new(method: HttpMethod, path: String, tag: &str, id: String, summary: String) -> Self {
        let operation = OperationBuilder::new()
            .tag(tag)
            .operation_id(Some(id))
            .summary(Some(summary));
        Self {
            path,
            method,
            operation,
            schemas: Vec::new(),
        }
    }

    /// Adds a description.
    pub fn description(mut self, text: impl Into<String>) -> Self {
        self.operation = self.operation.description(Some(text));
        self
    }

    /// Adds a segment of the path as a parameter. Its values are those of `schema`.
    pub fn segment(mut self, name: &str, description: String, schema: RefOr<Schema>) -> Self {
        let segment = ParameterBuilder::new()
            .name(name)
            .parameter_in(ParameterIn::Path)
            .required(Required::True)
            .description(Some(description))
            .schema(Some(schema))
            .build();
        self.operation = self.operation.parameter(segment);
        self
    }

    /// Adds the segment `id` of the path.
    pub fn id(self, noun: &str) -> Self {
        let text = Schema::from(Object::with_type(Type::String));
        self.segment("id", format!("The {noun}'s id"), text.into())
    }

    /// Adds a group of parameters.
    pub fn parameters<P: IntoParams>(mut self) -> Self {
        for parameter in P::into_params(|| None) {
            self.operation = self.operation.parameter::<Parameter>(parameter);
        }
        self
    }

    /// Adds a group of answers.
    pub fn answers<R: IntoResponses>(mut self) -> Self {
        for (status, response) in R::responses() {
            self.operation = self.operation.response(status, response);
        }
        self
    }

    /// Adds an answer without a body.
    pub fn empty_answer(mut self, status: &str, description: &str) -> Self {
        let response = ResponseBuilder::new().description(description);
        self.operation = self.operation.response(status, response.build());
        self
    }

    /// Adds 200 with a JSON body of the type `B`.
    pub fn json<B: ToSchema>(mut self, description: &str) -> Self {
        let content = Content::new(Some(self.refer::<B>()));
        let response = ResponseBuilder::new()
            .description(description)
            .content("application/json", content);
        self.operation = self.operation.response("200", response.build());
        self
    }

    /// A reference to the schema of `B`, which is added to the document's components.
    pub fn refer<B: ToSchema>(&mut self) -> RefOr<Schema> {
        self.schemas.push((B::name().into(), B::schema()));
        B::schemas(&mut self.schemas);
        Ref::from_schema_name(B::name()).into()
    }

    /// The operation together with the handler that serves it.
    pub fn served_by<S>(self, handler: MethodRouter<S>) -> UtoipaMethodRouter<S> {
        let mut paths = Paths::new();
        paths.add_path_operation(self.path, vec![self.method], self.operation.build());
        (self.schemas, paths, handler)
    }
}
