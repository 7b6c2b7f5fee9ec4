//! DIMSE commands (PS3.7, 6.3.1 and 9.3): data sets of group 0000 in Implicit VR Little Endian, without
//! sequences.

use std::collections::BTreeMap;

/// Longest command set that is read, bytes.
pub const LONGEST_COMMAND: usize = 16 << 10;

/// The value of Command Data Set Type (0000,0800) of a message without a data set.
const NO_DATA_SET: u16 = 0x0101;

/// Longest Error Comment (0000,0902), characters.
const LONGEST_COMMENT: usize = 64;

mod elements {
    pub const GROUP_LENGTH: u16 = 0x0000;
    pub const SOP_CLASS: u16 = 0x0002;
    pub const COMMAND_FIELD: u16 = 0x0100;
    pub const MESSAGE_ID: u16 = 0x0110;
    pub const RESPONSE_TO: u16 = 0x0120;
    pub const DATA_SET: u16 = 0x0800;
    pub const STATUS: u16 = 0x0900;
    pub const ERROR_COMMENT: u16 = 0x0902;
    pub const SOP_INSTANCE: u16 = 0x1000;
}

/// The request in a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Operation {
    /// C-STORE-RQ.
    Store,
    /// C-ECHO-RQ.
    Echo,
    /// C-CANCEL-RQ, which is not answered.
    Cancel,
    /// Another request.
    Other,
}

/// Statuses of PS3.7, annex C.
pub mod status {
    /// Done.
    pub const SUCCESS: u16 = 0x0000;
    /// The SOP class is not that of the presentation context.
    pub const CLASS_NOT_SUPPORTED: u16 = 0x0122;
    /// There is no such operation here.
    pub const UNRECOGNISED_OPERATION: u16 = 0x0211;
    /// A required element is missing.
    pub const MISTYPED_ARGUMENT: u16 = 0x0212;
}

/// A request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Command {
    /// Command Field (0000,0100).
    pub field: u16,
    /// Message ID (0000,0110).
    pub message: u16,
    /// Affected SOP Class UID (0000,0002).
    pub sop_class: Option<String>,
    /// Affected SOP Instance UID (0000,1000).
    pub sop_instance: Option<String>,
    /// Whether a data set follows.
    pub has_data_set: bool,
}

impl Command {
    /// Reads a command set; `None` if it is malformed, or is no request.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let mut values = BTreeMap::new();
        let mut rest = bytes;
        while !rest.is_empty() {
            let (head, value) = rest.split_first_chunk::<8>()?;
            let group = u16::from_le_bytes([head[0], head[1]]);
            let element = u16::from_le_bytes([head[2], head[3]]);
            let length = u32::from_le_bytes([head[4], head[5], head[6], head[7]]);
            let (value, next) = value.split_at_checked(usize::try_from(length).ok()?)?;
            if group != 0 {
                return None;
            }
            values.insert(element, value);
            rest = next;
        }
        let short = |element| {
            let value: &[u8; 2] = values.get(&element)?.first_chunk()?;
            Some(u16::from_le_bytes(*value))
        };
        let text = |element| {
            let value = std::str::from_utf8(values.get(&element)?).ok()?;
            let value = value.trim_end_matches(['\0', ' ']);
            (!value.is_empty()).then(|| value.to_owned())
        };
        let field = short(elements::COMMAND_FIELD)?;
        if field & 0x8000 != 0 {
            return None;
        }
        Some(Self {
            field,
            // C-CANCEL names the message that it cancels instead.
            message: short(elements::MESSAGE_ID).or_else(|| short(elements::RESPONSE_TO))?,
            sop_class: text(elements::SOP_CLASS),
            sop_instance: text(elements::SOP_INSTANCE),
            has_data_set: short(elements::DATA_SET)? != NO_DATA_SET,
        })
    }

    /// The request.
    pub fn operation(&self) -> Operation {
        match self.field {
            0x0001 => Operation::Store,
            0x0030 => Operation::Echo,
            0x0FFF => Operation::Cancel,
            _ => Operation::Other,
        }
    }

    /// The command set of the response to it.
    pub fn response(&self, status: u16, comment: Option<&str>) -> Vec<u8> {
        let mut set = Vec::new();
        let mut put = |element: u16, value: &[u8]| {
            set.extend_from_slice(&0_u16.to_le_bytes());
            set.extend_from_slice(&element.to_le_bytes());
            set.extend_from_slice(&(value.len() as u32).to_le_bytes());
            set.extend_from_slice(value);
        };
        let padded = |text: &str, with: u8| {
            let mut value = text.as_bytes().to_vec();
            if value.len() % 2 == 1 {
                value.push(with);
            }
            value
        };
        if let Some(class) = &self.sop_class {
            put(elements::SOP_CLASS, &padded(class, 0));
        }
        put(
            elements::COMMAND_FIELD,
            &(self.field | 0x8000).to_le_bytes(),
        );
        put(elements::RESPONSE_TO, &self.message.to_le_bytes());
        put(elements::DATA_SET, &NO_DATA_SET.to_le_bytes());
        put(elements::STATUS, &status.to_le_bytes());
        if let Some(comment) = comment {
            let end = comment.len().min(LONGEST_COMMENT);
            let end = (0..=end).rev().find(|end| comment.is_char_boundary(*end));
            put(
                elements::ERROR_COMMENT,
                &padded(&comment[..end.unwrap_or(0)], b' '),
            );
        }
        if let Some(instance) = &self.sop_instance {
            put(elements::SOP_INSTANCE, &padded(instance, 0));
        }
        let mut whole = Vec::with_capacity(12 + set.len());
        whole.extend_from_slice(&[0; 2]);
        whole.extend_from_slice(&elements::GROUP_LENGTH.to_le_bytes());
        whole.extend_from_slice(&4_u32.to_le_bytes());
        whole.extend_from_slice(&(set.len() as u32).to_le_bytes());
        whole.extend_from_slice(&set);
        whole
    }
}

