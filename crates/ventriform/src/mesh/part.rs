//! The parts of a ventricle's wall.

/// A part of the closed surface of a ventricle's wall.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Part {
    /// The inner surface, which faces the cavity.
    Endocardium,
    /// The outer surface.
    Epicardium,
    /// The rim at the base that joins both.
    Base,
}

impl Part {
    /// All parts, in the order of their numbers.
    pub const ALL: [Part; 3] = [Part::Endocardium, Part::Epicardium, Part::Base];

    /// Its number in files: 1, 2, 3.
    pub fn number(self) -> u8 {
        match self {
            Part::Endocardium => 1,
            Part::Epicardium => 2,
            Part::Base => 3,
        }
    }

    /// Its name in files, requests and commands.
    pub fn as_str(self) -> &'static str {
        match self {
            Part::Endocardium => "endocardium",
            Part::Epicardium => "epicardium",
            Part::Base => "base",
        }
    }

    /// The part with that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|part| part.as_str() == name)
    }

    /// The part with that number.
    pub fn numbered(number: u64) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|part| u64::from(part.number()) == number)
    }
}
