//! Values that a file gives another value representation than the standard does.
//!
//! In: the stored bytes, the VR that the file states and the attribute. Out: the bytes in the attribute's own
//! VR. A VR of the same size or both of text change nothing; UN and the VRs of plain bytes hold the value as it
//! is. Numbers are converted between binary forms and text if the attribute's VR can hold them exactly;
//! otherwise the value is refused, because its bytes mean another number when they are read as they are.

use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry};
use dicom_core::{Tag, VR};
use dicom_dictionary_std::StandardDataDictionary;
use dicom_encoding::transfer_syntax::Endianness;

/// What the bytes of a value are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    Text,
    /// Whole numbers of so many bytes, signed or not.
    Whole(usize, bool),
    Single,
    Double,
    /// Groups and elements.
    Tags,
    /// Bytes, or words of so many bytes, without a meaning of their own.
    Plain,
}

impl Form {
    fn from_representation(vr: VR) -> Self {
        match vr {
            VR::US => Self::Whole(2, false),
            VR::SS => Self::Whole(2, true),
            VR::UL => Self::Whole(4, false),
            VR::SL => Self::Whole(4, true),
            VR::UV => Self::Whole(8, false),
            VR::SV => Self::Whole(8, true),
            VR::FL => Self::Single,
            VR::FD => Self::Double,
            VR::AT => Self::Tags,
            VR::OB | VR::OD | VR::OF | VR::OL | VR::OV | VR::OW | VR::SQ | VR::UN => Self::Plain,
            _ => Self::Text,
        }
    }

    /// Bytes of a word, in which an order of bytes shows.
    fn word(self) -> usize {
        match self {
            Self::Text | Self::Plain => 1,
            Self::Whole(bytes, _) => bytes,
            Self::Single => 4,
            Self::Double => 8,
            Self::Tags => 2,
        }
    }

    /// The numbers in little endian `bytes`.
    fn numbers(self, bytes: &[u8]) -> Option<Vec<f64>> {
        let each = |word: &[u8]| {
            let mut wide = [0; 8];
            wide[..word.len()].copy_from_slice(word);
            let whole = u64::from_le_bytes(wide);
            let unused = 64 - 8 * word.len() as u32;
            match self {
                Self::Whole(_, true) => ((whole as i64) << unused >> unused) as f64,
                Self::Single => f64::from(f32::from_bits(whole as u32)),
                Self::Double => f64::from_bits(whole),
                _ => whole as f64,
            }
        };
        match self {
            Self::Text => {
                let text = std::str::from_utf8(bytes).ok()?;
                let parts = text.split('\\').map(|part| part.trim_matches(['\0', ' ']));
                parts.map(|part| part.parse().ok()).collect()
            }
            Self::Whole(..) | Self::Single | Self::Double => {
                Some(bytes.chunks_exact(self.word()).map(each).collect())
            }
            Self::Tags | Self::Plain => None,
        }
    }

    /// `numbers` as little endian bytes of this form, if it holds them exactly.
    fn bytes(self, numbers: &[f64]) -> Option<Vec<u8>> {
        let mut bytes = Vec::with_capacity(numbers.len() * self.word());
        for number in numbers {
            match self {
                Self::Text => {
                    let separator = if bytes.is_empty() { "" } else { "\\" };
                    bytes.extend(format!("{separator}{number}").into_bytes());
                }
                Self::Whole(size, signed) => {
                    let span = 2_f64.powi(8 * size as i32);
                    let (least, most) = if signed {
                        (-span / 2.0, span / 2.0)
                    } else {
                        (0.0, span)
                    };
                    if number.fract() != 0.0 || *number < least || *number >= most {
                        return None;
                    }
                    let whole = if signed {
                        *number as i64 as u64
                    } else {
                        *number as u64
                    };
                    bytes.extend(&whole.to_le_bytes()[..size]);
                }
                Self::Single => bytes.extend((*number as f32).to_le_bytes()),
                Self::Double => bytes.extend(number.to_le_bytes()),
                Self::Tags | Self::Plain => return None,
            }
        }
        Some(bytes)
    }
}

/// The VR that the standard gives an attribute.
pub fn standard(tag: Tag) -> VR {
    let entry = StandardDataDictionary.by_tag(tag);
    entry.map_or(VR::UN, |entry| entry.vr().relaxed())
}