#[cfg(test)]
#[allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn element(number: u16, value: &[u8]) -> Vec<u8> {
        let mut bytes = vec![0, 0];
        bytes.extend_from_slice(&number.to_le_bytes());
        bytes.extend_from_slice(&(value.len() as u32).to_le_bytes());
        bytes.extend_from_slice(value);
        bytes
    }

    #[test]
    fn a_request_is_read_and_answered() {
        let request = [
            element(0x0000, &[0; 4]),
            element(0x0002, b"1.2.840.10008.1.1\0"),
            element(0x0100, &[0x30, 0]),
            element(0x0110, &[7, 0]),
            element(0x0800, &[1, 1]),
        ];
        let command = Command::read(&request.concat()).unwrap();
        assert_eq!(command.operation(), Operation::Echo);
        assert_eq!(command.sop_class.as_deref(), Some("1.2.840.10008.1.1"));
        assert!(!command.has_data_set);
        let answer = command.response(0xA700, Some("a comment"));
        let expected = [
            element(0x0000, &(answer.len() as u32 - 12).to_le_bytes()),
            element(0x0002, b"1.2.840.10008.1.1\0"),
            element(0x0100, &[0x30, 0x80]),
            element(0x0120, &[7, 0]),
            element(0x0800, &[1, 1]),
            element(0x0900, &[0, 0xA7]),
            element(0x0902, b"a comment "),
        ];
        assert_eq!(answer, expected.concat());
    }

    #[test]
    fn responses_and_cut_off_sets_are_no_requests() {
        let whole = [
            element(0x0100, &[1, 0]),
            element(0x0110, &[7, 0]),
            element(0x0800, &[0, 0]),
        ]
        .concat();
        assert!(Command::read(&whole).unwrap().has_data_set);
        for end in 1..whole.len() {
            assert_eq!(Command::read(&whole[..end]), None, "{end}");
        }
        let mut response = whole.clone();
        response[9] = 0x80;
        assert_eq!(Command::read(&response), None);
        let mut other_group = whole;
        other_group[0] = 8;
        assert_eq!(Command::read(&other_group), None);
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_request_or_not(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            if let Some(command) = Command::read(&bytes) {
                let _ = command.response(0, Some("\u{e4}".repeat(40).as_str()));
            }
        }
    }
}
