//! JPEG-LS (ISO 14495-1, ITU-T T.87), lossless and near-lossless, for one component.
//!
//! Letters of contexts (`a`, `b`, `c`, `n`) and neighbours (left `ra`, above `rb`, above left `rc`,
//! above right `rd`) are those of the standard, as are the numbers of its sections in the comments.
//! No crate without C++ code decodes JPEG-LS.

use super::{FrameError, FrameLayout, Numbers, Pace};

/// Contexts of the regular mode; two more for interrupted runs follow.
const REGULAR_CONTEXTS: usize = 365;

/// Orders of the run lengths (A.2.1).
const RUN_ORDERS: [u32; 32] = [
    0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7, 8, 9, 10, 11, 12, 13,
    14, 15,
];

/// Decodes the frame in `bytes`; `near` if the transfer syntax allows near-lossless coding.
pub(super) fn decode(
    near: bool,
    bytes: &[u8],
    layout: FrameLayout,
    pace: &mut Pace<'_>,
) -> Result<Numbers, FrameError> {
    let header = Header::read(bytes)?;
    layout.check(header.columns.into(), header.rows.into(), header.components)?;
    layout.check_bits(header.bits)?;
    if !near && header.near > 0 {
        return Err(FrameError::Wrong(format!(
            "the JPEG-LS frame is up to {} off; the transfer syntax allows lossless only",
            header.near
        )));
    }
    let mut values = Scan::new(&header, &bytes[header.data..])?.decode(layout, pace)?;
    values.iter_mut().for_each(|value| *value <<= header.shift);
    Ok(Numbers {
        values,
        bits: header.bits,
        lossless: header.near == 0,
    })
}

/// The marker segments before the coded numbers.
#[derive(Debug, Default)]
struct Header {
    columns: u16,
    rows: u16,
    components: u64,
    bits: u32,
    near: i32,
    shift: u32,
    /// Largest value, thresholds and reset, if given; 0 stands for the default.
    preset: [i32; 5],
    /// Where the coded numbers begin.
    data: usize,
}

impl Header {
    fn read(bytes: &[u8]) -> Result<Self, String> {
        let cut = || "the JPEG-LS header is cut off".to_owned();
        if !bytes.starts_with(&[0xff, 0xd8]) {
            return Err("the frame is not a JPEG-LS stream".into());
        }
        let mut header = Self::default();
        let mut at = 2;
        loop {
            let marker = bytes.get(at..at + 2).ok_or_else(cut)?;
            if marker[0] != 0xff {
                return Err("a marker is missing in the JPEG-LS header".into());
            }
            // Fill bytes before a marker.
            if marker[1] == 0xff {
                at += 1;
                continue;
            }
            let length = bytes.get(at + 2..).and_then(<[u8]>::first_chunk);
            let length = usize::from(u16::from_be_bytes(*length.ok_or_else(cut)?));
            let segment = bytes.get(at + 4..at + 2 + length).ok_or_else(cut)?;
            let short = |n: usize| segment.get(2 * n + 1..).and_then(<[u8]>::first_chunk);
            let short = |n: usize| Some(u16::from_be_bytes(*short(n)?));
            at += 2 + length;
            match (marker[1], segment) {
                (0xf7, [bits, ..]) => {
                    header.bits = u32::from(*bits);
                    header.rows = short(0).ok_or_else(cut)?;
                    header.columns = short(1).ok_or_else(cut)?;
                    header.components = u64::from(*segment.get(5).ok_or_else(cut)?);
                }
                (0xf8, [1, ..]) => {
                    for n in 0..5 {
                        header.preset[n] = short(n).ok_or_else(cut)?.into();
                    }
                }
                (0xf8, _) => return Err("the JPEG-LS frame uses a colour table".into()),
                (0xdd, interval) if interval.iter().any(|byte| *byte != 0) => {
                    return Err("the JPEG-LS frame uses restart intervals".into());
                }
                (0xda, [1, _, table, near, _, shift]) => {
                    if *table != 0 || *shift > 15 {
                        return Err("the JPEG-LS scan uses a mapping table".into());
                    }
                    header.near = i32::from(*near);
                    header.shift = u32::from(*shift);
                    header.data = at;
                    return header.checked();
                }
                (0xda, _) => return Err("the JPEG-LS scan has several components".into()),
                (0xc0..=0xcf, _) => return Err("the frame is JPEG, not JPEG-LS".into()),
                _ => {}
            }
        }
    }

