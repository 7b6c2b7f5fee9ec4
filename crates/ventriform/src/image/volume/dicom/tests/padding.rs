//! Pixel Padding is no uptake, in every kind of image.

use super::objects::{ct, enhanced, files};
use super::*;

const PADDING_VALUE_TAG: (u16, u16) = (0x28, 0x120);
const PADDING_LIMIT_TAG: (u16, u16) = (0x28, 0x121);

/// The voxels of `elements` and the warnings.
fn padded(mut elements: Elements, given: &[((u16, u16), &'static str, Value)]) -> Vec<f32> {
    for (tag, vr, value) in given {
        elements.insert(*tag, (vr, value.clone()));
    }
    let reading = read_elements(&elements).unwrap();
    let said = reading.facts.warnings.iter();
    let said = said
        .filter(|warning| warning.contains("are Pixel Padding"))
        .count();
    assert_eq!(said, 1, "{:?}", reading.facts.warnings);
    assert!(reading.facts.intensity.maximum < 60_000.0);
    reading.volume.voxels
}

/// `count` numbers from `first` on, of which number 1 and 4 are `value`.
fn pixels(first: u16, count: u16, value: u16) -> ((u16, u16), &'static str, Value) {
    let numbers = (0..count).map(|n| match n {
        1 | 4 => value,
        _ => first + n,
    });
    ((0x7fe0, 0x10), "OW", Shorts(numbers.collect()))
}

#[test]
fn padding_counts_as_no_uptake() {
    let value = |n| (PADDING_VALUE_TAG, "US", Shorts(vec![n]));
    let nm = padded(slices(), &[pixels(10, 24, 63_536), value(63_536)]);
    assert_eq!(nm[..6], [10.0, 0.0, 12.0, 13.0, 0.0, 15.0]);
    assert_eq!(nm.iter().filter(|v| **v == 0.0).count(), 2);
    // Signed, and scaled so that the number itself would be hot.
    let scaling = [
        ((0x28, 0x103), "US", Shorts(vec![1])),
        ((0x28, 0x1053), "DS", Text("-0.5")),
    ];
    let hot = [
        pixels(10, 24, 0x8000),
        (PADDING_VALUE_TAG, "SS", Shorts(vec![0x8000])),
    ];
    let nm = padded(slices(), &[&scaling[..], &hot].concat());
    assert_eq!(nm[..3], [-5.0, 0.0, -6.0]);
    // A range, in either order of its ends.
    for ends in [[63_000, 65_535], [65_535, 63_000]] {
        let limit = (PADDING_LIMIT_TAG, "US", Shorts(vec![ends[1]]));
        let nm = padded(slices(), &[pixels(10, 24, 64_000), value(ends[0]), limit]);
        assert_eq!(nm[..3], [10.0, 0.0, 12.0]);
    }
    // Gated: in the sum of the gates.
    let reading = {
        let mut elements = gated();
        elements.insert((0x7fe0, 0x10), ("OW", Shorts(vec![63_536; 48])));
        elements.insert(PADDING_VALUE_TAG, ("US", Shorts(vec![63_536])));
        read_elements(&elements).unwrap()
    };
    assert_eq!(reading.facts.intensity.maximum, 0.0);
    let every = enhanced();
    let pet = padded(every, &[pixels(10, 24, 65_535), value(65_535)]);
    // The frame stored third lies lowest; the one stored first is scaled by 4.
    assert_eq!(pet[..2], [22.0, 23.0]);
    assert_eq!(pet[18..24], [40.0, 0.0, 48.0, 52.0, 0.0, 60.0]);
}

#[test]
fn padding_of_slices_counts_as_air_or_as_no_uptake() {
    for (class, background) in [("2", -1000.0), ("4", 0.0), ("128", 0.0)] {
        let class = written(format!("1.2.840.10008.5.1.4.1.1.{class}"));
        let ct = ["0", "3"].map(|height| {
            let mut slice = ct(height, 10);
            let (tag, vr, value) = pixels(10, 6, 0x8000);
            slice.insert(tag, (vr, value));
            slice.insert((0x08, 0x16), ("UI", class.clone()));
            // Each file has padding of its own.
            let padding = if height == "0" { 0x8000 } else { 15 };
            slice.insert(PADDING_VALUE_TAG, ("SS", Shorts(vec![padding])));
            slice
        });
        let options = ReadOptions::default();
        let limits = ReadLimits::default();
        let reading = read_volume(&files(&ct), &options, &limits, &Monitor::silent()).unwrap();
        let voxels = reading.volume.voxels;
        assert_eq!(voxels[..3], [5.0, background, 7.0]);
        assert_eq!((voxels[7], voxels[11]), (-32_773.0, background));
        let warning = &reading.facts.warnings[0];
        assert!(
            warning.starts_with("3 voxels are Pixel Padding"),
            "{warning}"
        );
    }
}

#[test]
fn padding_may_need_more_bits_than_are_stored() {
    let twelve = [
        ((0x28, 0x101), "US", Shorts(vec![12])),
        ((0x28, 0x102), "US", Shorts(vec![11])),
    ];
    // 63536 without its upper four bits is 2096, which the image may hold.
    let mut given = twelve.to_vec();
    given.push((PADDING_VALUE_TAG, "US", Shorts(vec![63_536])));
    given.push(pixels(2096, 24, 63_536));
    let voxels = padded(slices(), &given);
    assert_eq!(voxels[..6], [2096.0, 0.0, 2098.0, 2099.0, 0.0, 2101.0]);
    // Upper bits that belong to no value do not hide padding.
    let mut given = twelve.to_vec();
    given.push((PADDING_VALUE_TAG, "US", Shorts(vec![4095])));
    given.push(pixels(10, 24, 0xafff));
    assert_eq!(padded(slices(), &given)[..2], [10.0, 0.0]);
}

#[test]
fn padding_of_floating_point_pixels() {
    for padding in [1e30_f32, f32::NAN] {
        let mut elements = enhanced();
        elements.remove(&(0x7fe0, 0x10));
        let value = |n: u32| if n == 1 { padding } else { n as f32 };
        let bits = (0..24).map(|n| value(n).to_bits()).collect();
        elements.insert((0x7fe0, 0x08), ("OW", Longs(bits)));
        elements.insert((0x28, 0x122), ("FL", Single(padding)));
        let reading = read_elements(&elements).unwrap();
        assert_eq!(reading.volume.voxels[18..21], [0.0, 0.0, 8.0]);
        assert_eq!(reading.facts.intensity.missing, 0);
    }
}

#[test]
fn padding_that_is_no_uptake_already_is_not_worth_a_word() {
    let reading = changed(|e| {
        e.insert(PADDING_VALUE_TAG, ("US", Shorts(vec![0])));
    });
    let reading = reading.unwrap();
    assert_eq!(reading.facts.warnings, Vec::<String>::new());
    assert_eq!(reading.volume.voxels[..3], [0.0, 1.0, 2.0]);
}
