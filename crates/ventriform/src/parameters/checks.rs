//! Tests that every table of parameters must pass.

use super::Parameters;
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
    let stated = P::SPECS.iter().filter(|spec| !spec.default.is_empty());
    let stated = P::from_pairs(stated.map(|spec| (spec.name, spec.default)));
    assert_eq!(stated.unwrap(), P::default());
}
