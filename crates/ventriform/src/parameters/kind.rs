//! The kinds of values that parameters take.

/// The kind of value that a parameter takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// A whole number in a range.
    Integer {
        /// Smallest value.
        min: u64,
        /// Largest value.
        max: u64,
    },
    /// A finite number in a range.
    Number {
        /// Smallest value.
        min: f64,
        /// Largest value.
        max: f64,
    },
    /// `true` or `false` (in JSON a boolean; on the command line the flag alone is `true`).
    Switch,
    /// One of the listed words.
    Choice(&'static [&'static str]),
    /// `count` whole numbers, separated by commas (in JSON also an array).
    Integers {
        /// Their number.
        count: usize,
    },
    /// `count` finite numbers, separated by commas (in JSON also an array).
    Numbers {
        /// Their number.
        count: usize,
    },
    /// Points: finite numbers separated by commas, three for each (in JSON also an array).
    Points {
        /// Most points.
        most: usize,
    },
    /// One of the listed words, or three finite numbers separated by commas (in JSON also an array).
    Direction(&'static [&'static str]),
    /// Text in a form of its own.
    Text {
        /// The form as a regular expression.
        pattern: &'static str,
        /// One example.
        example: &'static str,
    },
    /// The id of an object that the service stores. The command line takes files instead.
    Stored {
        /// The prefixes of ids of such objects.
        prefixes: &'static [&'static str],
        /// A word that is accepted instead of an id; empty if there is none.
        word: &'static str,
        /// Most ids that may follow the word, separated by commas; without a word, the first id.
        more: usize,
    },
}
