//! Assigns the fragments of compressed pixels to frames (PS3.5 A.4).

use super::scan::Fragment;

/// The fragments of each of `frames` frames. `offsets` is the Basic Offset Table.
///
/// # Errors
/// If nothing says where a frame begins.
pub fn frames_of(
    offsets: &[u32],
    fragments: &[Fragment],
    frames: usize,
) -> Result<Vec<Vec<Fragment>>, String> {
    if frames == 1 {
        return Ok(vec![fragments.to_vec()]);
    }
    if fragments.len() == frames {
        return Ok(fragments.iter().map(|f| vec![*f]).collect());
    }
    let count = fragments.len();
    if offsets.len() != frames || count < frames {
        return Err(format!(
            "{count} fragments and {} offsets do not say where the {frames} frames begin",
            offsets.len()
        ));
    }
    let first = fragments.first().map_or(0, |f| f.begin);
    let mut begins = Vec::with_capacity(frames);
    for offset in offsets {
        let begin = first + u64::from(*offset);
        let found = fragments.binary_search_by_key(&begin, |f| f.begin);
        begins.push(found.map_err(|_| format!("no fragment begins at offset {offset}"))?);
    }
    if begins.first() != Some(&0) || !begins.is_sorted_by(|a, b| a < b) {
        return Err("the Basic Offset Table does not rise from 0".into());
    }
    let ends = begins.iter().skip(1).copied().chain([count]);
    let ranges = begins.iter().zip(ends);
    Ok(ranges.map(|(a, b)| fragments[*a..b].to_vec()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_say_which_fragments_make_a_frame() {
        // Items of 10, 20 and 30 bytes, each with a header of 8.
        let at = |begin, length| Fragment { begin, length };
        let three = [at(100, 10), at(118, 20), at(146, 30)];
        assert_eq!(frames_of(&[], &three, 1), Ok(vec![three.to_vec()]));
        let each = three.iter().map(|f| vec![*f]).collect();
        assert_eq!(frames_of(&[], &three, 3), Ok(each));
        let two = vec![vec![three[0], three[1]], vec![three[2]]];
        assert_eq!(frames_of(&[0, 46], &three, 2), Ok(two));
        for wrong in [&[][..], &[0, 40], &[46, 0], &[18, 46]] {
            assert!(frames_of(wrong, &three, 2).is_err(), "{wrong:?}");
        }
    }
}
