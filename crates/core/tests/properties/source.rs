//! Numbers from bytes: the same generators are driven by random bytes (proptest) and by those of a fuzzer.

/// Numbers that break what was only tried with ordinary ones: nothing, next to nothing, too much.
const ODD: [f64; 24] = [
    0.0,
    -0.0,
    5e-324,
    1e-300,
    1e-150,
    1e-12,
    1e-7,
    1e-6,
    1e-3,
    0.5,
    1e3,
    1e4,
    1e5,
    1e6,
    1e7,
    1e8,
    1e9,
    1e10,
    1e12,
    1e15,
    1e100,
    1e155,
    1e300,
    f64::MAX,
];
/// Whole numbers that overflow what is done to them.
const ODD_WHOLE: [i64; 10] =
    [i64::MIN, i64::MIN + 1, -(1 << 53), -(1 << 31), -1, 0, 1 << 31, 1 << 53, i64::MAX - 1, i64::MAX];

/// A stream of bytes. After its end it gives zeros, which stand for what is ordinary everywhere: shorter is simpler.
pub struct Source<'a> {
    bytes: &'a [u8],
    /// So many of 256 numbers are odd ones; the first byte says.
    odds: u8,
}

impl<'a> Source<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        let mut source = Self { bytes, odds: 0 };
        source.odds = [0, 1, 4, 24][source.below(4)];
        source
    }

    pub fn byte(&mut self) -> u8 {
        let (first, rest) = self.bytes.split_first().unwrap_or((&0, &[]));
        self.bytes = rest;
        *first
    }

    /// A number below `n`, at most 256.
    pub fn below(&mut self, n: usize) -> usize {
        usize::from(self.byte()) % n
    }

    /// True for about `n` of 256.
    pub fn chance(&mut self, n: u8) -> bool {
        self.byte() > 255 - n
    }

    /// The next choice is an odd one.
    pub fn is_odd(&mut self) -> bool {
        self.odds > 0 && self.byte() > 255 - self.odds
    }

    /// An ordinary number between two.
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        let number = u16::from_le_bytes([self.byte(), self.byte()]);
        low + (high - low) * f64::from(number) / 65535.0
    }

    /// A number between two, or any finite one.
    pub fn finite(&mut self, low: f64, high: f64) -> f64 {
        if self.is_odd() { self.odd() } else { self.within(low, high) }
    }

    /// A number between two, or any at all.
    pub fn any(&mut self, low: f64, high: f64) -> f64 {
        if !self.is_odd() {
            return self.within(low, high);
        }
        match self.byte() {
            0..=15 => f64::NAN,
            16..=31 => f64::INFINITY,
            32..=47 => f64::NEG_INFINITY,
            _ => self.odd(),
        }
    }

    fn odd(&mut self) -> f64 {
        let size = ODD[self.below(ODD.len())];
        let sign = if self.chance(64) { -1.0 } else { 1.0 };
        let scale = if self.chance(128) { self.within(0.1, 1.0) } else { 1.0 };
        sign * size * scale
    }

    /// A whole number from `low` to `high`, or any.
    pub fn whole(&mut self, low: i64, high: i64) -> i64 {
        if self.is_odd() {
            ODD_WHOLE[self.below(ODD_WHOLE.len())]
        } else {
            low + self.below((high - low + 1) as usize) as i64
        }
    }
}
