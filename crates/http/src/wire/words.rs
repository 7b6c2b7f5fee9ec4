//! Values that requests and answers give by a word: read, written and documented by the names that the library and the
//! service have for them.

use crate::wire::query::parsed;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;
use utoipa::openapi::RefOr;
use utoipa::openapi::schema::{ObjectBuilder, Schema, Type};
use utoipa::{PartialSchema, ToSchema};
use ventriform::heart::comparison::WhichScan;
use ventriform::heart::model::Organ;
use ventriform::mesh::files::{MeshFrame, MeshUnit};
use ventriform::results::export::Part;
use ventriform_service::base::records::{JobOnScan, JobState, MadeOfScan, Priority, ScanOrder};
use ventriform_service::callers::Scope;
use ventriform_service::network::hooks::HookEvent;
use ventriform_service::network::intake::GroupState;

/// A value given by its name.
#[derive(Debug, Clone, Copy)]
pub struct Word<T>(pub T);

/// A type whose values have names.
pub trait Named: Copy + 'static {
    /// All values.
    const ALL: &'static [Self];
    /// The name of the type in the OpenAPI document.
    const SCHEMA_NAME: &'static str;
    /// The description of the type there; parameters have one of their own.
    const SCHEMA_DESCRIPTION: Option<&'static str>;

    /// The name of a value.
    fn as_str(self) -> &'static str;
}

/// Names the values of types that have `ALL` and `as_str`.
macro_rules! named {
    ($($type:ident, $name:ident, $schema:literal, $description:expr;)+) => {$(
        #[doc = concat!("The name of a [`", stringify!($type), "`].")]
        pub type $name = Word<$type>;

        impl Named for $type {
            const ALL: &'static [Self] = &<$type>::ALL;
            const SCHEMA_NAME: &'static str = $schema;
            const SCHEMA_DESCRIPTION: Option<&'static str> = $description;

            fn as_str(self) -> &'static str {
                self.as_str()
            }
        }
    )+};
}

named! {
    HookEvent, HookEventName, "HookEvent", Some("What is told of a job.");
    GroupState, ReceivedState, "ReceivedState", Some("What became of received objects.");
    JobOnScan, JobOnScanName, "JobOnScan", None;
    JobState, JobStateName, "JobState", Some("The state of a job.");
    MadeOfScan, MadeOfScanName, "MadeOfScan", None;
    MeshFrame, MeshFrameName, "MeshFrame", None;
    MeshUnit, MeshUnitName, "MeshUnit", None;
    Organ, OrganName, "Organ", None;
    Part, PartName, "Part", None;
    Priority, PriorityName, "Priority", Some("How urgent a job is.");
    ScanOrder, ScanOrderName, "ScanOrder", None;
    Scope, ScopeName, "Scope", Some("What a key allows.");
    WhichScan, WhichScanName, "WhichScan", None;
}

fn words<T: Named>() -> impl Iterator<Item = &'static str> {
    T::ALL.iter().map(|value| value.as_str())
}

impl<'de, T: Named> Deserialize<'de> for Word<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let named = |text: &str| T::ALL.iter().find(|value| value.as_str() == text);
        let expected: Vec<_> = words::<T>().collect();
        let expected = format!("one of {}", expected.join(", "));
        parsed(deserializer, named, &expected).map(|value| Self(*value))
    }
}

impl<T: Named> Serialize for Word<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.0.as_str())
    }
}

impl<T: Named> PartialSchema for Word<T> {
    fn schema() -> RefOr<Schema> {
        let word = ObjectBuilder::new().schema_type(Type::String);
        let word = word.description(T::SCHEMA_DESCRIPTION);
        Schema::from(word.enum_values(Some(words::<T>()))).into()
    }
}

impl<T: Named> ToSchema for Word<T> {
    fn name() -> Cow<'static, str> {
        T::SCHEMA_NAME.into()
    }
}
