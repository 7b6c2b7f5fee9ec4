//! A data set under construction, over `dicom-object`.

use super::code::Code;
use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry};
use dicom_core::value::DataSetSequence;
use dicom_core::{DataElement, PrimitiveValue, Tag, VR};
use dicom_dictionary_std::{StandardDataDictionary, tags, uids};
use dicom_object::{FileMetaTableBuilder, InMemDicomObject};

/// Implementation Class UID (0002,0012) of this software: derived from a UUID that was drawn once.
pub const IMPLEMENTATION_CLASS_UID: &str = "2.25.212046303391268093411418305311126403873";

/// Implementation Version Name (0002,0013) of this software.
pub const IMPLEMENTATION_NAME: &str = "VENTRIFORM";

/// Why a data set cannot be encoded.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the data set cannot be encoded: {0}")]
pub struct EncodingError(pub String);

/// Elements by tag. The value representation of an attribute is the dictionary's.
#[derive(Debug, Clone)]
pub struct DataSet(InMemDicomObject);

impl Default for DataSet {
    fn default() -> Self {
        Self(InMemDicomObject::new_empty())
    }
}

impl DataSet {
    /// No elements yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Puts a value whose representation the dictionary does not decide.
    pub fn put(&mut self, tag: Tag, vr: VR, value: PrimitiveValue) {
        self.0.put(DataElement::new(tag, vr, value));
    }

    /// Puts text; backslashes separate several values. Empty text gives an empty element.
    pub fn text(&mut self, tag: Tag, text: impl Into<String>) {
        let text = text.into();
        let value = if text.is_empty() {
            PrimitiveValue::Empty
        } else {
            PrimitiveValue::Str(text)
        };
        self.put(tag, representation(tag), value);
    }

    /// Puts text, or an empty element for `None`.
    pub fn stated(&mut self, tag: Tag, text: Option<&str>) {
        self.text(tag, text.unwrap_or_default());
    }

    /// Puts text unless there is none.
    pub fn known(&mut self, tag: Tag, text: Option<&str>) {
        if let Some(text) = text.filter(|text| !text.is_empty()) {
            self.text(tag, text);
        }
    }

    /// Puts an empty element.
    pub fn empty(&mut self, tag: Tag) {
        self.put(tag, representation(tag), PrimitiveValue::Empty);
    }

    /// Puts a 16-bit number.
    pub fn short(&mut self, tag: Tag, number: u16) {
        self.put(tag, VR::US, PrimitiveValue::from(number));
    }

    /// Puts 16-bit numbers.
    pub fn shorts(&mut self, tag: Tag, numbers: &[u16]) {
        self.put(tag, VR::US, PrimitiveValue::U16(numbers.into()));
    }

    /// Puts 32-bit numbers.
    pub fn longs(&mut self, tag: Tag, numbers: Vec<u32>) {
        self.put(
            tag,
            representation(tag),
            PrimitiveValue::U32(numbers.into()),
        );
    }

    /// Puts numbers of single precision.
    pub fn floats(&mut self, tag: Tag, numbers: Vec<f32>) {
        self.put(
            tag,
            representation(tag),
            PrimitiveValue::F32(numbers.into()),
        );
    }

    /// Puts numbers of double precision.
    pub fn doubles(&mut self, tag: Tag, numbers: &[f64]) {
        self.put(tag, VR::FD, PrimitiveValue::F64(numbers.into()));
    }

    /// Puts the tags of other attributes.
    pub fn tags(&mut self, tag: Tag, named: &[Tag]) {
        self.put(tag, VR::AT, PrimitiveValue::Tags(named.into()));
    }

    /// Puts words of 16 bits, given as bytes, the lower first.
    pub fn words(&mut self, tag: Tag, bytes: Vec<u8>) {
        self.put(tag, VR::OW, PrimitiveValue::U8(bytes.into()));
    }

    /// Puts the tag of another attribute.
    pub fn tag(&mut self, tag: Tag, named: Tag) {
        self.put(tag, VR::AT, PrimitiveValue::from(named));
    }

    /// Puts bytes, padded to an even number.
    pub fn bytes(&mut self, tag: Tag, mut bytes: Vec<u8>) {
        if bytes.len() % 2 == 1 {
            bytes.push(0);
        }
        self.put(tag, VR::OB, PrimitiveValue::U8(bytes.into()));
    }

    /// Puts decimal numbers.
    pub fn decimals(&mut self, tag: Tag, numbers: &[f64]) {
        let texts: Vec<String> = numbers.iter().map(|x| decimal(*x)).collect();
        self.text(tag, texts.join("\\"));
    }

