//! Whether a scan was made at rest or at stress, by the texts of its header.
//!
//! In: the texts that describe a scan, the most telling first. Out: `rest` or `stress` by the first text that names
//! exactly one of them. Steps:
//!
//! 1. A text is cut into runs of letters.
//! 2. A run is taken apart into the words of scans ([`REST`], [`STRESS`], [`BESIDE`]) from end to end, as in
//!    `STRESSGATED` or `restac`. Where that fails, it is cut where its case changes, as in `RestG` or `MIBIStressSA`,
//!    and each part is taken apart.
//! 3. What follows `pre`, `no` or `non` as a word of its own is not counted.
//!
//! A run that only contains the letters of such a word (`Forrest`, `arrest`, `interest`, `distress`, `prestress`) names
//! neither.

use ventriform_dicom::read::attributes::{
    Attributes, CONTEXT_MEANING, PROTOCOL_MEANING, PROTOCOL_NAME, SERIES_DESCRIPTION,
    STUDY_DESCRIPTION,
};

/// Words for rest.
const REST: [&str; 8] = [
    "rest", "resting", "rst", "ruhe", "repos", "reposo", "riposo", "repouso",
];
/// Words for stress.
const STRESS: [&str; 11] = [
    "stress",
    "str",
    "strs",
    "stressed",
    "exercise",
    "belastung",
    "effort",
    "esfuerzo",
    "sforzo",
    "esforco",
    "inspanning",
];
/// Words that stand beside them in descriptions of scans, and say nothing of this.
const BESIDE: [&str; 62] = [
    "g",
    "gated",
    "gate",
    "gtd",
    "ungated",
    "sum",
    "summed",
    "static",
    "ac",
    "nac",
    "nc",
    "ctac",
    "irac",
    "irnc",
    "irncg",
    "atten",
    "corr",
    "corrected",
    "sa",
    "sax",
    "vla",
    "hla",
    "short",
    "axis",
    "tomo",
    "spect",
    "pet",
    "mibi",
    "sestamibi",
    "tetro",
    "tetrofosmin",
    "myoview",
    "cardiolite",
    "tl",
    "thallium",
    "tc",
    "rb",
    "fdg",
    "myo",
    "mpi",
    "perf",
    "perfusion",
    "cardiac",
    "heart",
    "recon",
    "osem",
    "fbp",
    "em",
    "emission",
    "supine",
    "prone",
    "post",
    "dose",
    "low",
    "high",
    "day",
    "image",
    "images",
    "scan",
    "trans",
    "transaxial",
    "axial",
];
/// Words after which another one is not counted.
const WITHOUT: [&str; 4] = ["pre", "no", "non", "without"];
/// Longest run of letters that is taken apart.
const LONGEST_RUN: usize = 64;

/// `rest` or `stress` if exactly one of them is named, by the most telling attribute that names one. What is said of
/// the series goes before what is said of a protocol, which may name both scans of a study, and of the study.
pub(super) fn rest_or_stress(a: &Attributes) -> Option<String> {
    [
        CONTEXT_MEANING,
        SERIES_DESCRIPTION,
        PROTOCOL_MEANING,
        PROTOCOL_NAME,
        STUDY_DESCRIPTION,
    ]
    .into_iter()
    .find_map(|attribute| named(&a.prose(attribute)?))
    .map(str::to_owned)
}

/// `rest` or `stress` if `text` names exactly one of them.
fn named(text: &str) -> Option<&'static str> {
    let (mut rest, mut stress) = (false, false);
    let mut before = "";
    for run in text.split(|c: char| !c.is_alphabetic()) {
        if run.is_empty() {
            continue;
        }
        let counts = !WITHOUT.contains(&before.to_lowercase().as_str());
        if counts && run.len() <= LONGEST_RUN {
            let [at_rest, at_stress] = in_run(run);
            rest |= at_rest;
            stress |= at_stress;
        }
        before = run;
    }
    match (rest, stress) {
        (true, false) => Some("rest"),
        (false, true) => Some("stress"),
        _ => None,
    }
}

