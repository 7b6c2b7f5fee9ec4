//! Files of one gate each as the gates of one study.
//!
//! In: 6 to 32 NIfTI files that a caller gives together. Out: what a file with as many volumes would be. The order is
//! that of the numbers in their names, where the names are the same but for one number; otherwise the caller's.
//!
//! Guaranteed: all gates lie on the grid of the first, and all together are within the limits of one file. Only the
//! first file stays open, because a packed file may be held in memory whole. Not guaranteed: that the files are moments
//! of one beat; a fit tells ([`crate::heart::beat`]), and a warning says what was taken for what.

use super::VolumeError;
use super::gate_names::{NamesSay, said_by_names};
use super::limits::ReadLimits;
use super::nifti::{NiftiFile, StatedGrid};
use super::open::{Decoded, HeaderFacts, OpenVolume};
use super::source::VolumeFile;
use super::summary::Tally;
use crate::base::progress::Monitor;
use crate::image::grid::gates::SAME_PLACE_MM;

/// Files of one gate each.
pub(super) struct GateFiles {
    /// The files of the gates after the first, in their order.
    others: Vec<VolumeFile>,
    first: NiftiFile,
    limits: ReadLimits,
    /// Warnings about the header of the first file, and about what the files were taken for.
    warnings: Vec<String>,
}

impl GateFiles {
    /// Reads and checks the headers.
    ///
    /// # Errors
    /// [`VolumeError::OtherGate`] for a file of several volumes and for gates on another grid, and what reading the
    /// headers gives.
    pub(super) fn open(files: &[&VolumeFile], limits: &ReadLimits) -> Result<Self, VolumeError> {
        let names: Vec<&str> = files.iter().map(|file| file.name()).collect();
        let order = order_of(&names);
        let sorted: Vec<VolumeFile> = order.iter().map(|&at| files[at].clone()).collect();
        let (first, others) = sorted.split_first().ok_or(VolumeError::NoFile)?;
        let first = NiftiFile::open(first, first, limits)?;
        let mut unpacked = first.end();
        check(1, &first, &first)?;
        for (index, file) in others.iter().enumerate() {
            let other = NiftiFile::open(file, file, limits)?;
            check(index + 2, &other, &first)?;
            unpacked = unpacked.saturating_add(other.end());
        }
        if unpacked > limits.unpacked_bytes {
            return Err(VolumeError::TooLarge {
                file: format!("the {} files of gates", files.len()),
                what: "unpacked bytes",
                asked: unpacked,
                limit: limits.unpacked_bytes,
            });
        }
        let mut warnings = first.header().warnings.to_vec();
        warnings.push(taken_for_gates(&order));
        Ok(Self {
            others: others.to_vec(),
            first,
            limits: *limits,
            warnings,
        })
    }

    /// Does `act` with the file of the gate, counted from 0.
    fn with<T>(
        &mut self,
        gate: usize,
        act: impl FnOnce(&mut NiftiFile) -> Result<T, VolumeError>,
    ) -> Result<T, VolumeError> {
        match gate.checked_sub(1) {
            None => act(&mut self.first),
            Some(other) => {
                let file = &self.others[other];
                act(&mut NiftiFile::open(file, file, &self.limits)?)
            }
        }
    }
}

/// Checks that the gate, counted from 1, is one volume on the grid of the first.
fn check(gate: usize, file: &NiftiFile, first: &NiftiFile) -> Result<(), VolumeError> {
    let (found, wanted) = (file.header(), first.header());
    let text = |shape: [usize; 3]| shape.map(|n| n.to_string()).join(" x ");
    let apart = (wanted.placement.frame).greatest_distance(&found.placement.frame, wanted.shape);
    let difference = if found.frames != 1 {
        format!("is a file of {} volumes", found.frames)
    } else if found.shape != wanted.shape {
        let [found, wanted] = [found.shape, wanted.shape].map(text);
        format!("has {found} voxels where gate 1 has {wanted}")
    } else if apart > SAME_PLACE_MM {
        format!("lies elsewhere: its voxels are up to {apart:.2} mm from those of gate 1")
    } else {
        return Ok(());
    };
    Err(VolumeError::OtherGate { gate, difference })
}

