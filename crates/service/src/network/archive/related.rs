//! The Content-Type of messages with several DICOM objects: `multipart/related` (RFC 2387), as DICOMweb uses it
//! (PS3.18, 8.6.1.2.1).
//!
//! Many programs write `type=application/dicom` without the quotes that its slash asks for, which parsers of
//! media types refuse. So parameters are read here as they come: neither a media type nor a boundary holds a
//! semicolon (RFC 2046, section 5.1.1).

/// `multipart/related` with its parameters.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RelatedType {
    /// `type`: the media type of the parts.
    pub parts: Option<String>,
    /// `boundary`; absent if it is empty.
    pub boundary: Option<String>,
}

impl RelatedType {
    /// `None` if the Content-Type is another one.
    pub fn parse(content_type: &str) -> Option<Self> {
        let mut pieces = content_type.split(';');
        let essence = pieces.next()?.trim();
        if !essence.eq_ignore_ascii_case("multipart/related") {
            return None;
        }
        let parameters: Vec<_> = pieces.filter_map(|piece| piece.split_once('=')).collect();
        let parameter = |wanted: &str| {
            let mut named = parameters.iter();
            let (_, value) = named.find(|(name, _)| name.trim().eq_ignore_ascii_case(wanted))?;
            let value = value.trim().trim_matches('"');
            (!value.is_empty()).then(|| value.to_owned())
        };
        Some(Self {
            parts: parameter("type"),
            boundary: parameter("boundary"),
        })
    }

    /// Whether the parts may be DICOM objects: `type` says so, or is missing.
    pub fn is_dicom(&self) -> bool {
        let parts = self.parts.as_deref();
        parts.is_none_or(|parts| parts.eq_ignore_ascii_case("application/dicom"))
    }
}

#[cfg(test)]
#[allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]
mod tests {
    use super::*;

    #[test]
    fn parameters_are_read_as_programs_write_them() {
        for text in [
            "multipart/related; type=\"application/dicom\"; boundary=b:1",
            "Multipart/Related; boundary=\"b:1\"; type=application/dicom",
            "multipart/related;BOUNDARY=b:1 ; type = APPLICATION/DICOM",
            "multipart/related; boundary=b:1",
        ] {
            let related = RelatedType::parse(text).unwrap();
            assert_eq!(related.boundary.as_deref(), Some("b:1"), "{text}");
            assert!(related.is_dicom(), "{text}");
        }
        let json = "multipart/related; type=\"application/dicom+json\"; boundary=b";
        assert!(!RelatedType::parse(json).unwrap().is_dicom());
        for none in ["multipart/related", "multipart/related; boundary=\"\""] {
            assert_eq!(RelatedType::parse(none).unwrap().boundary, None);
        }
        assert_eq!(RelatedType::parse("multipart/form-data; boundary=b"), None);
        assert_eq!(RelatedType::parse(""), None);
    }
}