/// `value` of the attribute `tag`, which a file in `order` states with the representation `stated`, in the
/// attribute's own representation and in that order; and whether that changed it. `little` says that the value
/// is in Little Endian whatever the order of the file is.
///
/// # Errors
/// The representation that is expected, if the value cannot be converted.
pub fn settled(
    tag: Tag,
    stated: VR,
    mut value: Vec<u8>,
    order: Endianness,
    little: bool,
) -> Result<(Vec<u8>, bool), VR> {
    let own = standard(tag);
    let (from, to) = (
        Form::from_representation(stated),
        Form::from_representation(own),
    );
    let swap = |bytes: &mut [u8], form: Form| {
        for word in bytes.chunks_exact_mut(form.word()) {
            word.reverse();
        }
    };
    let is_big = order == Endianness::Big;
    if from.word() == to.word() && (from == Form::Text) == (to == Form::Text)
        || from == Form::Plain
        || to == Form::Plain
    {
        let as_whole = matches!((from, to), (Form::Single, Form::Whole(..)))
            || matches!((from, to), (Form::Whole(..), Form::Single))
            || matches!((from, to), (Form::Double, Form::Whole(..)))
            || matches!((from, to), (Form::Whole(..), Form::Double));
        if !as_whole {
            if is_big && little {
                swap(&mut value, to);
            }
            return Ok((value, false));
        }
    }
    if is_big && !little {
        swap(&mut value, from);
    }
    let numbers = from.numbers(&value);
    let mut converted = numbers.and_then(|numbers| to.bytes(&numbers)).ok_or(own)?;
    if is_big {
        swap(&mut converted, to);
    }
    Ok((converted, true))
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROWS: Tag = Tag(0x28, 0x10);
    const SPACING: Tag = Tag(0x28, 0x30);
    const SLOPE: Tag = Tag(0x40, 0x9225);

    fn in_both_orders(tag: Tag, stated: VR, little: &[u8]) -> Result<(Vec<u8>, bool), VR> {
        let word = Form::from_representation(stated).word();
        let mut big = little.to_vec();
        for word in big.chunks_exact_mut(word) {
            word.reverse();
        }
        let found = settled(tag, stated, little.to_vec(), Endianness::Little, false);
        let mut other = settled(tag, stated, big, Endianness::Big, false);
        if let Ok((bytes, _)) = &mut other {
            for word in bytes.chunks_exact_mut(Form::from_representation(standard(tag)).word()) {
                word.reverse();
            }
        }
        assert_eq!(found, other, "{stated:?}");
        found
    }

    #[test]
    fn numbers_of_every_representation_become_those_of_the_attribute() {
        let sixty_four = 64_u16.to_le_bytes().to_vec();
        for (stated, bytes, changed) in [
            (VR::US, 64_u16.to_le_bytes().to_vec(), false),
            (VR::SS, 64_i16.to_le_bytes().to_vec(), false),
            (VR::UL, 64_u32.to_le_bytes().to_vec(), true),
            (VR::SL, 64_i32.to_le_bytes().to_vec(), true),
            (VR::UV, 64_u64.to_le_bytes().to_vec(), true),
            (VR::SV, 64_i64.to_le_bytes().to_vec(), true),
            (VR::FL, 64_f32.to_le_bytes().to_vec(), true),
            (VR::FD, 64_f64.to_le_bytes().to_vec(), true),
            (VR::IS, b"64".to_vec(), true),
            (VR::DS, b" 64.0 ".to_vec(), true),
            (VR::LO, b"64\0\0".to_vec(), true),
        ] {
            let found = in_both_orders(ROWS, stated, &bytes);
            assert_eq!(found, Ok((sixty_four.clone(), changed)), "{stated:?}");
        }
        for (stated, bytes) in [
            (VR::FD, 64.5_f64.to_le_bytes().to_vec()),
            (VR::SL, (-64_i32).to_le_bytes().to_vec()),
            (VR::UL, 70_000_u32.to_le_bytes().to_vec()),
            (VR::FD, f64::NAN.to_le_bytes().to_vec()),
            (VR::LO, b"many".to_vec()),
        ] {
            assert_eq!(
                in_both_orders(ROWS, stated, &bytes),
                Err(VR::US),
                "{stated:?}"
            );
        }
        let spacing = [6.4_f64, 4.8].map(f64::to_le_bytes).concat();
        let found = in_both_orders(SPACING, VR::FD, &spacing);
        assert_eq!(found, Ok((b"6.4\\4.8".to_vec(), true)));
        let found = in_both_orders(SLOPE, VR::FL, &0.5_f32.to_le_bytes());
        assert_eq!(found, Ok((0.5_f64.to_le_bytes().to_vec(), true)));
    }

    #[test]
    fn values_of_unknown_representation_are_little_endian() {
        for stated in [VR::UN, VR::OB, VR::US] {
            let value = 64_u16.to_le_bytes().to_vec();
            let found = settled(ROWS, stated, value, Endianness::Big, true);
            assert_eq!(found, Ok((64_u16.to_be_bytes().to_vec(), false)));
        }
        let text = b"6.4\\4.8".to_vec();
        let found = settled(SPACING, VR::UN, text.clone(), Endianness::Big, true);
        assert_eq!(found, Ok((text, false)));
    }
}