    fn checked(mut self) -> Result<Self, String> {
        if !(2..=16).contains(&self.bits) {
            return Err(format!("{} bits per number in JPEG-LS", self.bits));
        }
        let most = (1 << self.bits) - 1;
        let largest = match self.preset[0] {
            0 => most,
            given => given,
        };
        if largest > most || self.near > largest.min(510) / 2 {
            return Err("the JPEG-LS parameters contradict each other".into());
        }
        let defaults = thresholds(largest, self.near);
        for (given, default) in self.preset.iter_mut().zip(defaults) {
            if *given == 0 {
                *given = default;
            }
        }
        let [_, t1, t2, t3, reset] = self.preset;
        let rising = self.near < t1 && t1 <= t2 && t2 <= t3 && t3 <= largest;
        match rising && reset >= 3 {
            true => Ok(self),
            false => Err("the JPEG-LS thresholds contradict each other".into()),
        }
    }
}

/// Largest value, default thresholds and reset (C.2.4.1.1).
fn thresholds(largest: i32, near: i32) -> [i32; 5] {
    let clamp = |value: i32, least: i32| match value > largest || value < least {
        true => least,
        false => value,
    };
    let basic = [3, 7, 21];
    let [t1, t2, t3] = match largest >= 128 {
        true => {
            let factor = (largest.min(4095) + 128) / 256;
            [
                factor * (basic[0] - 2) + 2 + 3 * near,
                factor * (basic[1] - 3) + 3 + 5 * near,
                factor * (basic[2] - 4) + 4 + 7 * near,
            ]
        }
        false => {
            let factor = 256 / (largest + 1);
            [
                (basic[0] / factor + 3 * near).max(2),
                (basic[1] / factor + 5 * near).max(3),
                (basic[2] / factor + 7 * near).max(4),
            ]
        }
    };
    let t1 = clamp(t1, near + 1);
    let t2 = clamp(t2, t1);
    [largest, t1, t2, clamp(t3, t2), 64]
}

/// Statistics of one context.
#[derive(Debug, Clone, Copy)]
struct Context {
    a: i32,
    b: i32,
    c: i32,
    n: i32,
    /// Negative errors, for interrupted runs.
    negative: i32,
}

impl Context {
    /// The order of the Golomb code for errors of the mean size `sum` / `n`.
    fn order(&self, sum: i32) -> u32 {
        (0..31)
            .find(|k| i64::from(self.n) << k >= i64::from(sum))
            .unwrap_or(31)
    }
}

/// State of the decoder.
struct Scan<'a> {
    bits: Bits<'a>,
    contexts: Vec<Context>,
    run: usize,
    largest: i32,
    thresholds: [i32; 3],
    reset: i32,
    near: i32,
    /// Number of different errors.
    range: i32,
    /// Bits of an error.
    error_bits: u32,
    /// Longest code of an error, bits.
    limit: u32,
}

impl<'a> Scan<'a> {
    fn new(header: &Header, data: &'a [u8]) -> Result<Self, String> {
        let [largest, t1, t2, t3, reset] = header.preset;
        let near = header.near;
        let range = (largest + 2 * near) / (2 * near + 1) + 1;
        let width = |values: i32| (values - 1).max(0).checked_ilog2().map_or(0, |n| n + 1);
        let value_bits = width(largest + 1).max(2);
        let start = Context {
            a: ((range + 32) / 64).max(2),
            b: 0,
            c: 0,
            n: 1,
            negative: 0,
        };
        let error_bits = width(range);
        let limit = 2 * (value_bits + value_bits.max(8));
        Ok(Self {
            bits: Bits::new(data),
            contexts: vec![start; REGULAR_CONTEXTS + 2],
            run: 0,
            largest,
            thresholds: [t1, t2, t3],
            reset,
            near,
            range,
            error_bits,
            limit,
        })
    }

