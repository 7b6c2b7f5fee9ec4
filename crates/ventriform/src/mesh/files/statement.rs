//! Unit and frame of a mesh, and what a caller states of them.

/// A unit of length.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MeshUnit {
    /// Millimetres.
    Millimetre,
    /// Centimetres.
    Centimetre,
    /// Metres.
    Metre,
}

impl MeshUnit {
    /// All units.
    pub const ALL: [MeshUnit; 3] = [MeshUnit::Millimetre, MeshUnit::Centimetre, MeshUnit::Metre];

    /// Millimetres per unit.
    pub fn in_millimetres(self) -> f64 {
        match self {
            MeshUnit::Millimetre => 1.0,
            MeshUnit::Centimetre => 10.0,
            MeshUnit::Metre => 1000.0,
        }
    }

    /// The symbol: `mm`, `cm`, `m`.
    pub fn as_str(self) -> &'static str {
        match self {
            MeshUnit::Millimetre => "mm",
            MeshUnit::Centimetre => "cm",
            MeshUnit::Metre => "m",
        }
    }

    /// The unit with that symbol.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|unit| unit.as_str() == name)
    }
}

/// Which way the axes of a mesh point in the patient.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MeshFrame {
    /// x to the left, y to posterior, z to superior: DICOM's.
    Lps,
    /// x to the right, y to anterior, z to superior: NIfTI's.
    Ras,
}

impl MeshFrame {
    /// Both frames.
    pub const ALL: [MeshFrame; 2] = [MeshFrame::Lps, MeshFrame::Ras];

    /// The name: `lps`, `ras`.
    pub fn as_str(self) -> &'static str {
        match self {
            MeshFrame::Lps => "lps",
            MeshFrame::Ras => "ras",
        }
    }

    /// The frame with that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|frame| frame.as_str() == name)
    }
}

/// The caller's statements about a mesh. A file that says otherwise is refused.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct MeshStatement {
    /// Its unit. Default: what the file says, or millimetres (of glTF metres) if the size is that of an organ.
    pub unit: Option<MeshUnit>,
    /// Its frame. Default: what the file says, or LPS (of glTF Y up).
    pub frame: Option<MeshFrame>,
}
