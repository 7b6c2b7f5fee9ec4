//! Elements of DICOM JSON whose value representation is unknown.
//!
//! In: an element with the VR UN and its value as `InlineBinary`. Out: the element in the VR that the standard gives
//! it, if it is one of the standard. The bytes are in Implicit VR Little Endian (PS3.5 6.2.2), a sequence with
//! everything in it. Texts and sequences become values; what else there is stays as it was sent.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry};
use dicom_core::{Tag, VR};
use dicom_dictionary_std::StandardDataDictionary;
use serde_json::{Map, Value, json};

/// An undefined length.
const UNDEFINED: u32 = u32::MAX;

const ITEM: Tag = Tag(0xfffe, 0xe000);
const ITEM_END: Tag = Tag(0xfffe, 0xe00d);
const SEQUENCE_END: Tag = Tag(0xfffe, 0xe0dd);

/// The element `tag` of unknown representation with `fields` as the standard has it; `None` if it stays as it is.
/// Sequences are nested at most `depth` deep.
pub(super) fn known(tag: &str, fields: &Map<String, Value>, depth: usize) -> Option<Value> {
    let number = |range| u16::from_str_radix(tag.get(range)?, 16).ok();
    let tag = Tag(number(0..4)?, number(4..8)?);
    let binary = fields.get("InlineBinary")?.as_str()?;
    let bytes = STANDARD.decode(binary).ok()?;
    element(tag, &bytes, depth)
}

/// The VR that the standard gives an attribute.
fn standard(tag: Tag) -> Option<VR> {
    let entry = StandardDataDictionary.by_tag(tag)?;
    Some(entry.vr().relaxed())
}

/// An element with the value `bytes`; `None` for what is neither text nor a sequence.
fn element(tag: Tag, bytes: &[u8], depth: usize) -> Option<Value> {
    let vr = standard(tag)?;
    let text = || {
        let text = std::str::from_utf8(bytes).ok()?;
        let text = text.trim_end_matches(['\0', ' ']);
        Some(text.to_owned())
    };
    let parts = || -> Option<Vec<String>> {
        let text = text()?;
        let parts = text
            .split('\\')
            .map(|part| part.trim_matches(' ').to_owned());
        Some(parts.collect())
    };
    let values: Vec<Value> = match vr {
        VR::SQ => {
            let mut rest = bytes;
            let items = items(&mut rest, None, depth)?;
            items.into_iter().map(Value::Object).collect()
        }
        VR::PN => {
            let names = parts()?.into_iter();
            names.map(|name| json!({"Alphabetic": name})).collect()
        }
        VR::LT | VR::ST | VR::UR | VR::UT => vec![Value::from(text()?)],
        VR::AE | VR::AS | VR::CS | VR::DA | VR::DT | VR::LO | VR::SH | VR::TM | VR::UC | VR::UI => {
            parts()?.into_iter().map(Value::from).collect()
        }
        VR::DS | VR::IS => {
            let numbers = parts()?.into_iter().map(|part| part.parse::<f64>().ok());
            let numbers: Option<Vec<f64>> = numbers.collect();
            numbers?.into_iter().map(Value::from).collect()
        }
        _ => return None,
    };
    let vr = vr.to_string();
    Some(if bytes.is_empty() {
        json!({"vr": vr})
    } else {
        json!({"vr": vr, "Value": values})
    })
}

/// Takes `count` bytes off `rest`.
fn take<'a>(rest: &mut &'a [u8], count: usize) -> Option<&'a [u8]> {
    let (taken, left) = rest.split_at_checked(count)?;
    *rest = left;
    Some(taken)
}

/// Takes the tag and the length of an element off `rest`.
fn header(rest: &mut &[u8]) -> Option<(Tag, u32)> {
    let [g0, g1, e0, e1, length @ ..] = *take(rest, 8)?.first_chunk::<8>()?;
    let tag = Tag(u16::from_le_bytes([g0, g1]), u16::from_le_bytes([e0, e1]));
    Some((tag, u32::from_le_bytes(length)))
}

/// The items of a sequence of `length` bytes, or up to the end of `rest`.
fn items(rest: &mut &[u8], length: Option<u32>, depth: usize) -> Option<Vec<Map<String, Value>>> {
    let depth = depth.checked_sub(1)?;
    let mut inside = match length {
        Some(UNDEFINED) | None => *rest,
        Some(length) => take(rest, length as usize)?,
    };
    let mut items = Vec::new();
    let mut ended = false;
    while !inside.is_empty() && !ended {
        match header(&mut inside)? {
            (ITEM, length) => items.push(item(&mut inside, length, depth)?),
            (SEQUENCE_END, _) => ended = true,
            _ => return None,
        }
    }
    if length == Some(UNDEFINED) {
        *rest = inside;
        return ended.then_some(items);
    }
    Some(items)
}

