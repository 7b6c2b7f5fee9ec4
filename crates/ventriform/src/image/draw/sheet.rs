//! A page as one picture, for viewers that show nothing but pictures.
//!
//! In: blocks (headings, sentences, figures, tables, pictures), one below the other or in columns. Out:
//! [`Sheet::image`], black on white, [`SHEET_WIDTH_PX`] wide and as high as its blocks.
//!
//! Every text stays within the width of its block: sentences are wrapped, words that are longer than a line are broken,
//! and what exceeds the lines or the column that it may have ends in [`ELLIPSIS`]. No block overlaps another. If a
//! character cannot be drawn ([`glyphs`](super::glyphs)), the last line says what stands in its place.

use super::document::HeadlineFigure;
use super::glyphs::{Font, UNKNOWN_CHARACTER, Weight, is_drawn};
use super::image::Image;
use super::table::{CellKind, Table};
use super::vector::{Anchor, Drawing, Rgb, VectorShape};

/// Width of a sheet.
pub const SHEET_WIDTH_PX: usize = 1640;
/// White about a sheet's blocks.
const MARGIN_PX: usize = 40;
/// Width of a sheet's blocks.
pub const CONTENT_WIDTH_PX: usize = SHEET_WIDTH_PX - 2 * MARGIN_PX;
/// White between columns, and between pictures.
pub const COLUMN_GAP_PX: usize = 24;
/// White between blocks.
const BLOCK_GAP_PX: usize = 16;
/// More white above a heading.
const HEADING_GAP_PX: usize = 8;
/// White between the rows of a table, and between figures.
const ROW_GAP_PX: usize = 5;

/// Stands for the rest of a text that has no room.
pub const ELLIPSIS: &str = "...";

/// Heights of texts (SVG's font size).
const TITLE_SIZE_PX: f64 = 23.0;
const HEADING_SIZE_PX: f64 = 18.0;
const TEXT_SIZE_PX: f64 = 15.0;
const SMALL_SIZE_PX: f64 = 12.0;

/// Lines that a sentence, an entry of a list and the label of a figure may have.
const SENTENCE_LINES: usize = 6;
const ENTRY_LINES: usize = 3;
const LABEL_LINES: usize = 2;
/// Entries of a list that are shown.
const LIST_ENTRIES: usize = 24;
/// Characters of a figure's value and of its unit.
const VALUE_CHARACTERS: usize = 7;
const UNIT_CHARACTERS: usize = 6;
/// Lines that the title of a column has where there is room.
const TITLE_LINES: usize = 2;
/// Characters between the columns of a table, and fewest of a column.
const CELL_GAP_CHARACTERS: usize = 2;
const CELL_CHARACTERS: usize = 4;

const INK_RGB: Rgb = [16, 20, 26];
const SOFT_INK_RGB: Rgb = [84, 92, 102];
const RULE_RGB: Rgb = [205, 211, 218];
/// Nothing to look at, something to look at, something wrong.
const GOOD_RGB: Rgb = [20, 110, 50];
const FLAG_RGB: Rgb = [165, 85, 0];
const BAD_RGB: Rgb = [170, 20, 30];

/// The colour and the thickness of a sentence.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tone {
    /// A sentence like others.
    Plain,
    /// A sentence that explains.
    Soft,
    /// A sentence that is to be seen.
    Strong,
    /// All is well.
    Good,
    /// Somebody should look.
    Flag,
    /// Something is wrong.
    Bad,
}

/// A part of a sheet.
#[derive(Debug, Clone, PartialEq)]
pub enum Block {
    /// The title of what follows.
    Heading(String),
    /// A sentence.
    Sentence(Tone, String),
    /// Sentences, each with a dash.
    List(Vec<String>),
    /// Figures with their labels.
    Figures(Vec<HeadlineFigure>),
    /// A table.
    Table(Table),
    /// Pictures beside each other, each with what it shows. They fit into the width.
    Pictures(Vec<(Image<3>, String)>),
    /// Blocks beside each other: the width of each column, and what stands in it.
    Columns(Vec<(usize, Vec<Block>)>),
}

