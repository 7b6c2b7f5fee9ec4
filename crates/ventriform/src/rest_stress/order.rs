//! The input of a comparison.

use crate::comparison::WhichScan;
use crate::normals::ScanKind;
use crate::parameters::ComparisonParameters;
use crate::segmentation::{NamedMesh, NormalsOrder};
use crate::volume::VolumeFile;

/// The files, models and parameters of a comparison.
#[derive(Debug, Clone)]
pub struct ComparisonOrder<'a> {
    /// The scan at stress.
    pub stress: ScanOrder<'a>,
    /// The scan at rest.
    pub rest: ScanOrder<'a>,
    /// Whether the built-in hearts are fitted.
    pub auto: bool,
    /// Further models to fit.
    pub models: Vec<NamedMesh>,
    /// Normal limits to score both scans by.
    pub normals: Option<ComparisonNormals>,
    /// The parameters.
    pub parameters: &'a ComparisonParameters,
}

/// The files of one scan: a volume, or gates.
pub type ScanOrder<'a> = &'a [VolumeFile];

/// Normal limits for a pair of scans.
#[derive(Debug, Clone)]
pub struct ComparisonNormals {
    /// For the scan at stress.
    pub stress: NormalsOrder,
    /// For the scan at rest.
    pub rest: NormalsOrder,
}

impl ComparisonNormals {
    /// The limits of `order` for both scans. `protocols` are those of stress and rest; where one is not stated, it is
    /// the only protocol of the limits whose name has the word `stress` or `rest` in it.
    pub fn new(order: &NormalsOrder, protocols: [Option<String>; 2]) -> Self {
        let [stress, rest] = protocols;
        let of = |scan: WhichScan, stated: Option<String>| NormalsOrder {
            limits: order.limits.clone(),
            kind: ScanKind {
                protocol: stated.or_else(|| only_protocol(order, scan)),
                ..order.kind.clone()
            },
        };
        Self {
            stress: of(WhichScan::Stress, stress),
            rest: of(WhichScan::Rest, rest),
        }
    }

    pub(super) fn of(&self, scan: WhichScan) -> &NormalsOrder {
        match scan {
            WhichScan::Stress => &self.stress,
            WhichScan::Rest => &self.rest,
        }
    }
}

fn only_protocol(order: &NormalsOrder, scan: WhichScan) -> Option<String> {
    let names_role = |protocol: &&String| {
        let mut words = protocol.split(|c: char| !c.is_alphanumeric());
        words.any(|word| word.eq_ignore_ascii_case(scan.as_str()))
    };
    let groups = order.limits.groups.iter().map(|group| &group.protocol);
    let mut named: Vec<&String> = groups.filter(names_role).collect();
    named.dedup();
    match named[..] {
        [only] => Some(only.clone()),
        _ => None,
    }
}
