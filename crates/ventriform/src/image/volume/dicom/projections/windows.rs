//! The energy window that is reconstructed (PS3.3 C.8.4.10).

use ventriform_dicom::read::ReadError;
use ventriform_dicom::read::attributes::{
    Attributes, ENERGY_LOWER, ENERGY_UPPER, ENERGY_WINDOW_VECTOR, NUCLIDE_MEANING,
    PHARMACEUTICAL_NAME,
};

/// The main photopeak of the radionuclides of cardiac scans, keV, by a word of their names in small letters.
const PHOTOPEAKS_KEV: [(&str, f64); 4] = [
    ("thallium", 70.8),
    ("201", 70.8),
    ("iodine", 159.0),
    ("123", 159.0),
];

/// The photopeak of technetium-99m, keV, the usual radionuclide.
const TECHNETIUM_KEV: f64 = 140.5;

/// The number, from 0, of the window that is reconstructed, of `windows`; `asked` counts from 1.
///
/// # Errors
/// [`ReadError::Field`] if there is no such window, or if none or several hold the photopeak.
pub(super) fn chosen(
    a: &Attributes,
    windows: usize,
    asked: Option<usize>,
    warnings: &mut Vec<String>,
) -> Result<usize, ReadError> {
    let refuse =
        |value: String, reason: String| Err(a.wrong(ENERGY_WINDOW_VECTOR.name, &value, reason));
    match asked {
        Some(window) if (1..=windows).contains(&window) => return Ok(window - 1),
        Some(window) => {
            let reason = format!("`energy_window` asks for window {window}");
            return refuse(windows.to_string(), reason);
        }
        None if windows == 1 => return Ok(0),
        None => {}
    }
    let peak_kev = photopeak_kev(a);
    let mut list = Vec::new();
    let mut holding = Vec::new();
    for window in 0..windows {
        let limit = |attribute| a.decimals_of_item::<1>(attribute, window);
        let bounds = match (limit(ENERGY_LOWER)?, limit(ENERGY_UPPER)?) {
            (Some([lower]), Some([upper])) => {
                if (lower..=upper).contains(&peak_kev) {
                    holding.push(window);
                }
                format!("{lower} to {upper} keV")
            }
            _ => "no limits".into(),
        };
        list.push(format!("{} ({bounds})", window + 1));
    }
    let list = list.join(", ");
    match holding[..] {
        [window] => {
            warnings.push(format!(
                "Of the energy windows {list}, number {} was reconstructed, which holds the photopeak at \
                 {peak_kev} keV.",
                window + 1
            ));
            Ok(window)
        }
        _ => refuse(
            windows.to_string(),
            format!(
                "of the windows {list}, not one but {} hold the photopeak at {peak_kev} keV; set `energy_window`",
                holding.len()
            ),
        ),
    }
}

/// The photopeak of the radionuclide that the file names, keV.
fn photopeak_kev(a: &Attributes) -> f64 {
    let named = [NUCLIDE_MEANING, PHARMACEUTICAL_NAME].map(|attribute| a.prose(attribute));
    let named = named
        .into_iter()
        .flatten()
        .collect::<Vec<_>>()
        .join(" ")
        .to_lowercase();
    let found = PHOTOPEAKS_KEV.iter().find(|(word, _)| named.contains(word));
    found.map_or(TECHNETIUM_KEV, |(_, kev)| *kev)
}
