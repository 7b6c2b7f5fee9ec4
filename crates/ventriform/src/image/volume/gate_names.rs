//! What the names of files say of the volumes in them.
//!
//! In: the names of files of one volume each. Out: that they are gates, that they are something else, or nothing. Only
//! words count that stand beside a number or a name by which the files differ: `gate_3.nii`, `sub-07.nii.gz`. A word
//! for people or reconstructions goes before a word for gates.

/// Words for a gate, whose number tells which.
const GATES: [&str; 14] = [
    "gate",
    "gates",
    "gated",
    "bin",
    "bins",
    "phase",
    "phases",
    "frame",
    "slot",
    "timeslot",
    "time",
    "timepoint",
    "cycle",
    "moment",
];

/// Words for what is not one scan: people, visits, reconstructions of a scan.
const OTHERS: [&str; 35] = [
    "sub",
    "subj",
    "subject",
    "case",
    "pat",
    "patient",
    "person",
    "participant",
    "volunteer",
    "id",
    "pid",
    "mrn",
    "ses",
    "session",
    "visit",
    "exam",
    "study",
    "scan",
    "recon",
    "reconstruction",
    "iter",
    "iters",
    "iteration",
    "iterations",
    "subset",
    "subsets",
    "filter",
    "filtered",
    "fwhm",
    "sigma",
    "cutoff",
    "phantom",
    "heart",
    "template",
    "fold",
];

/// Endings of the names of volumes.
const ENDINGS: [&str; 4] = ["gz", "nii", "hdr", "img"];

/// What names say.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum NamesSay {
    /// The files are gates.
    Gates,
    /// The files are no gates, by this word.
    Others(&'static str),
    /// Neither.
    Nothing,
}

/// What the `names` of files of one volume each say.
pub fn said_by_names(names: &[&str]) -> NamesSay {
    let parts: Vec<Vec<Vec<String>>> = names.iter().map(|name| parts(name)).collect();
    let differ = |word: &str| {
        let mut values: Vec<_> = parts.iter().filter_map(|name| value(name, word)).collect();
        values.sort_unstable();
        values.dedup();
        values.len()
    };
    if let Some(word) = OTHERS.iter().find(|word| differ(word) > 1) {
        return NamesSay::Others(word);
    }
    let numbered = |word: &&&str| {
        let numbers = parts.iter().map(|name| {
            let value = value(name, word)?;
            let end = value.find(|c: char| !c.is_ascii_digit());
            value[..end.unwrap_or(value.len())].parse::<u64>().ok()
        });
        let Some(mut numbers) = numbers.collect::<Option<Vec<u64>>>() else {
            return false;
        };
        numbers.sort_unstable();
        numbers.windows(2).all(|two| two[0] < two[1])
    };
    match names.len() > 1 && GATES.iter().any(|word| numbered(&word)) {
        true => NamesSay::Gates,
        false => NamesSay::Nothing,
    }
}

/// The parts of a name between other characters than letters and digits, each as letters and digits in turn, in lower
/// case.
fn parts(name: &str) -> Vec<Vec<String>> {
    let lower = name.to_lowercase();
    let mut parts: Vec<&str> = lower.split(|c: char| !c.is_alphanumeric()).collect();
    parts.retain(|part| !part.is_empty());
    while parts.last().is_some_and(|part| ENDINGS.contains(part)) {
        parts.pop();
    }
    let runs = |part: &&str| {
        let mut runs: Vec<String> = Vec::new();
        let mut digits = None;
        for c in part.chars() {
            match runs.last_mut() {
                Some(run) if digits == Some(c.is_ascii_digit()) => run.push(c),
                _ => runs.push(c.to_string()),
            }
            digits = Some(c.is_ascii_digit());
        }
        runs
    };
    parts.iter().map(runs).collect()
}

/// What stands beside `word` in a name: the rest of its part, or the next part, or the number before it.
fn value(parts: &[Vec<String>], word: &str) -> Option<String> {
    let (at, runs) =
        { parts.iter().enumerate() }.find(|(_, runs)| runs.iter().any(|run| run == word))?;
    let place = runs.iter().position(|run| run == word)?;
    let rest = runs[place + 1..].concat();
    if !rest.is_empty() {
        return Some(rest);
    }
    let is_number = |text: &String| text.starts_with(|c: char| c.is_ascii_digit());
    // The number of a gate is none of the scan that it belongs to (heart_gate1.nii).
    let of_gate = |part: &&Vec<String>| part.iter().any(|run| GATES.contains(&run.as_str()));
    let next = parts.get(at + 1).filter(|part| !of_gate(part));
    let next = next.map(|part| part.concat());
    let before = match place.checked_sub(1) {
        Some(before) => Some(runs[before].clone()),
        None => at.checked_sub(1).map(|before| parts[before].concat()),
    };
    match (next, before.filter(is_number)) {
        (Some(next), before) if is_number(&next) || before.is_none() => Some(next),
        (_, before) => before,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(name: impl Fn(usize) -> String) -> NamesSay {
        let names: Vec<String> = (1..=8).map(name).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        said_by_names(&names)
    }

    #[test]
    fn words_beside_a_number_tell_gates_from_other_volumes() {
        for word in GATES {
            for at in 0..6 {
                let name = |n: usize| match at {
                    0 => format!("{word}{n}.nii.gz"),
                    1 => format!("stress-{word}_{n:02}.nii"),
                    2 => format!("P7 {n} {}.nii", word.to_uppercase()),
                    3 => format!("heart_{word}{n}.nii"),
                    4 => format!("patient {word} {n}.nii"),
                    _ => format!("patient_12_{word}-{n}of8.nii"),
                };
                assert_eq!(said(name), NamesSay::Gates, "{}", name(1));
            }
        }
        for word in OTHERS {
            for at in 0..4 {
                let name = |n: usize| match at {
                    0 => format!("{word}{n}.nii.gz"),
                    1 => format!("{word}-{n:03}_0000.nii.gz"),
                    2 => format!("{n:03}_{word}.nii"),
                    _ => format!("{word}_A{n}_gate{n}.nii"),
                };
                assert_eq!(said(name), NamesSay::Others(word), "{}", name(1));
            }
        }
    }

    #[test]
    fn other_names_say_nothing() {
        let names: [fn(usize) -> String; 6] = [
            |n| format!("{n}.nii"),
            |n| format!("g{n}.nii"),
            |n| format!("image_{n}.nii"),
            |n| format!("gate_{}.nii", n % 4),
            |n| format!("invigate{}", "x".repeat(n)),
            |_| "spect.nii.gz".into(),
        ];
        for name in names {
            assert_eq!(said(name), NamesSay::Nothing, "{}", name(1));
        }
        assert_eq!(said_by_names(&["gate1.nii"]), NamesSay::Nothing);
        assert_eq!(said_by_names(&[]), NamesSay::Nothing);
    }
}