impl OpenVolume for GateFiles {
    fn header(&self) -> HeaderFacts<'_> {
        HeaderFacts {
            frames: 1 + self.others.len(),
            gated: true,
            warnings: &self.warnings,
            ..self.first.header()
        }
    }

    fn stated_grid(&self) -> Option<StatedGrid> {
        self.first.stated_grid()
    }

    fn assumes_gates(&self) -> bool {
        true
    }

    fn names_say(&self) -> NamesSay {
        said_by_names(&self.volume_names())
    }

    fn volume_names(&self) -> Vec<&str> {
        let names = [self.first.header().file].into_iter();
        names
            .chain(self.others.iter().map(VolumeFile::name))
            .collect()
    }

    fn decode_frame(&mut self, frame: usize, monitor: &Monitor) -> Result<Decoded, VolumeError> {
        self.with(frame, |file| file.decode_frame(0, monitor))
    }

    fn stream_frame(
        &mut self,
        frame: usize,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<(), VolumeError> {
        self.with(frame, |file| file.stream_frame(0, take, monitor))
    }

    fn stream_labels(
        &mut self,
        frame: usize,
        take: &mut dyn FnMut(usize, &[i64]),
        monitor: &Monitor,
    ) -> Result<(), VolumeError> {
        self.with(frame, |file| file.stream_labels(0, take, monitor))
    }

    fn decode_all(
        &mut self,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<(Tally, Vec<String>), VolumeError> {
        let gates = 1 + self.others.len();
        let (mut tally, mut warnings) = (Tally::default(), Vec::new());
        for gate in 0..gates {
            let part = monitor.part(gate, gates);
            let (own, told) = self.with(gate, |file| file.decode_all(take, &part))?;
            tally.merge(&own);
            for warning in told {
                if !warnings.contains(&warning) {
                    warnings.push(warning);
                }
            }
        }
        Ok((tally, warnings))
    }
}

/// What a warning says of files of one volume each.
pub(super) const FILES_TAKEN_FOR_GATES: &str = "were taken for the gates of one heart beat";

/// The warning that files of one volume each were taken for gates, in such an order.
pub(super) fn taken_for_gates(order: &[usize]) -> String {
    let by = match order.is_sorted() {
        true => "in the order in which they were given",
        false => "in the order of the numbers in their names",
    };
    format!(
        "{} files of one volume each {FILES_TAKEN_FOR_GATES}, {by}.",
        order.len()
    )
}

/// The order of files by the numbers in their `names`, or else as they are given, as indices.
pub(super) fn order_of(names: &[&str]) -> Vec<usize> {
    order_by_numbers(names).unwrap_or_else(|| (0..names.len()).collect())
}

/// The order of files by the numbers in their `names`, as indices; `None` unless the names are the same but for one
/// number, which all of them have and no two share.
pub fn order_by_numbers(names: &[&str]) -> Option<Vec<usize>> {
    let split: Vec<Vec<Piece>> = names.iter().map(|name| pieces(name)).collect();
    let first = split.first()?;
    let same = |at: usize| split.iter().all(|pieces| pieces.get(at) == first.get(at));
    if split.iter().any(|pieces| pieces.len() != first.len()) {
        return None;
    }
    let mut differing = (0..first.len()).filter(|&at| !same(at));
    let (Some(at), None) = (differing.next(), differing.next()) else {
        return None;
    };
    let number = |pieces: &Vec<Piece>| match pieces[at] {
        Piece::Number(number) => Some(number),
        Piece::Text(_) => None,
    };
    let numbers: Vec<u64> = split.iter().map(number).collect::<Option<_>>()?;
    let mut order: Vec<usize> = (0..names.len()).collect();
    order.sort_by_key(|&index| numbers[index]);
    let distinct = order
        .windows(2)
        .all(|two| numbers[two[0]] != numbers[two[1]]);
    distinct.then_some(order)
}

/// A part of a name.
#[derive(PartialEq)]
enum Piece<'a> {
    Text(&'a str),
    Number(u64),
}

/// A name as text and numbers in turn. Digits that make up no number of 64 bits are text.
fn pieces(name: &str) -> Vec<Piece<'_>> {
    let digit = |character: char| character.is_ascii_digit();
    let mut rest = name;
    let mut all = Vec::new();
    while let Some(start) = rest.chars().next() {
        let end = rest.find(|c| digit(c) != digit(start));
        let (piece, after) = rest.split_at(end.unwrap_or(rest.len()));
        all.push(piece.parse().map_or(Piece::Text(piece), Piece::Number));
        rest = after;
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_differ_in_one_number_are_ordered_by_it() {
        let order = |names: &[&str]| order_by_numbers(names);
        let gates = ["gate10.nii.gz", "gate2.nii.gz", "gate1.nii.gz"];
        assert_eq!(order(&gates), Some(vec![2, 1, 0]));
        assert_eq!(order(&["g 3of8.nii", "g 1of8.nii"]), Some(vec![1, 0]));
        assert_eq!(order(&["08", "009"]), Some(vec![0, 1]));
        for names in [
            // Two numbers differ, the texts differ, two are the same number, one has none, there is no difference.
            &["p1_gate2.nii", "p2_gate1.nii"][..],
            &["a1.nii", "b2.nii"],
            &["g1.nii", "g01.nii"],
            &["g1.nii", "g.nii"],
            &["", ""],
            &["g99999999999999999999.nii", "g99999999999999999998.nii"],
            &[],
        ] {
            assert_eq!(order(names), None, "{names:?}");
        }
    }
}
