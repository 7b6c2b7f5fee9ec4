//! The kinds of items that have an id.

/// A kind of item. It decides the prefix of ids, the path over HTTP and the folder of files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Resource {
    /// An upload.
    Volume,
    /// A surface model made from a volume.
    Model,
    /// A model fitted to a volume.
    Segmentation,
    /// One wall in motion, fitted to the gates of a volume.
    Beat,
    /// Rest and stress of one patient, compared.
    Comparison,
    /// Scans of one patient over the years, compared.
    Serial,
    /// What a reader states of a result.
    Reading,
    /// Normal limits: the uptake of healthy people.
    Normals,
    /// A model of the library, tried by `model=auto`.
    Template,
    /// A reader's profile.
    Reader,
    /// A job.
    Job,
}

impl Resource {
    /// Every kind.
    pub const ALL: [Resource; 11] = [
        Resource::Volume,
        Resource::Model,
        Resource::Segmentation,
        Resource::Beat,
        Resource::Comparison,
        Resource::Serial,
        Resource::Reading,
        Resource::Normals,
        Resource::Template,
        Resource::Reader,
        Resource::Job,
    ];

    /// The kinds that have files.
    pub const WITH_FILES: [Resource; 10] = [
        Resource::Volume,
        Resource::Model,
        Resource::Segmentation,
        Resource::Beat,
        Resource::Comparison,
        Resource::Serial,
        Resource::Reading,
        Resource::Normals,
        Resource::Template,
        Resource::Reader,
    ];

    /// The prefix of its ids.
    pub fn prefix(self) -> &'static str {
        match self {
            Resource::Volume => "vol_",
            Resource::Model => "mdl_",
            Resource::Segmentation => "seg_",
            Resource::Beat => "bea_",
            Resource::Comparison => "cmp_",
            Resource::Serial => "ser_",
            Resource::Reading => "rdg_",
            Resource::Normals => "nrm_",
            Resource::Template => "tpl_",
            Resource::Reader => "rdr_",
            Resource::Job => "job_",
        }
    }

    /// Its name, singular. Also the kind of the jobs that make it.
    pub fn noun(self) -> &'static str {
        match self {
            Resource::Volume => "volume",
            Resource::Model => "model",
            Resource::Segmentation => "segmentation",
            Resource::Beat => "beat",
            Resource::Comparison => "comparison",
            Resource::Serial => "serial",
            Resource::Reading => "reading",
            Resource::Normals => "normals",
            Resource::Template => "template",
            Resource::Reader => "reader",
            Resource::Job => "job",
        }
    }

    /// Its name, plural: the path over HTTP and the folder in the file store.
    pub fn plural(self) -> &'static str {
        match self {
            Resource::Volume => "volumes",
            Resource::Model => "models",
            Resource::Segmentation => "segmentations",
            Resource::Beat => "beats",
            Resource::Comparison => "comparisons",
            Resource::Serial => "serials",
            Resource::Reading => "readings",
            Resource::Normals => "normals",
            Resource::Template => "templates",
            Resource::Reader => "readers",
            Resource::Job => "jobs",
        }
    }

    /// Its name for readers, singular, where [`Resource::noun`] is a plural.
    pub fn label(self) -> &'static str {
        match self {
            Resource::Normals => "set of normal limits",
            Resource::Serial => "serial comparison",
            other => other.noun(),
        }
    }

    /// Whether one of its kind belongs to the volume of the job that made it, and goes with it: normal limits are
    /// statistics over a cohort.
    pub fn belongs_to_volume(self) -> bool {
        self != Resource::Normals
    }

    /// The kind of item that `id` names, by its prefix.
    pub fn from_id(id: &str) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|resource| id.starts_with(resource.prefix()))
    }
}