/// Whether a run of letters names rest, and stress.
fn in_run(run: &str) -> [bool; 2] {
    let whole = in_word(&run.to_lowercase());
    whole.unwrap_or_else(|| {
        let parts = by_case(run).into_iter();
        let parts = parts.filter_map(|part| in_word(&part.to_lowercase()));
        parts.fold([false; 2], |[a, b], [c, d]| [a || c, b || d])
    })
}

/// Whether `word`, in small letters, names rest, and stress; `None` where it is not made of known words from end to
/// end.
fn in_word(word: &str) -> Option<[bool; 2]> {
    // For each end in the word: what the known words up to there name, of the first way to take it apart.
    let mut ends: Vec<Option<[bool; 2]>> = vec![None; word.len() + 1];
    ends[0] = Some([false; 2]);
    for start in 0..word.len() {
        let (Some([rest, stress]), Some(left)) = (ends[start], word.get(start..)) else {
            continue;
        };
        let kinds: [(&[&str], [bool; 2]); 3] = [
            (&REST, [true, stress]),
            (&STRESS, [rest, true]),
            (&BESIDE, [rest, stress]),
        ];
        for (words, names) in kinds {
            for known in words.iter().filter(|known| left.starts_with(**known)) {
                ends[start + known.len()].get_or_insert(names);
            }
        }
    }
    ends[word.len()]
}

/// The parts of a run of letters: a capital after a small letter begins one, and the last of several capitals before a
/// small one.
fn by_case(run: &str) -> Vec<&str> {
    let letters: Vec<(usize, char)> = run.char_indices().collect();
    let mut parts = Vec::new();
    let mut start = 0;
    for (number, (at, letter)) in letters.iter().enumerate().skip(1) {
        let after_small = letters[number - 1].1.is_lowercase();
        let before_small = letters
            .get(number + 1)
            .is_some_and(|(_, c)| c.is_lowercase());
        if letter.is_uppercase() && (after_small || before_small) {
            parts.push(&run[start..*at]);
            start = *at;
        }
    }
    parts.push(&run[start..]);
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joined_words_name_the_scan() {
        let of_rest = [
            "rest",
            "REST",
            "RestG_SA",
            "rest_ac",
            "RestGatedSA",
            "RESTGATED",
            "restgsa",
            "RSTG",
            "gatedrest",
            "Tc99mRest",
            "1DayRest",
            "Myo Rest [AC]",
            "MIBI-Rest",
            "MIBIRest",
            "Resting",
            "IRNCGRest",
            "Ruhe",
            "RESTSA",
            "restSA",
            "REST1",
            "Rest_IRAC_SA",
            "pre-stress rest",
            "repos",
            "SARest",
        ];
        let of_stress = [
            "stress",
            "STRESSGATED",
            "StrsG",
            "Strs_G",
            "MIBI-Stress",
            "StressG_SA",
            "stressac",
            "STR",
            "StrAC",
            "gStress",
            "STRESSGated",
            "PostStress",
            "poststressgated",
            "GatedStressSA",
            "TETROStress",
            "Belastung",
            "EXERCISE2",
            "Stress (prone)",
            "stress_NAC",
        ];
        for (texts, scan) in [(&of_rest[..], "rest"), (&of_stress[..], "stress")] {
            for text in texts {
                assert_eq!(named(text), Some(scan), "{text}");
            }
        }
    }

    #[test]
    fn words_that_contain_the_letters_name_nothing() {
        for text in [
            "",
            "Forrest",
            "FORREST",
            "arrest",
            "interest",
            "Region of Interest",
            "distress",
            "prestress",
            "Everest",
            "crest",
            "restaurant",
            "restore",
            "stressor",
            "forest",
            "Dr. Forrest",
            "nearest neighbour",
            "wrest",
            "mistress",
            "unrest",
            "strong",
            "structural",
            "astrs",
            "armrest",
            "REST/STRESS",
            "RestStress",
            "rest and stress",
            "pre-stress",
            "no rest",
            "Belastungs-EKG und Ruhe und Belastung",
            "ſtreß",
            "\u{130}rest",
            "gé",
        ] {
            assert_eq!(named(text), None, "{text}");
        }
    }
}