    /// Puts a sequence.
    pub fn items(&mut self, tag: Tag, items: Vec<DataSet>) {
        let items: Vec<InMemDicomObject> = items.into_iter().map(|item| item.0).collect();
        let sequence = DataSetSequence::from(items);
        self.0.put(DataElement::new(tag, VR::SQ, sequence));
    }

    /// Puts a sequence with one item.
    pub fn item(&mut self, tag: Tag, item: DataSet) {
        self.items(tag, vec![item]);
    }

    /// Puts a sequence with one coded concept.
    pub fn code(&mut self, tag: Tag, code: Code) {
        let mut item = DataSet::new();
        item.text(tags::CODE_VALUE, code.value);
        item.text(tags::CODING_SCHEME_DESIGNATOR, code.scheme);
        item.text(tags::CODE_MEANING, code.meaning);
        self.item(tag, item);
    }

    /// The data set as a file, Explicit VR Little Endian.
    ///
    /// # Errors
    /// [`EncodingError`].
    pub fn file(self) -> Result<Vec<u8>, EncodingError> {
        let meta = FileMetaTableBuilder::new()
            .transfer_syntax(uids::EXPLICIT_VR_LITTLE_ENDIAN)
            .implementation_class_uid(IMPLEMENTATION_CLASS_UID)
            .implementation_version_name(IMPLEMENTATION_NAME);
        let object = self.0.with_meta(meta).map_err(encoding)?;
        let mut bytes = Vec::new();
        object.write_all(&mut bytes).map_err(encoding)?;
        Ok(bytes)
    }
}

/// Preamble and File Meta Information (PS3.10, 7.1) of an object that follows as a data set.
///
/// # Errors
/// [`EncodingError`] if a UID is too long.
pub fn file_start(
    sop_class: &str,
    sop_instance: &str,
    transfer_syntax: &str,
) -> Result<Vec<u8>, EncodingError> {
    let meta = FileMetaTableBuilder::new()
        .media_storage_sop_class_uid(sop_class)
        .media_storage_sop_instance_uid(sop_instance)
        .transfer_syntax(transfer_syntax)
        .implementation_class_uid(IMPLEMENTATION_CLASS_UID)
        .implementation_version_name(IMPLEMENTATION_NAME)
        .build()
        .map_err(encoding)?;
    let mut bytes = vec![0; 128];
    bytes.extend_from_slice(b"DICM");
    meta.write(&mut bytes).map_err(encoding)?;
    Ok(bytes)
}

fn encoding(error: impl std::error::Error) -> EncodingError {
    EncodingError(error.to_string())
}

/// The value representation of a standard attribute.
fn representation(tag: Tag) -> VR {
    let entry = StandardDataDictionary.by_tag(tag);
    entry.map_or(VR::UN, |entry| entry.vr().relaxed())
}

/// A decimal string (DS): at most 16 characters, as many digits as they hold.
fn decimal(number: f64) -> String {
    const MAX_TEXT_CHARS: usize = 16;
    let number = number + 0.0;
    let shortest = format!("{number}");
    if shortest.len() <= MAX_TEXT_CHARS {
        return shortest;
    }
    let fixed = (0..=14).rev().map(|digits| format!("{number:.digits$}"));
    let scientific = (0..=10).rev().map(|digits| format!("{number:.digits$e}"));
    let fits = |text: &String| text.len() <= MAX_TEXT_CHARS;
    let best = if number.abs() < 1e-4 {
        scientific.chain(fixed).find(fits)
    } else {
        fixed.chain(scientific).find(fits)
    };
    best.unwrap_or_else(|| "0".into())
}

/// The item that refers to an instance, in the form of the SOP Instance Reference Macro.
pub fn reference(class: &str, instance: &str) -> DataSet {
    let mut item = DataSet::new();
    item.text(tags::REFERENCED_SOP_CLASS_UID, class);
    item.text(tags::REFERENCED_SOP_INSTANCE_UID, instance);
    item
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimals_have_sixteen_characters_at_most() {
        for (number, text) in [
            (0.0, "0"),
            (-0.0, "0"),
            (3.5, "3.5"),
            (-123.456_789_012_345_67, "-123.45678901235"),
            (1.0 / 3.0, "0.33333333333333"),
            (-1.234_567_890_123e-9, "-1.23456789012e-9"),
        ] {
            let shown = decimal(number);
            assert!(shown.len() <= 16);
            let read: f64 = shown.parse().unwrap();
            assert!(
                (read - number).abs() <= 1e-9 * number.abs().max(1e-3),
                "{text}: {shown}"
            );
        }
    }
}
