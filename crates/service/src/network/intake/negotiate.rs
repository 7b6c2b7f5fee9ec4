//! Which presentation contexts of an association are accepted (PS3.8, 9.3.3).

use super::senders::AeTitle;
use dicom_ul::pdu::{
    AssociationAC, AssociationRQ, PresentationContextResult, PresentationContextResultReason,
    UserVariableItem,
};
use std::collections::BTreeMap;

/// Verification SOP Class.
pub const VERIFICATION_CLASS: &str = "1.2.840.10008.1.1";
/// DICOM Application Context.
pub const APPLICATION_CONTEXT: &str = "1.2.840.10008.3.1.1.1";

const IMPLICIT_LITTLE: &str = "1.2.840.10008.1.2";
const EXPLICIT_LITTLE: &str = "1.2.840.10008.1.2.1";

/// The offer of this side.
#[derive(Debug, Clone)]
pub struct Offer {
    /// SOP classes of objects that are stored.
    pub classes: Vec<String>,
    /// Transfer syntaxes of their data sets.
    pub transfer_syntaxes: Vec<&'static str>,
    /// Longest P-DATA-TF PDU that is read.
    pub longest: u32,
}

/// An accepted context.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Context {
    /// Its abstract syntax: a SOP class.
    pub class: String,
    /// The transfer syntax of its data sets.
    pub transfer_syntax: String,
}

/// The accepted contexts by their ids.
pub type Contexts = BTreeMap<u8, Context>;

/// Accepts what can be accepted; also returns the answer to the request.
pub fn negotiate(request: &AssociationRQ, offer: &Offer) -> (AssociationAC, Contexts) {
    use PresentationContextResultReason as Reason;
    let mut contexts = Contexts::new();
    let mut results = Vec::with_capacity(request.presentation_contexts.len());
    for proposed in &request.presentation_contexts {
        let class = proposed.abstract_syntax.trim_end_matches(['\0', ' ']);
        let syntaxes: &[&str] = match class {
            VERIFICATION_CLASS => &[IMPLICIT_LITTLE, EXPLICIT_LITTLE],
            class if offer.classes.iter().any(|own| own == class) => &offer.transfer_syntaxes,
            _ => &[],
        };
        let offered = proposed.transfer_syntaxes.iter();
        let mut offered = offered.map(|syntax| syntax.trim_end_matches(['\0', ' ']));
        // The caller names first what it likes best.
        let chosen = offered.find(|syntax| syntaxes.contains(syntax));
        let reason = match chosen {
            // Ids are odd, and each is used once.
            _ if proposed.id % 2 == 0 || contexts.contains_key(&proposed.id) => Reason::NoReason,
            Some(_) => Reason::Acceptance,
            None if syntaxes.is_empty() => Reason::AbstractSyntaxNotSupported,
            None => Reason::TransferSyntaxesNotSupported,
        };
        if reason == Reason::Acceptance {
            let context = Context {
                class: class.to_owned(),
                transfer_syntax: chosen.unwrap_or_default().to_owned(),
            };
            contexts.insert(proposed.id, context);
        }
        results.push(PresentationContextResult {
            id: proposed.id,
            reason,
            // Not significant if the context is rejected.
            transfer_syntax: chosen.unwrap_or(IMPLICIT_LITTLE).to_owned(),
        });
    }
    let answer = AssociationAC {
        protocol_version: 1,
        calling_ae_title: echo(&request.calling_ae_title),
        called_ae_title: echo(&request.called_ae_title),
        application_context_name: APPLICATION_CONTEXT.to_owned(),
        presentation_contexts: results,
        user_variables: vec![
            UserVariableItem::MaxLength(offer.longest),
            UserVariableItem::ImplementationClassUID(
                ventriform::results::export::dicom::IMPLEMENTATION_CLASS_UID.into(),
            ),
            UserVariableItem::ImplementationVersionName(
                ventriform::results::export::dicom::IMPLEMENTATION_NAME.into(),
            ),
        ],
    };
    (answer, contexts)
}

/// A title as it is sent back: without what cannot be written.
fn echo(title: &str) -> String {
    AeTitle::of_pdu(title).map_or_else(|_| title.to_owned(), String::from)
}

/// Longest P-DATA-TF PDU that the other side reads; `None` if any.
pub fn longest_of(request: &AssociationRQ) -> Option<u32> {
    let mut variables = request.user_variables.iter();
    variables.find_map(|variable| match variable {
        UserVariableItem::MaxLength(length) => Some(*length).filter(|length| *length > 0),
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use dicom_ul::pdu::PresentationContextProposed;

    #[test]
    fn each_context_is_judged_by_itself() {
        let proposed = |id, class: &str, syntaxes: &[&str]| PresentationContextProposed {
            id,
            abstract_syntax: class.into(),
            transfer_syntaxes: syntaxes.iter().map(|s| (*s).into()).collect(),
        };
        let offer = Offer {
            classes: vec!["1.2.3".into()],
            transfer_syntaxes: vec![IMPLICIT_LITTLE, EXPLICIT_LITTLE, "1.9"],
            longest: 4096,
        };
        let request = AssociationRQ {
            protocol_version: 1,
            calling_ae_title: "A".into(),
            called_ae_title: "B".into(),
            application_context_name: APPLICATION_CONTEXT.into(),
            presentation_contexts: vec![
                proposed(1, VERIFICATION_CLASS, &["1.9", IMPLICIT_LITTLE]),
                proposed(3, "1.2.3\0", &["1.8", "1.9", EXPLICIT_LITTLE]),
                proposed(5, "1.2.3", &["1.8"]),
                proposed(7, "1.2.4", &[IMPLICIT_LITTLE]),
                proposed(1, "1.2.3", &[IMPLICIT_LITTLE]),
                proposed(8, "1.2.3", &[IMPLICIT_LITTLE]),
            ],
            user_variables: vec![UserVariableItem::MaxLength(0)],
        };
        let (answer, contexts) = negotiate(&request, &offer);
        let reasons = answer.presentation_contexts.iter();
        let reasons: Vec<u8> = reasons.map(|result| result.reason.clone() as u8).collect();
        assert_eq!(reasons, [0, 0, 4, 3, 2, 2]);
        assert_eq!(contexts.keys().copied().collect::<Vec<_>>(), [1, 3]);
        assert_eq!(contexts[&3].transfer_syntax, "1.9");
        assert_eq!(contexts[&3].class, "1.2.3");
        assert_eq!(longest_of(&request), None);
    }
}
