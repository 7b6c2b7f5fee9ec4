//! The parts that the pictures of pages have in common.

use super::raised_flag::RaisedFlag;
use super::whose;
use crate::image::draw::Image;
use crate::image::draw::document::Sign;
use crate::image::draw::sheet::{Block, Sheet, Tone};
use crate::image::volume::Provenance;

/// A page as a picture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DrawnPage {
    /// The pixels.
    pub image: Image<3>,
    /// Whether they name the patient or the study.
    pub is_identified: bool,
}

impl DrawnPage {
    /// The page with that title, of `scans`, each with its name; below who they are of stand the `blocks`.
    pub(super) fn new(
        title: &str,
        scans: &[(&str, &Provenance)],
        blocks: Vec<Block>,
        footer: String,
    ) -> Self {
        let whose = whose::sentences(scans);
        let is_identified = !whose.is_empty();
        let whose = whose
            .into_iter()
            .map(|text| Block::Sentence(Tone::Strong, text));
        let sheet = Sheet {
            title: title.to_owned(),
            blocks: whose.chain(blocks).collect(),
            footer,
        };
        Self {
            image: sheet.image(),
            is_identified,
        }
    }
}

/// The headline of a result, and its flags in words.
pub(super) fn verdict(sign: Sign, headline: String, flags: &[RaisedFlag]) -> Vec<Block> {
    let tone = match sign {
        Sign::Good => Tone::Good,
        Sign::Flag => Tone::Flag,
        Sign::Bad => Tone::Bad,
    };
    let reasons: Vec<String> = flags.iter().map(|flag| flag.reason.clone()).collect();
    let headline = Block::Sentence(tone, headline);
    let reasons = (!reasons.is_empty()).then_some(Block::List(reasons));
    [headline].into_iter().chain(reasons).collect()
}

/// The warnings about files, under a heading; nothing where there is none.
pub(super) fn notes(warnings: Vec<String>) -> Vec<Block> {
    if warnings.is_empty() {
        return Vec::new();
    }
    vec![Block::Heading("Please note".into()), Block::List(warnings)]
}
