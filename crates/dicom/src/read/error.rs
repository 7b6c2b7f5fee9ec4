//! Errors of reading a data set.

/// Problems of a DICOM file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ReadError {
    /// A transfer syntax that is not supported.
    #[error("{file} is {format}, which is not supported")]
    Unsupported {
        /// The file's name.
        file: String,
        /// The transfer syntax.
        format: String,
        /// A way to make a readable file of it.
        fix: &'static str,
    },
    /// An object that holds no volume.
    #[error("{file} is {found}: {reason}")]
    NotVolume {
        /// The file's name.
        file: String,
        /// Name, SOP class and modality of the object.
        found: String,
        /// Its content.
        reason: &'static str,
        /// Advice on files that can be read.
        fix: &'static str,
    },
    /// An image whose Image Type says that it does not contain reconstructed slices.
    #[error("{file} has the Image Type {image_type}: {reason}")]
    NotSlices {
        /// The file's name.
        file: String,
        /// Image Type (0008,0008), or the value that tells.
        image_type: String,
        /// Its content.
        reason: &'static str,
        /// Advice on files that can be read.
        fix: &'static str,
    },
    /// An attribute has an invalid value.
    #[error("{file}: {field} is {value}: {reason}")]
    Field {
        /// The file's name.
        file: String,
        /// Name and tag of the attribute.
        field: &'static str,
        /// The invalid value.
        value: String,
        /// Why it is invalid.
        reason: String,
        /// Offset of the value in the unpacked file, if known.
        byte: Option<u64>,
    },
    /// The file is shorter than its lengths imply.
    #[error(
        "{file} is cut off or its header is wrong: it needs {needed} bytes and has at most {found}"
    )]
    Truncated {
        /// The file's name.
        file: String,
        /// Bytes (unpacked) up to the end of the element.
        needed: u64,
        /// Bytes (unpacked) in the file; for a packed file an upper bound.
        found: u64,
    },
    /// The data set is damaged.
    #[error("{file} is damaged after {byte} unpacked bytes: {reason}")]
    Corrupt {
        /// The file's name.
        file: String,
        /// Offset of the damage in the unpacked file.
        byte: u64,
        /// Message of the parser.
        reason: String,
    },
    /// The caller stopped the work.
    #[error("stopped")]
    Stopped,
}