    fn decode(mut self, layout: FrameLayout, pace: &mut Pace<'_>) -> Result<Vec<i32>, FrameError> {
        let width = layout.columns;
        let mut values = Vec::with_capacity(layout.pixels());
        // Lines with the neighbours left and right of them.
        let mut above = vec![0_i32; width + 2];
        let mut line = vec![0_i32; width + 2];
        for _ in 0..layout.rows {
            above[width + 1] = above[width];
            line[0] = above[1];
            let mut x = 1;
            while x <= width {
                let [ra, rb, rc, rd] = [line[x - 1], above[x], above[x - 1], above[x + 1]];
                let steps = [rd - rb, rb - rc, rc - ra];
                if steps.iter().all(|step| step.abs() <= self.near) {
                    x = self.run(&mut line, &above, x, width)?;
                } else {
                    line[x] = self.regular([ra, rb, rc], steps)?;
                    x += 1;
                }
            }
            values.extend_from_slice(&line[1..=width]);
            std::mem::swap(&mut above, &mut line);
            pace.step(width)?;
        }
        Ok(values)
    }

    /// The class of a difference of neighbours (A.3.3).
    fn class(&self, step: i32) -> i32 {
        let [t1, t2, t3] = self.thresholds;
        let size = step.abs();
        let class = match () {
            () if size <= self.near => 0,
            () if size < t1 => 1,
            () if size < t2 => 2,
            () if size < t3 => 3,
            () => 4,
        };
        class * step.signum()
    }

    /// Decodes a number by its neighbours (A.4 to A.6).
    fn regular(&mut self, [ra, rb, rc]: [i32; 3], steps: [i32; 3]) -> Result<i32, String> {
        let [q1, q2, q3] = steps.map(|step| self.class(step));
        let place = 81 * q1 + 9 * q2 + q3;
        let sign = if place < 0 { -1 } else { 1 };
        let mut context = self.contexts[place.unsigned_abs() as usize];
        let predicted = match () {
            () if rc >= ra.max(rb) => ra.min(rb),
            () if rc <= ra.min(rb) => ra.max(rb),
            () => ra + rb - rc,
        };
        let predicted = (predicted + sign * context.c).clamp(0, self.largest);
        let order = context.order(context.a);
        let coded = self.bits.golomb(order, self.limit, self.error_bits)?;
        let swapped = self.near == 0 && order == 0 && 2 * context.b <= -context.n;
        let error = match (coded % 2 == 0, swapped) {
            (true, false) => coded / 2,
            (false, false) => -(coded + 1) / 2,
            (true, true) => -(coded / 2) - 1,
            (false, true) => (coded - 1) / 2,
        };
        context.b += error * (2 * self.near + 1);
        context.a = context.a.saturating_add(error.abs());
        if context.n == self.reset {
            context.a >>= 1;
            context.b = match context.b >= 0 {
                true => context.b >> 1,
                false => -((1 - context.b) >> 1),
            };
            context.n >>= 1;
        }
        context.n += 1;
        if context.b <= -context.n {
            context.b = (context.b + context.n).max(1 - context.n);
            context.c = (context.c - 1).max(-128);
        } else if context.b > 0 {
            context.b = (context.b - context.n).min(0);
            context.c = (context.c + 1).min(127);
        }
        self.contexts[place.unsigned_abs() as usize] = context;
        Ok(self.settle(predicted, sign * error))
    }

    /// Prediction and error together, wrapped into the range of values (A.4.5, A.8).
    fn settle(&self, predicted: i32, error: i32) -> i32 {
        let step = 2 * self.near + 1;
        let mut value = predicted + error * step;
        if value < -self.near {
            value += self.range * step;
        } else if value > self.largest + self.near {
            value -= self.range * step;
        }
        value.clamp(0, self.largest)
    }

