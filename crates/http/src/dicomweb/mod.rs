//! What other systems send by DICOMweb: objects (STOW-RS) and work items (UPS-RS).

pub(crate) mod intake_status;
pub(crate) mod stow;
pub(crate) mod workitems;