/// A page as a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheet {
    /// Its title.
    pub title: String,
    /// Its parts, from the top.
    pub blocks: Vec<Block>,
    /// The last line.
    pub footer: String,
}

impl Sheet {
    /// The picture.
    pub fn image(&self) -> Image<3> {
        self.drawing().image()
    }

    fn drawing(&self) -> Drawing {
        let mut pen = Pen::default();
        let mut top = MARGIN_PX;
        let title = Line {
            size: TITLE_SIZE_PX,
            weight: Weight::Bold,
            ink: INK_RGB,
        };
        top += pen.wrapped([MARGIN_PX, top], &self.title, title, CONTENT_WIDTH_PX, 2);
        top += BLOCK_GAP_PX / 2;
        top += pen.blocks([MARGIN_PX, top], &self.blocks, CONTENT_WIDTH_PX);
        top += BLOCK_GAP_PX;
        pen.rule([MARGIN_PX, top], CONTENT_WIDTH_PX);
        top += BLOCK_GAP_PX / 2;
        let footer = Line::new(SMALL_SIZE_PX, SOFT_INK_RGB);
        top += pen.wrapped([MARGIN_PX, top], &self.footer, footer, CONTENT_WIDTH_PX, 2);
        if !pen.all_drawn {
            let note = format!(
                "{UNKNOWN_CHARACTER} stands for a character that this picture cannot draw; the header of its file has \
                 the text."
            );
            top += pen.wrapped([MARGIN_PX, top], &note, footer, CONTENT_WIDTH_PX, 2);
        }
        Drawing {
            title: self.title.clone(),
            width: SHEET_WIDTH_PX,
            height: top + MARGIN_PX,
            shapes: pen.shapes,
        }
    }
}

/// How a line of text is written.
#[derive(Clone, Copy)]
struct Line {
    size: f64,
    weight: Weight,
    ink: Rgb,
}

impl Line {
    fn new(size: f64, ink: Rgb) -> Self {
        Self {
            size,
            weight: Weight::Regular,
            ink,
        }
    }

    fn bold(self) -> Self {
        Self {
            weight: Weight::Bold,
            ..self
        }
    }

    fn font(self) -> Font {
        Font::nearest(self.size, self.weight)
    }

    /// Characters that a line of `width` pixels has.
    fn characters(self, width: usize) -> usize {
        (width / self.font().character_width()).max(1)
    }
}

impl Tone {
    fn line(self) -> Line {
        let line = |ink| Line::new(TEXT_SIZE_PX, ink);
        match self {
            Self::Plain => line(INK_RGB),
            Self::Soft => line(SOFT_INK_RGB),
            Self::Strong => line(INK_RGB).bold(),
            Self::Good => line(GOOD_RGB).bold(),
            Self::Flag => line(FLAG_RGB).bold(),
            Self::Bad => line(BAD_RGB).bold(),
        }
    }
}

/// The shapes of a sheet so far.
struct Pen {
    shapes: Vec<VectorShape>,
    /// Whether every character can be drawn.
    all_drawn: bool,
}

impl Default for Pen {
    fn default() -> Self {
        Self {
            shapes: Vec::new(),
            all_drawn: true,
        }
    }
}

/// Each method draws from the left and the top that `place` says, within `width` pixels, and gives the height of it.
impl Pen {
    fn blocks(&mut self, [left, top]: [usize; 2], blocks: &[Block], width: usize) -> usize {
        let mut height = 0;
        for block in blocks {
            if height > 0 {
                height += BLOCK_GAP_PX;
                // A list belongs to the sentence above it.
                if matches!(block, Block::List(_) | Block::Sentence(..)) {
                    height -= BLOCK_GAP_PX / 2;
                }
                if matches!(block, Block::Heading(_)) {
                    height += HEADING_GAP_PX;
                }
            }
            height += self.block([left, top + height], block, width);
        }
        height
    }

