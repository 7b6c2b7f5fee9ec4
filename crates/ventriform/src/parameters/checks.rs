//! Tests that every table of parameters must pass.

use super::with_fit::{BesideFit, WithFit};
use super::{FIT_SPECS, Parameters};
use std::fmt::Debug;

/// Checks that parameters read from each of `lists` are the same after writing and reading them.
pub(super) fn read_back_unchanged<P: Parameters + PartialEq + Debug>(lists: &[&[(&str, &str)]]) {
    for list in lists {
        let parameters = P::from_pairs(list.iter().copied()).unwrap();
        let written = parameters.to_json();
        assert_eq!(P::from_json(&written).unwrap(), parameters);
        for (name, _) in *list {
            assert!(written.contains_key(*name), "{name}");
        }
    }
}

/// Checks that the defaults in the table are those of the code.
pub(super) fn table_states_defaults<P: Parameters + PartialEq + Debug + Default>() {
    let stated = P::PARAMETER_SPECS
        .iter()
        .filter(|spec| !spec.default.is_empty());
    let stated = P::from_pairs(stated.map(|spec| (spec.name, spec.default)));
    assert_eq!(stated.unwrap(), P::default());
}

/// Checks that parameters of a fit that the work has no use for are refused by their name with the reason, and are not
/// written.
pub(super) fn refuses_what_it_has_no_use_for<C: BesideFit + Debug>() {
    let written = WithFit::<C>::default().to_json();
    for (name, why) in C::WITHOUT_USE {
        assert!(FIT_SPECS.iter().any(|spec| spec.name == *name), "{name}");
        assert!(!written.contains_key(*name), "{name}");
        let refused = WithFit::<C>::from_pairs([(*name, "1")]).unwrap_err();
        assert_eq!(refused.field, *name);
        assert!(refused.message.contains(why), "{refused}");
    }
}
