//! Huffman codes and bits of the entropy-coded segments (T.81, annex F.2.2).

/// Bits that are looked up at once.
const LOOKED_UP: u32 = 9;

/// A Huffman table.
pub(super) struct Table {
    /// Length and symbol of the code that begins with these bits; length 0 for longer codes.
    short: Vec<(u8, u8)>,
    /// For each length: the first code, how many there are, and the place of its symbol.
    lengths: [(u32, u32, usize); 17],
    symbols: Vec<u8>,
}

impl Table {
    /// From the number of codes of 1 to 16 bits and their symbols in order (C.2).
    pub(super) fn new(counts: &[u8; 16], symbols: &[u8]) -> Result<Self, String> {
        let mut short = vec![(0, 0); 1 << LOOKED_UP];
        let mut lengths = [(0, 0, 0); 17];
        let (mut code, mut place) = (0_u32, 0);
        for (length, &count) in (1..=16_u32).zip(counts) {
            lengths[length as usize] = (code, u32::from(count), place);
            if code + u32::from(count) > 1 << length {
                return Err(format!(
                    "a JPEG Huffman table has more codes of {length} bits than there are"
                ));
            }
            for _ in 0..count {
                if length <= LOOKED_UP {
                    let first = (code << (LOOKED_UP - length)) as usize;
                    let span = 1 << (LOOKED_UP - length);
                    short[first..first + span].fill((length as u8, symbols[place]));
                }
                code += 1;
                place += 1;
            }
            code <<= 1;
        }
        Ok(Self {
            short,
            lengths,
            symbols: symbols.to_vec(),
        })
    }
}

/// The bits of a scan, without stuffed bytes, up to the next marker.
pub(super) struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
    /// The next bits, the first of them the most significant.
    held: u64,
    count: u32,
}

impl<'a> Bits<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            at: 0,
            held: 0,
            count: 0,
        }
    }

    /// Holds at least 57 bits, if there are as many before the next marker.
    fn fill(&mut self) {
        while self.count <= 56 {
            let Some(&byte) = self.bytes.get(self.at) else {
                return;
            };
            if byte == 0xff {
                if self.bytes.get(self.at + 1) != Some(&0) {
                    return;
                }
                self.at += 1;
            }
            self.at += 1;
            self.held |= u64::from(byte) << (56 - self.count);
            self.count += 8;
        }
    }

    fn drop(&mut self, bits: u32) -> Result<(), String> {
        match self.count.checked_sub(bits) {
            Some(left) => {
                self.held <<= bits;
                self.count = left;
                Ok(())
            }
            None => Err("the JPEG data are cut off".into()),
        }
    }

    /// The next symbol in the codes of `table`.
    pub(super) fn symbol(&mut self, table: &Table) -> Result<u8, String> {
        if self.count < 16 {
            self.fill();
        }
        let (length, symbol) = table.short[(self.held >> (64 - LOOKED_UP)) as usize];
        if length > 0 {
            self.drop(length.into())?;
            return Ok(symbol);
        }
        for length in LOOKED_UP + 1..=16 {
            let code = (self.held >> (64 - length)) as u32;
            let (first, count, place) = table.lengths[length as usize];
            if let Some(index) = code.checked_sub(first).filter(|index| *index < count) {
                self.drop(length)?;
                return Ok(table.symbols[place + index as usize]);
            }
        }
        Err(if self.count < 16 {
            "the JPEG data are cut off".into()
        } else {
            "the JPEG data hold bits that are not a code".into()
        })
    }

    /// A signed number of `size` bits, at most 16 (F.2.2.1, EXTEND).
    pub(super) fn signed(&mut self, size: u32) -> Result<i32, String> {
        if size == 0 {
            return Ok(0);
        }
        if self.count < size {
            self.fill();
        }
        let number = (self.held >> (64 - size)) as i32;
        self.drop(size)?;
        Ok(if number < 1 << (size - 1) {
            number - (1 << size) + 1
        } else {
            number
        })
    }

    /// Drops the padding before a marker, and returns the marker; `None` at the end of the bytes.
    fn marker(&mut self, spare: u32) -> Result<Option<u8>, String> {
        self.fill();
        if self.count >= 8 + spare {
            return Err("the JPEG data go on after the last number".into());
        }
        (self.held, self.count) = (0, 0);
        while self.bytes.get(self.at..self.at + 2) == Some(&[0xff, 0xff]) {
            self.at += 1;
        }
        let marker = self.bytes.get(self.at + 1).copied();
        self.at = self.bytes.len().min(self.at + 2);
        Ok(marker)
    }

    /// Passes the restart marker number `n`, counted from 0 (E.2.4).
    pub(super) fn restart(&mut self, n: usize) -> Result<(), String> {
        let expected = 0xd0 | (n % 8) as u8;
        match self.marker(0)? {
            Some(marker) if marker == expected => Ok(()),
            Some(marker) => Err(format!(
                "the marker FF {marker:02X} stands where the restart FF {expected:02X} is due"
            )),
            None => Err("the JPEG data are cut off".into()),
        }
    }

    /// Checks that the image ends here. Some writers leave the end marker out, or pad by a few bytes.
    pub(super) fn end(&mut self) -> Result<(), String> {
        match self.marker(16)? {
            Some(0xd9) | None => Ok(()),
            Some(marker) => Err(format!(
                "the marker FF {marker:02X} follows the scan; one scan is read"
            )),
        }
    }
}