    fn block(&mut self, place: [usize; 2], block: &Block, width: usize) -> usize {
        match block {
            Block::Heading(text) => {
                let line = Line::new(HEADING_SIZE_PX, INK_RGB).bold();
                self.wrapped(place, text, line, width, 2)
            }
            Block::Sentence(tone, text) => {
                self.wrapped(place, text, tone.line(), width, SENTENCE_LINES)
            }
            Block::List(entries) => self.list(place, entries, width),
            Block::Figures(figures) => self.figures(place, figures, width),
            Block::Table(table) => self.table(place, table, width),
            Block::Pictures(pictures) => self.pictures(place, pictures),
            Block::Columns(columns) => {
                let [mut left, top] = place;
                let mut height = 0;
                for (width, blocks) in columns {
                    height = height.max(self.blocks([left, top], blocks, *width));
                    left += width + COLUMN_GAP_PX;
                }
                height
            }
        }
    }

    /// A line of text, whose top is given.
    fn line(&mut self, [left, top]: [usize; 2], anchor: Anchor, text: &str, line: Line) -> usize {
        let height = line.font().line_height();
        self.all_drawn &= is_drawn(text);
        let middle = top as f64 + line.font().capital_middle();
        self.shapes.push(VectorShape::Label {
            at: [left as f64, middle],
            anchor,
            text: text.to_owned(),
            weight: line.weight,
            size: line.size,
            ink: line.ink,
            rim: None,
        });
        height
    }

    fn wrapped(
        &mut self,
        [left, top]: [usize; 2],
        text: &str,
        line: Line,
        width: usize,
        most: usize,
    ) -> usize {
        let mut height = 0;
        for text in wrapped(text, line.characters(width), most) {
            height += self.line([left, top + height], Anchor::Start, &text, line);
        }
        height
    }

    fn list(&mut self, [left, top]: [usize; 2], entries: &[String], width: usize) -> usize {
        let line = Tone::Plain.line();
        let indent = 2 * line.font().character_width();
        let mut height = 0;
        for entry in entries.iter().take(LIST_ENTRIES) {
            self.line([left, top + height], Anchor::Start, "-", line);
            let place = [left + indent, top + height];
            height += self.wrapped(place, entry, line, width - indent, ENTRY_LINES);
        }
        let more = entries.len().saturating_sub(LIST_ENTRIES);
        if more > 0 {
            let text = format!("{more} more: in the report");
            height += self.line([left + indent, top + height], Anchor::Start, &text, line);
        }
        height
    }

    fn figures(
        &mut self,
        [left, top]: [usize; 2],
        figures: &[HeadlineFigure],
        width: usize,
    ) -> usize {
        let value = Line::new(HEADING_SIZE_PX, INK_RGB).bold();
        let unit = Tone::Soft.line();
        let label = Tone::Plain.line();
        let value_end = left + VALUE_CHARACTERS * value.font().character_width();
        let gap = unit.font().character_width();
        let unit_start = value_end + gap;
        let label_start = unit_start + (UNIT_CHARACTERS + 1) * gap;
        // Texts of two sizes on one height of capitals.
        let lower =
            (value.font().capital_middle() - label.font().capital_middle()).round() as usize;
        let mut height = 0;
        for figure in figures {
            let row = top + height;
            let text = cut(&figure.value, VALUE_CHARACTERS);
            let high = self.line([value_end, row], Anchor::End, &text, value);
            let text = cut(figure.unit, UNIT_CHARACTERS);
            self.line([unit_start, row + lower], Anchor::Start, &text, unit);
            let place = [label_start, row + lower];
            let room = (left + width).saturating_sub(label_start);
            let below = lower + self.wrapped(place, &figure.label, label, room, LABEL_LINES);
            height += high.max(below) + ROW_GAP_PX;
        }
        height.saturating_sub(ROW_GAP_PX)
    }

