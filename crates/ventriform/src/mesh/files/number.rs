//! Numbers of binary files.

/// A type of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NumberType {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl NumberType {
    /// Bytes of a number.
    pub fn bytes(self) -> usize {
        match self {
            NumberType::I8 | NumberType::U8 => 1,
            NumberType::I16 | NumberType::U16 => 2,
            NumberType::I32 | NumberType::U32 | NumberType::F32 => 4,
            NumberType::I64 | NumberType::U64 | NumberType::F64 => 8,
        }
    }

    /// The number in `bytes`, as many as [`NumberType::bytes`]; whole numbers beyond 2^53 are rounded.
    pub fn read(self, bytes: &[u8], big_endian: bool) -> f64 {
        let mut padded = [0; 8];
        let size = self.bytes().min(bytes.len());
        padded[..size].copy_from_slice(&bytes[..size]);
        if big_endian {
            padded[..size].reverse();
        }
        let all = u64::from_le_bytes(padded);
        match self {
            NumberType::I8 => f64::from(all as i8),
            NumberType::U8 => f64::from(all as u8),
            NumberType::I16 => f64::from(all as i16),
            NumberType::U16 => f64::from(all as u16),
            NumberType::I32 => f64::from(all as i32),
            NumberType::U32 => f64::from(all as u32),
            NumberType::I64 => all as i64 as f64,
            NumberType::U64 => all as f64,
            NumberType::F32 => f64::from(f32::from_bits(all as u32)),
            NumberType::F64 => f64::from_bits(all),
        }
    }
}