/// An item of `length` bytes.
fn item(rest: &mut &[u8], length: u32, depth: usize) -> Option<Map<String, Value>> {
    let mut inside = match length {
        UNDEFINED => *rest,
        length => take(rest, length as usize)?,
    };
    let mut elements = Map::new();
    let mut ended = false;
    while !inside.is_empty() {
        let (tag, length) = header(&mut inside)?;
        if tag == ITEM_END {
            ended = true;
            break;
        }
        let name = format!("{:04X}{:04X}", tag.group(), tag.element());
        let value = if length == UNDEFINED || standard(tag) == Some(VR::SQ) {
            let items = items(&mut inside, Some(length), depth)?;
            json!({"vr": "SQ", "Value": items})
        } else {
            let bytes = take(&mut inside, length as usize)?;
            let vr = standard(tag).unwrap_or(VR::UN).to_string();
            let stays = || json!({"vr": vr, "InlineBinary": STANDARD.encode(bytes)});
            element(tag, bytes, depth).unwrap_or_else(stays)
        };
        elements.insert(name, value);
    }
    if length == UNDEFINED {
        *rest = inside;
        return ended.then_some(elements);
    }
    Some(elements)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn implicit(tag: [u16; 2], length: Option<u32>, value: &[u8]) -> Vec<u8> {
        let mut bytes: Vec<u8> = tag.iter().flat_map(|n| n.to_le_bytes()).collect();
        bytes.extend(length.unwrap_or(value.len() as u32).to_le_bytes());
        bytes.extend(value);
        bytes
    }

    fn unknown(bytes: &[u8]) -> Map<String, Value> {
        let fields = json!({"vr": "UN", "InlineBinary": STANDARD.encode(bytes)});
        fields.as_object().cloned().unwrap_or_default()
    }

    #[test]
    fn sequences_and_texts_are_read_and_damage_stays_as_it_was_sent() {
        let uid = implicit([0x8, 0x1155], None, b"1.2.3\0");
        let inner = implicit([0xfffe, 0xe000], None, &uid);
        let nested = implicit([0x8, 0x1199], None, &inner);
        let open = [
            implicit([0xfffe, 0xe000], Some(UNDEFINED), &uid),
            implicit([0xfffe, 0xe00d], None, b""),
            implicit([0xfffe, 0xe0dd], None, b""),
        ];
        let open = implicit([0x8, 0x1199], Some(UNDEFINED), &open.concat());
        let study = implicit([0x20, 0xd], None, b"1.2");
        for sequence in [nested, open] {
            let content = [sequence, study.clone()].concat();
            for item in [
                implicit([0xfffe, 0xe000], None, &content),
                [
                    implicit([0xfffe, 0xe000], Some(UNDEFINED), &content),
                    implicit([0xfffe, 0xe00d], None, b""),
                ]
                .concat(),
            ] {
                let found = known("00404021", &unknown(&item), 8);
                let expected = json!({"vr": "SQ", "Value": [{
                    "00081199": {"vr": "SQ", "Value": [{"00081155": {"vr": "UI", "Value": ["1.2.3"]}}]},
                    "0020000D": {"vr": "UI", "Value": ["1.2"]},
                }]});
                assert_eq!(found, Some(expected));
                assert_eq!(known("00404021", &unknown(&item), 1), None);
                for end in 1..item.len() {
                    assert_eq!(known("00404021", &unknown(&item[..end]), 8), None, "{end}");
                }
            }
        }
        let name = known("00100010", &unknown(b"Doe^Jane"), 8);
        assert_eq!(
            name,
            Some(json!({"vr": "PN", "Value": [{"Alphabetic": "Doe^Jane"}]}))
        );
        let label = known("00741204", &unknown(b"A "), 8);
        assert_eq!(label, Some(json!({"vr": "LO", "Value": ["A"]})));
        for (tag, bytes) in [
            ("00280010", &b"\x40\0"[..]),
            ("00091001", b"x "),
            ("zz", b"x "),
        ] {
            assert_eq!(known(tag, &unknown(bytes), 8), None);
        }
    }
}