    fn table(&mut self, [left, top]: [usize; 2], table: &Table, width: usize) -> usize {
        let normal = Tone::Plain.line();
        let small = Line::new(SMALL_SIZE_PX, INK_RGB);
        let fits = ColumnWidths::from_table(table).least_all() <= normal.characters(width);
        let line = if fits { normal } else { small };
        let widths = ColumnWidths::from_table(table).within(line.characters(width));
        let head = Line {
            ink: SOFT_INK_RGB,
            ..line
        };
        let titles: Vec<Vec<String>> = (table.columns.iter().zip(&widths))
            .map(|(column, width)| wrapped(&column.title, *width, usize::MAX))
            .collect();
        let character = line.font().character_width();
        let high = line.font().line_height();
        let starts = widths.iter().scan(left, |start, width| {
            let own = *start;
            *start += (width + CELL_GAP_CHARACTERS) * character;
            Some(own)
        });
        let places: Vec<(usize, usize)> = (starts.zip(&widths))
            .map(|(start, width)| (start, start + width * character))
            .collect();
        let all = places.last().map_or(0, |(_, end)| end - left);
        let untitled = table.columns.iter().all(|column| column.title.is_empty());
        let lines = titles.iter().map(Vec::len).max().unwrap_or(0);
        let kinds: Vec<CellKind> = table.columns.iter().map(|column| column.kind).collect();
        let cell = |pen: &mut Self, column: usize, top: usize, text: &str, line: Line| {
            let (start, end) = places[column];
            match kinds[column] {
                CellKind::Number => pen.line([end, top], Anchor::End, text, line),
                _ => pen.line([start, top], Anchor::Start, text, line),
            };
        };
        for (column, title) in titles.iter().enumerate().filter(|_| !untitled) {
            // Titles end on one line.
            let above = lines - title.len();
            for (number, text) in title.iter().enumerate() {
                cell(self, column, top + (above + number) * high, text, head);
            }
        }
        let mut height = 0;
        if !untitled {
            height = lines * high + ROW_GAP_PX;
            self.rule([left, top + height], all);
            height += ROW_GAP_PX;
        }
        for row in &table.rows {
            for (column, text) in row.iter().enumerate().take(widths.len()) {
                cell(self, column, top + height, &cut(text, widths[column]), line);
            }
            height += high + ROW_GAP_PX;
        }
        height.saturating_sub(ROW_GAP_PX)
    }

    fn pictures(&mut self, [mut left, top]: [usize; 2], pictures: &[(Image<3>, String)]) -> usize {
        let line = Tone::Plain.line();
        let mut height = 0;
        for (image, caption) in pictures {
            self.shapes.push(VectorShape::Picture {
                corner: [left, top],
                image: image.clone(),
            });
            let mut below = image.height;
            // A picture without a caption has no line below it.
            let most = if caption.is_empty() { 0 } else { 2 };
            for text in wrapped(caption, line.characters(image.width), most) {
                let middle = left + image.width / 2;
                below += self.line([middle, top + below], Anchor::Middle, &text, line);
            }
            height = height.max(below);
            left += image.width + COLUMN_GAP_PX;
        }
        height
    }

    fn rule(&mut self, [left, top]: [usize; 2], width: usize) {
        let y = top as f64 + 0.5;
        self.shapes.push(VectorShape::Line {
            ends: [[left as f64, y], [(left + width) as f64, y]],
            stroke: RULE_RGB,
            width: 1.0,
        });
    }
}

/// Widths of the columns of a table, characters.
struct ColumnWidths {
    /// Every word of the title and every cell has room.
    least: Vec<usize>,
    /// The title has no more than [`TITLE_LINES`].
    wished: Vec<usize>,
}

impl ColumnWidths {
    fn from_table(table: &Table) -> Self {
        let least = |column: usize| {
            let cells = table.rows.iter().filter_map(|row| row.get(column));
            let title = table.columns[column].title.split_whitespace();
            let texts = cells.map(String::as_str).chain(title);
            texts.map(length).max().unwrap_or(0).max(1)
        };
        let least: Vec<usize> = (0..table.columns.len()).map(least).collect();
        let wished = (least.iter().zip(&table.columns))
            .map(|(least, column)| {
                let title = &column.title;
                let fits = |width: &usize| wrapped(title, *width, usize::MAX).len() <= TITLE_LINES;
                (*least..length(title))
                    .find(fits)
                    .unwrap_or(length(title).max(*least))
            })
            .collect();
        Self { least, wished }
    }

    fn gaps(&self) -> usize {
        CELL_GAP_CHARACTERS * self.least.len().saturating_sub(1)
    }

    fn least_all(&self) -> usize {
        self.gaps() + self.least.iter().sum::<usize>()
    }