    /// Decodes a run from place `x` on and the number that interrupts it (A.7). Returns the place
    /// after them.
    fn run(
        &mut self,
        line: &mut [i32],
        above: &[i32],
        mut x: usize,
        width: usize,
    ) -> Result<usize, String> {
        let value = line[x - 1];
        loop {
            let order = RUN_ORDERS[self.run];
            let left = width + 1 - x;
            let whole = self.bits.one()?;
            let length = match whole {
                true => 1 << order,
                false => self.bits.number(order)? as usize,
            };
            let end = x + length.min(left);
            line[x..end].fill(value);
            x = end;
            match whole {
                true if length <= left => self.run = (self.run + 1).min(31),
                true => {}
                false if length > left => return Err("a JPEG-LS run exceeds its line".into()),
                false => break,
            }
            if x > width {
                return Ok(x);
            }
        }
        if x > width {
            return Err("a JPEG-LS run exceeds its line".into());
        }
        line[x] = self.interruption(value, above[x])?;
        self.run = self.run.saturating_sub(1);
        Ok(x + 1)
    }

    /// Decodes the number that interrupts a run (A.7.2).
    fn interruption(&mut self, ra: i32, rb: i32) -> Result<i32, String> {
        let alike = (ra - rb).abs() <= self.near;
        let kind = i32::from(alike);
        let place = REGULAR_CONTEXTS + usize::from(alike);
        let mut context = self.contexts[place];
        let sum = context.a.saturating_add(kind * (context.n >> 1));
        let order = context.order(sum);
        let limit = self.limit - RUN_ORDERS[self.run] - 1;
        let coded = self.bits.golomb(order, limit, self.error_bits)?;
        let size = (coded + kind + 1) >> 1;
        let marked = (coded + kind) & 1 == 1;
        let usual = order != 0 || 2 * context.negative >= context.n;
        let error = if usual == marked { -size } else { size };
        context.negative += i32::from(error < 0);
        context.a = context.a.saturating_add((coded + 1 - kind) >> 1);
        if context.n == self.reset {
            context.a >>= 1;
            context.n >>= 1;
            context.negative >>= 1;
        }
        context.n += 1;
        self.contexts[place] = context;
        let sign = if !alike && ra > rb { -1 } else { 1 };
        let predicted = if alike { ra } else { rb };
        Ok(self.settle(predicted, sign * error))
    }
}

/// Bits of the coded numbers. After a byte 0xFF the next has seven bits (A.1).
struct Bits<'a> {
    bytes: std::slice::Iter<'a, u8>,
    held: u32,
    count: u32,
    after_ff: bool,
}

impl<'a> Bits<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self {
            bytes: bytes.iter(),
            held: 0,
            count: 0,
            after_ff: false,
        }
    }

    fn one(&mut self) -> Result<bool, String> {
        if self.count == 0 {
            let byte = *self.bytes.next().ok_or("the JPEG-LS data are cut off")?;
            if self.after_ff && byte >= 0x80 {
                return Err("the JPEG-LS data end too early".into());
            }
            self.count = if self.after_ff { 7 } else { 8 };
            self.held = byte.into();
            self.after_ff = byte == 0xff;
        }
        self.count -= 1;
        Ok(self.held >> self.count & 1 == 1)
    }

    fn number(&mut self, bits: u32) -> Result<u32, String> {
        let mut number = 0;
        for _ in 0..bits {
            number = number << 1 | u32::from(self.one()?);
        }
        Ok(number)
    }

    /// A number in the limited Golomb code of `order` (A.5.3).
    fn golomb(&mut self, order: u32, limit: u32, error_bits: u32) -> Result<i32, String> {
        let most = limit.saturating_sub(error_bits + 1);
        let mut zeros = 0;
        while !self.one()? {
            zeros += 1;
            if zeros > most {
                return Err("a JPEG-LS code is too long".into());
            }
        }
        let number = match zeros < most {
            true => u64::from(zeros) << order | u64::from(self.number(order)?),
            false => u64::from(self.number(error_bits)?) + 1,
        };
        // A code is at most twice as large as an error.
        i32::try_from(number)
            .ok()
            .filter(|n| *n <= 2 << error_bits)
            .ok_or_else(|| "a JPEG-LS error is too large".into())
    }
}
