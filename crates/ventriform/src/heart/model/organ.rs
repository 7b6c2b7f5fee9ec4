//! The organs that models are made of.

/// The organ that a model shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Organ {
    /// The wall of the left ventricle: a cup, searched in the volume without hints.
    LeftVentricle,
    /// A liver: one bright body.
    Liver,
    /// A kidney: one bright body.
    Kidney,
    /// Any other closed surface: one bright body.
    Generic,
}

impl Organ {
    /// Every organ.
    pub const ALL: [Organ; 4] = [
        Organ::LeftVentricle,
        Organ::Liver,
        Organ::Kidney,
        Organ::Generic,
    ];

    /// The organ with this [`Organ::as_str`].
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|organ| organ.as_str() == name)
    }

    /// The name in parameters and reports.
    pub fn as_str(self) -> &'static str {
        match self {
            Organ::LeftVentricle => "left_ventricle",
            Organ::Liver => "liver",
            Organ::Kidney => "kidney",
            Organ::Generic => "generic",
        }
    }
}
