//! Characters as pixels, for pictures that no viewer's font is at hand for: Noto Sans Mono in four sizes and two
//! weights.
//!
//! Drawn are the printable characters of ASCII, Latin-1 and Latin Extended-A, and what [`drawn_as`] draws by one of
//! them. Any other character, a control character too, is drawn as [`UNKNOWN_CHARACTER`]: no character is left out.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

/// Stands for a character that cannot be drawn.
pub const UNKNOWN_CHARACTER: char = '\u{fffd}';

/// Height of a text (SVG's font size) as a share of the height of its line.
const SIZE_SHARE: f64 = 0.734;

/// Thickness of characters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Weight {
    /// That of running text.
    Regular,
    /// That of headings.
    Bold,
}

/// Characters of one size and weight, all of one width.
#[derive(Debug, Clone, Copy)]
pub struct Font {
    weight: FontWeight,
    raster: RasterHeight,
}

impl Font {
    /// The characters whose height is next to `size`, pixels (SVG's font size).
    pub fn nearest(size: f64, weight: Weight) -> Self {
        const RASTERS: [RasterHeight; 4] = [
            RasterHeight::Size16,
            RasterHeight::Size20,
            RasterHeight::Size24,
            RasterHeight::Size32,
        ];
        let distance = |raster: RasterHeight| (SIZE_SHARE * raster.val() as f64 - size).abs();
        let raster = RASTERS.into_iter().reduce(|best, next| {
            if distance(next) < distance(best) {
                next
            } else {
                best
            }
        });
        Self {
            weight: match weight {
                Weight::Regular => FontWeight::Regular,
                Weight::Bold => FontWeight::Bold,
            },
            raster: raster.unwrap_or(RasterHeight::Size16),
        }
    }

    /// Width of a character with its spacing, pixels.
    pub fn character_width(self) -> usize {
        get_raster_width(self.weight, self.raster)
    }

    /// Height of a line, pixels.
    pub fn line_height(self) -> usize {
        self.raster.val()
    }

    /// How far below the top of a line the middle of its capitals lies, pixels.
    pub fn capital_middle(self) -> f64 {
        match self.raster {
            RasterHeight::Size16 => 8.5,
            RasterHeight::Size20 => 11.0,
            RasterHeight::Size24 => 12.5,
            RasterHeight::Size32 => 16.5,
        }
    }

    /// How much of each pixel `character` covers, 0 to 255, row by row: [`Font::character_width`] times
    /// [`Font::line_height`] of them; none for a character that has no ink.
    pub fn coverage(self, character: char) -> &'static [u8] {
        let glyph = |character| get_raster(character, self.weight, self.raster);
        let glyph = glyph(drawn_as(character)).or_else(|| glyph(UNKNOWN_CHARACTER));
        glyph.map_or(&[][..], |glyph| glyph.pixels())
    }
}

/// The character that `character` is drawn as: dashes, quotation marks and spaces as those of ASCII, what the font
/// lacks as [`UNKNOWN_CHARACTER`], any other as itself.
pub fn drawn_as(character: char) -> char {
    match character {
        '\u{2010}'..='\u{2015}' | '\u{2212}' => '-',
        '\u{2018}' | '\u{2019}' => '\'',
        '\u{201c}' | '\u{201d}' => '"',
        '\u{a0}' | '\u{2002}'..='\u{200a}' | '\u{202f}' => ' ',
        ' '..='~' | '\u{a1}'..='\u{ac}' | '\u{ae}'..='\u{17f}' => character,
        _ => UNKNOWN_CHARACTER,
    }
}

/// Whether all of `text` is drawn as it is written.
pub fn is_drawn(text: &str) -> bool {
    !text.chars().any(|c| drawn_as(c) == UNKNOWN_CHARACTER)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZES: [f64; 4] = [12.0, 15.0, 18.0, 23.0];
    const WEIGHTS: [Weight; 2] = [Weight::Regular, Weight::Bold];

    /// Whatever a name is written in, each of its characters leaves ink, and those of ASCII are told apart.
    #[test]
    fn every_character_is_drawn_and_those_of_ascii_differ() {
        for (size, weight) in SIZES.into_iter().flat_map(|s| WEIGHTS.map(|w| (s, w))) {
            let font = Font::nearest(size, weight);
            let pixels = font.character_width() * font.line_height();
            let mut seen = std::collections::BTreeMap::new();
            for character in (0..=0xffff).filter_map(char::from_u32) {
                let coverage = font.coverage(character);
                assert_eq!(coverage.len(), pixels, "{character:?}");
                let space = drawn_as(character) == ' ';
                assert_eq!(coverage.iter().all(|c| *c == 0), space, "{character:?}");
                if character.is_ascii_graphic() {
                    let other = seen.insert(coverage, character);
                    assert_eq!(other, None, "{character:?}");
                }
            }
        }
    }

    #[test]
    fn capitals_lie_about_their_middle() {
        for (size, weight) in SIZES.into_iter().flat_map(|s| WEIGHTS.map(|w| (s, w))) {
            let font = Font::nearest(size, weight);
            let lines = font.coverage('H').chunks(font.character_width());
            let inked = lines.map(|line| line.iter().any(|c| *c > 100));
            let rows: Vec<usize> = (0..)
                .zip(inked)
                .filter(|(_, ink)| *ink)
                .map(|(n, _)| n)
                .collect();
            let middle = (rows[0] + rows[rows.len() - 1] + 1) as f64 / 2.0;
            assert!(
                (middle - font.capital_middle()).abs() <= 0.5,
                "{size}: {middle}"
            );
        }
    }

    #[test]
    fn what_cannot_be_drawn_is_known() {
        for (text, whole) in [
            ("Müller^Jürgen − 5 °", true),
            ("Łukasz Őry", true),
            ("山田^太郎", false),
            ("Ιωάννης", false),
            ("a\u{202e}b", false),
            ("a\nb", false),
        ] {
            assert_eq!(is_drawn(text), whole, "{text}");
        }
    }
}
