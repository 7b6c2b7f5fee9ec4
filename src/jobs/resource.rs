//! The kinds of things that have an id, in one table.

/// A kind of thing. Its name is the start of its ids, its path over HTTP and its shelf.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Resource {
    /// An upload.
    Volume,
    /// A surface model of a volume.
    Model,
    /// A model fitted to a volume.
    Segmentation,
    /// A model of the library: what `auto` tries.
    Template,
    /// Work that was asked for.
    Job,
}

impl Resource {
    /// Every kind.
    pub const ALL: [Resource; 5] = [
        Resource::Volume,
        Resource::Model,
        Resource::Segmentation,
        Resource::Template,
        Resource::Job,
    ];

    /// The kinds that have files.
    pub const SHELVED: [Resource; 4] = [
        Resource::Volume,
        Resource::Model,
        Resource::Segmentation,
        Resource::Template,
    ];

    /// What its ids begin with.
    pub fn prefix(self) -> &'static str {
        match self {
            Resource::Volume => "vol_",
            Resource::Model => "mdl_",
            Resource::Segmentation => "seg_",
            Resource::Template => "tpl_",
            Resource::Job => "job_",
        }
    }

    /// One of them.
    pub fn noun(self) -> &'static str {
        match self {
            Resource::Volume => "volume",
            Resource::Model => "model",
            Resource::Segmentation => "segmentation",
            Resource::Template => "template",
            Resource::Job => "job",
        }
    }

    /// Several of them: their path over HTTP and their shelf in the file store.
    pub fn plural(self) -> &'static str {
        match self {
            Resource::Volume => "volumes",
            Resource::Model => "models",
            Resource::Segmentation => "segmentations",
            Resource::Template => "templates",
            Resource::Job => "jobs",
        }
    }

    /// The kind of thing that an id names.
    pub fn of(id: &str) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|resource| id.starts_with(resource.prefix()))
    }
}