    /// Widths that are within `all` characters with the gaps. The widest columns are narrowed where there is no room
    /// for all cells, and what room there is goes to titles.
    fn within(&self, all: usize) -> Vec<usize> {
        let mut widths = self.least.clone();
        let mut room = all.saturating_sub(self.least_all());
        for (width, wished) in widths.iter_mut().zip(&self.wished) {
            let more = room.min(wished - *width);
            *width += more;
            room -= more;
        }
        while self.gaps() + widths.iter().sum::<usize>() > all {
            match widths.iter_mut().max() {
                Some(width) if *width > CELL_CHARACTERS => *width -= 1,
                _ => break,
            }
        }
        widths
    }
}

fn length(text: &str) -> usize {
    text.chars().count()
}

/// `text`, or as much of it as has room before [`ELLIPSIS`] within so many characters.
fn cut(text: &str, characters: usize) -> String {
    if length(text) <= characters {
        return text.to_owned();
    }
    let kept = characters.saturating_sub(ELLIPSIS.len());
    let dots = ELLIPSIS.chars().take(characters);
    text.chars().take(kept).chain(dots).collect()
}

/// The lines of `text`, at most `most`, of so many characters. Words are broken only if they are longer than a line.
fn wrapped(text: &str, characters: usize, most: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let mut line = String::new();
    for word in text.split_whitespace() {
        let letters: Vec<char> = word.chars().collect();
        for part in letters.chunks(characters.max(1)) {
            let gap = usize::from(!line.is_empty());
            if length(&line) + gap + part.len() > characters {
                lines.push(std::mem::take(&mut line));
            } else if gap == 1 {
                line.push(' ');
            }
            line.extend(part);
        }
    }
    lines.push(line);
    if lines.len() > most {
        lines.truncate(most);
        if let Some(last) = lines.last_mut() {
            let kept: String = last
                .chars()
                .take(characters.saturating_sub(ELLIPSIS.len()))
                .collect();
            let dots = ELLIPSIS.chars().take(characters);
            *last = kept.trim_end().chars().chain(dots).collect();
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::super::table::TableColumn;
    use super::*;

    const LONG: &str = "A sentence that does not fit into one line of a narrow column, and \
        Donaudampfschifffahrtsgesellschaftskapitän";

    /// A sheet on which every text is `text`, repeated.
    fn sheet(text: &str) -> Sheet {
        let of = |times: usize| text.repeat(times);
        let table = |columns: usize| {
            let columns: Vec<TableColumn> = (0..columns)
                .map(|n| {
                    if n == 1 {
                        TableColumn::number(of(1))
                    } else {
                        TableColumn::name(of(2))
                    }
                })
                .collect();
            let row = vec![of(3); columns.len()];
            Block::Table(Table {
                columns,
                rows: vec![row; 3],
            })
        };
        let figure = HeadlineFigure {
            value: of(1),
            unit: "EDV/s per second",
            label: of(4),
        };
        let picture = |width| (Image::filled(width, 50, [200, 30, 30]), of(2));
        Sheet {
            title: of(6),
            blocks: vec![
                Block::Sentence(Tone::Flag, of(9)),
                Block::List(vec![of(9); 30]),
                Block::Columns(vec![
                    (
                        700,
                        vec![
                            Block::Heading(of(3)),
                            Block::Figures(vec![figure; 3]),
                            table(2),
                        ],
                    ),
                    (
                        CONTENT_WIDTH_PX - 700 - COLUMN_GAP_PX,
                        vec![table(4), Block::Pictures(vec![picture(300), picture(200)])],
                    ),
                ]),
                table(3),
                table(12),
            ],
            footer: of(9),
        }
    }

    /// Left, top, right and bottom of every text and picture.
    fn boxes(sheet: &Sheet) -> Vec<[i64; 4]> {
        let drawing = sheet.drawing();
        let of = |shape: &VectorShape| match shape {
            VectorShape::Label {
                at: [x, y],
                anchor,
                text,
                weight,
                size,
                ..
            } => {
                let font = Font::nearest(*size, *weight);
                let width = (length(text) * font.character_width()) as f64;
                let left = match anchor {
                    Anchor::Start => *x,
                    Anchor::Middle => x - width / 2.0,
                    Anchor::End => x - width,
                };
                let high = font.line_height() as f64;
                let top = y - font.capital_middle();
                Some([left, top, left + width, top + high].map(|x| x.round() as i64))
            }
            VectorShape::Picture {
                corner: [left, top],
                image,
            } => Some([*left, *top, left + image.width, top + image.height].map(|x| x as i64)),
            _ => None,
        };
        let places: Vec<[i64; 4]> = drawing.shapes.iter().filter_map(of).collect();
        for [left, top, right, bottom] in &places {
            let margin = MARGIN_PX as i64;
            assert!(*left >= margin && *right <= SHEET_WIDTH_PX as i64 - margin);
            assert!(*top >= margin && *bottom <= drawing.height as i64 - margin);
        }
        places
    }

    /// However long the texts are and whatever they are written in, all lie within the margins, and no two of them in
    /// one place.
    #[test]
    fn texts_of_any_length_lie_within_the_sheet_and_beside_each_other() {
        for text in ["x", "Müller", LONG, "山田太郎", "W\n\u{202e}\t7", "", " "] {
            let places = boxes(&sheet(text));
            for (n, one) in places.iter().enumerate() {
                for other in &places[..n] {
                    let apart = one[0] >= other[2]
                        || other[0] >= one[2]
                        || one[1] >= other[3]
                        || other[1] >= one[3];
                    assert!(apart, "{text:?}: {one:?} {other:?}");
                }
            }
        }
    }

    /// What exceeds its room ends in dots, and a broken word loses no letter.
    #[test]
    fn sentences_are_wrapped_and_cut() {
        let words = |lines: &[String]| lines.join("").replace(' ', "");
        for characters in 1..60 {
            let lines = wrapped(LONG, characters, usize::MAX);
            assert!(lines.iter().all(|line| length(line) <= characters));
            assert_eq!(words(&lines), LONG.replace(' ', ""));
            for most in 1..4 {
                let few = wrapped(LONG, characters, most);
                assert!(few.len() == most.min(lines.len()));
                assert!(few.iter().all(|line| length(line) <= characters));
                let dots = few[few.len() - 1].ends_with('.');
                assert_eq!(dots, few.len() < lines.len(), "{few:?}");
            }
            assert!(length(&cut(LONG, characters)) <= characters);
        }
        assert_eq!(cut("four", 4), "four");
        assert_eq!(cut("sixsix", 5), "si...");
        assert_eq!(wrapped("", 5, 2), [""]);
    }

    /// A name in a script that the font lacks leaves a trace for each character, and the sheet says so.
    #[test]
    fn what_cannot_be_drawn_is_told() {
        let of = |name: &str| Sheet {
            title: "Page".into(),
            blocks: vec![Block::Sentence(Tone::Plain, name.into())],
            footer: String::new(),
        };
        let noted = |name: &str| {
            let drawing = of(name).drawing();
            drawing.shapes.iter().any(|shape| {
                matches!(shape, VectorShape::Label { text, .. } if text.contains("cannot draw"))
            })
        };
        assert!(noted("山田^太郎") && !noted("Müller^Jürgen"));
        let images = ["山", "山田", "山田太", "山田太郎"].map(|name| of(name).image());
        for pair in images.windows(2) {
            assert_ne!(pair[0], pair[1]);
        }
    }

    #[test]
    fn a_table_that_is_too_wide_is_narrowed_at_its_widest_columns() {
        let table = Table {
            columns: vec![
                TableColumn::number("No."),
                TableColumn::name("Segment"),
                TableColumn::number("rest less stress, points"),
            ],
            rows: vec![vec!["1".into(), "basal anterior".repeat(4), "+3".into()]],
        };
        let widths = ColumnWidths::from_table(&table);
        assert_eq!(widths.least, [3, 56, 7]);
        assert_eq!(widths.within(200), [3, 56, 14]);
        assert_eq!(widths.within(75), [3, 56, 12]);
        assert_eq!(widths.within(40), [3, 26, 7]);
    }
}
