//! One association, from the connection to its end (PS3.8, 9.2).
//!
//! Everything waits for a limited time only: the request for the association, each PDU, and the whole.
//! Where the caller breaks the protocol or a limit, the association is aborted; where it asks for what
//! is not served, it is told so by a status and may go on.

use super::command::{Command, LONGEST_COMMAND, Operation, status};
use super::negotiate::{
    APPLICATION_CONTEXT, Context, Contexts, VERIFICATION_CLASS, longest_of, negotiate,
};
use super::observer::AssociationEnd;
use super::receive::{Incoming, ReceiveError, Stated};
use super::record::{Origin, Protocol};
use super::senders::AeTitle;
use super::service::{Place, Service};
use super::session::Session;
use super::wire::{Wire, WireError};
use crate::base::records::Tenant;
use crate::callers::{Activity, Agent, AuditEvent, Outcome};
use dicom_ul::pdu::{
    AbortRQServiceProviderReason as AbortReason, AbortRQSource, AssociationRJ, AssociationRJResult,
    AssociationRJServiceProviderASCEReason, AssociationRJServiceProviderPresentationReason,
    AssociationRJServiceUserReason, AssociationRJSource, AssociationRQ, PDataValue, PDataValueType,
    Pdu,
};
use std::net::IpAddr;
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::time::{Instant, timeout, timeout_at};
use tokio_util::sync::CancellationToken;
use ventriform::results::export::dicom::file_start;

/// Longest time until the association is requested, after PS3.8's timer ARTIM.
pub const REQUEST_WAIT: Duration = Duration::from_secs(10);
/// Longest time for the last PDU to be sent.
const LAST_WRITE: Duration = Duration::from_secs(5);
/// Shortest P-DATA-TF PDU in which a response is sent, whatever the caller says.
const SHORTEST_REQUEST_BYTES: usize = 64;
/// Bytes of a P-DATA-TF PDU beside the value.
const VALUE_HEADER: usize = 6;

/// A connection.
pub struct Connection<S> {
    /// The bytes.
    pub stream: S,
    /// The other end.
    pub peer: IpAddr,
    /// Cancelled when another connection takes its place before it has requested an association.
    pub displaced: CancellationToken,
}

/// Why an association ends without being released.
enum Break {
    /// The caller aborted, or the connection failed.
    Broken,
    /// The caller broke the protocol.
    Violation(AbortReason),
    /// A limit was exceeded.
    Exceeded(&'static str),
    /// The service shuts down.
    Shutdown,
}

impl Break {
    fn end(&self) -> AssociationEnd {
        match self {
            Self::Broken => AssociationEnd::Broken,
            Self::Violation(_) => AssociationEnd::Violation,
            Self::Exceeded(_) => AssociationEnd::Exceeded,
            Self::Shutdown => AssociationEnd::Shutdown,
        }
    }

    /// The abort that tells the caller.
    fn abort(&self) -> Option<Pdu> {
        let source = match self {
            Self::Broken => return None,
            Self::Violation(reason) => AbortRQSource::ServiceProvider(reason.clone()),
            Self::Exceeded(_) => AbortRQSource::ServiceProvider(AbortReason::ReasonNotSpecified),
            Self::Shutdown => AbortRQSource::ServiceUser,
        };
        Some(Pdu::AbortRQ { source })
    }
}

impl From<WireError> for Break {
    fn from(error: WireError) -> Self {
        match error {
            WireError::Closed | WireError::Failed(_) => Self::Broken,
            WireError::Unrecognised(_) => Self::Violation(AbortReason::UnrecognizedPdu),
            WireError::TooLong { .. } | WireError::TooMany { .. } | WireError::Malformed(_) => {
                Self::Violation(AbortReason::InvalidPduParameter)
            }
        }
    }
}

/// Serves a connection to its end. Calls `requested` once it has requested an association.
pub async fn serve<S>(service: &Service, connection: Connection<S>, requested: impl FnOnce())
where
    S: AsyncRead + AsyncWrite + Unpin + Send,
{
    let peer = connection.peer;
    let mut wire = Wire::new(connection.stream, service.offer.longest);
    let request = tokio::select! {
        read = timeout(REQUEST_WAIT, wire.read()) => read,
        () = connection.displaced.cancelled() => {
            return service.observer.ended(AssociationEnd::Exceeded, false);
        }
        () = service.closing.cancelled() => {
            return service.observer.ended(AssociationEnd::Shutdown, false);
        }
    };
    requested();
    let request = match request {
        Ok(Ok(Pdu::AssociationRQ(request))) => Ok(request),
        Ok(Ok(Pdu::AbortRQ { .. })) => Err(Break::Broken),
        Ok(Ok(_)) => Err(Break::Violation(AbortReason::UnexpectedPdu)),
        Ok(Err(error)) => Err(error.into()),
        Err(_) => Err(Break::Exceeded("no association was requested in time")),
    };
    let (end, accepted, last) = match request {
        Err(broken) => (broken.end(), false, broken.abort()),
        Ok(request) => match admit(service, &request, peer).await {
            Err(rejection) => (AssociationEnd::Rejected, false, Some(rejection)),
            Ok((origin, place)) => {
                let (end, last) = associate(service, &mut wire, request, origin).await;
                drop(place);
                (end, true, last)
            }
        },
    };
    if let Some(last) = last {
        let _ = timeout(LAST_WRITE, wire.write(&last)).await;
    }
    service.observer.ended(end, accepted);
    if end != AssociationEnd::Broken {
        wire.close().await;
    }
}

fn reject(result: AssociationRJResult, source: AssociationRJSource) -> Pdu {
    Pdu::AssociationRJ(AssociationRJ { result, source })
}

/// Whose objects the caller sends, and its place among the open associations; or the rejection.
async fn admit<'a>(
    service: &'a Service,
    request: &AssociationRQ,
    peer: IpAddr,
) -> Result<(Origin, Place<'a>), Pdu> {
    use AssociationRJResult::{Permanent, Transient};
    use AssociationRJServiceUserReason as User;
    let user = |reason| reject(Permanent, AssociationRJSource::ServiceUser(reason));
    if request.protocol_version & 1 == 0 {
        let reason = AssociationRJServiceProviderASCEReason::ProtocolVersionNotSupported;
        return Err(reject(
            Permanent,
            AssociationRJSource::ServiceProviderASCE(reason),
        ));
    }
    if request.application_context_name.trim_end_matches('\0') != APPLICATION_CONTEXT {
        return Err(user(User::ApplicationContextNameNotSupported));
    }
    let called = AeTitle::of_pdu(&request.called_ae_title);
    if called.as_ref() != Ok(&service.settings.ae_title) {
        tracing::info!(%peer, "an association for another AE title was rejected");
        return Err(user(User::CalledAETitleNotRecognized));
    }
    let calling = AeTitle::of_pdu(&request.calling_ae_title).ok();
    let tenant = calling
        .as_ref()
        .and_then(|calling| service.settings.senders.tenant_of(calling, peer));
    let (Some(calling), Some(tenant)) = (calling, tenant) else {
        tracing::warn!(%peer, "an association of an unknown sender was rejected");
        let now = service.clock.now();
        // The title of a stranger may be any text, so it is not recorded.
        let mut event = AuditEvent::new(
            now,
            Activity::SignInRefused,
            Tenant::default(),
            "unknown".into(),
        );
        event.outcome = Outcome::Refused;
        event.address = Some(peer.to_string());
        service.recorder.note(event).await;
        return Err(user(User::CallingAETitleNotRecognized));
    };
    let Some(place) = service.places.take(peer) else {
        tracing::warn!(%peer, "an association was rejected: too many are open");
        let reason = AssociationRJServiceProviderPresentationReason::LocalLimitExceeded;
        return Err(reject(
            Transient,
            AssociationRJSource::ServiceProviderPresentation(reason),
        ));
    };
    let origin = Origin {
        tenant,
        protocol: Protocol::CStore,
        sender: calling.as_str().to_owned(),
        address: peer.to_string(),
    };
    Ok((origin, place))
}

/// Serves an accepted association to its end. Returns how it ended, and what the caller is to be told.
async fn associate<S>(
    service: &Service,
    wire: &mut Wire<S>,
    request: AssociationRQ,
    origin: Origin,
) -> (AssociationEnd, Option<Pdu>)
where
    S: AsyncRead + AsyncWrite + Unpin + Send,
{
    let deadline = Instant::now() + service.settings.time_limit;
    let (answer, contexts) = negotiate(&request, &service.offer);
    let accept = Pdu::AssociationAC(answer);
    service.observer.associated();
    let theirs = longest_of(&request).and_then(|length| usize::try_from(length).ok());
    // An association may last long, and this is not needed any more.
    drop(request);
    let mut association = Association {
        service,
        wire,
        contexts,
        portion: theirs.map_or(usize::MAX, |length| {
            length.max(SHORTEST_REQUEST_BYTES) - VALUE_HEADER
        }),
        session: service.sessions.begin(),
        by: Agent::new(
            service.recorder.clone(),
            service.clock.clone(),
            origin.tenant.clone(),
            origin.sender.clone(),
        )
        .at(&origin.address),
        origin,
        command: (0, Vec::new()),
        message: None,
    };
    let served = tokio::select! {
        served = timeout_at(deadline, association.run(accept)) => served,
        () = service.ending.cancelled() => Ok(Err(Break::Shutdown)),
    };
    let broken = match served {
        Ok(Ok(())) => {
            association.session.release();
            return (AssociationEnd::Released, Some(Pdu::ReleaseRP));
        }
        Ok(Err(broken)) => broken,
        Err(_) => Break::Exceeded("it lasted for too long"),
    };
    if let Break::Exceeded(what) = broken {
        tracing::warn!(
            sender = association.origin.sender,
            "an association was aborted: {what}"
        );
    }
    (broken.end(), broken.abort())
}

/// An accepted association.
struct Association<'a, S> {
    service: &'a Service,
    wire: &'a mut Wire<S>,
    contexts: Contexts,
    /// Bytes of one value that is sent.
    portion: usize,
    session: Session,
    /// The sender, in the audit trail.
    by: Agent,
    origin: Origin,
    /// The part of a command that has come, and its context.
    command: (u8, Vec<u8>),
    /// The message whose data set is coming.
    message: Option<Message>,
}

/// A message whose data set is coming.
struct Message {
    context: u8,
    command: Command,
    target: Target,
}

/// Where the data set of a message goes.
enum Target {
    /// Into a file.
    Object(Incoming),
    /// Nowhere: it was refused.
    Refused(ReceiveError),
    /// Nowhere: the message is not served, for this status.
    Ignored(u16),
}

impl<S: AsyncRead + AsyncWrite + Unpin + Send> Association<'_, S> {
    /// Accepts the association and serves it until it is to be released.
    async fn run(&mut self, accept: Pdu) -> Result<(), Break> {
        self.write(&accept).await?;
        drop(accept);
        loop {
            match self.read().await? {
                Pdu::PData { data } => {
                    for value in data {
                        self.take(value).await?;
                    }
                }
                Pdu::ReleaseRQ if self.is_between_messages() => return Ok(()),
                Pdu::AbortRQ { .. } => return Err(Break::Broken),
                _ => return Err(Break::Violation(AbortReason::UnexpectedPdu)),
            }
            if self.wire.received() > self.service.settings.association_bytes {
                return Err(Break::Exceeded("it sent too much"));
            }
        }
    }

    fn is_between_messages(&self) -> bool {
        self.message.is_none() && self.command.1.is_empty()
    }

    async fn read(&mut self) -> Result<Pdu, Break> {
        let closing = self.service.closing.clone();
        let idle = self.is_between_messages();
        tokio::select! {
            read = timeout(self.service.settings.idle, self.wire.read()) => match read {
                Ok(read) => Ok(read?),
                Err(_) => Err(Break::Exceeded("it was idle for too long")),
            },
            // A message that has begun is served to its end.
            () = closing.cancelled(), if idle => Err(Break::Shutdown),
        }
    }

    async fn write(&mut self, pdu: &Pdu) -> Result<(), Break> {
        match timeout(self.service.settings.idle, self.wire.write(pdu)).await {
            Ok(written) => Ok(written?),
            Err(_) => Err(Break::Exceeded("it did not read what was sent")),
        }
    }

    /// Takes a part of a message.
    async fn take(&mut self, value: PDataValue) -> Result<(), Break> {
        let violation = |reason| Err(Break::Violation(reason));
        let id = value.presentation_context_id;
        if !self.contexts.contains_key(&id) {
            return violation(AbortReason::InvalidPduParameter);
        }
        match value.value_type {
            PDataValueType::Command => {
                let (context, command) = &mut self.command;
                if self.message.is_some() || (!command.is_empty() && *context != id) {
                    return violation(AbortReason::UnexpectedPduParameter);
                }
                *context = id;
                command.extend_from_slice(&value.data);
                if command.len() > LONGEST_COMMAND {
                    return violation(AbortReason::InvalidPduParameter);
                }
                if value.is_last {
                    self.begin(id).await
                } else {
                    Ok(())
                }
            }
            PDataValueType::Data => {
                let Some(message) = self.message.as_mut().filter(|m| m.context == id) else {
                    return violation(AbortReason::UnexpectedPduParameter);
                };
                if let Target::Object(object) = &mut message.target
                    && let Err(error) = object.write(&value.data).await
                {
                    // The rest is read and thrown away, so that the caller can be told.
                    message.target = Target::Refused(error);
                }
                match (value.is_last, self.message.take()) {
                    (true, Some(message)) => self.end(message).await,
                    (_, message) => {
                        self.message = message;
                        Ok(())
                    }
                }
            }
        }
    }

    /// Begins the message whose command is complete.
    async fn begin(&mut self, id: u8) -> Result<(), Break> {
        let bytes = std::mem::take(&mut self.command.1);
        let (Some(command), Some(context)) = (Command::read(&bytes), self.contexts.get(&id)) else {
            return Err(Break::Violation(AbortReason::InvalidPduParameter));
        };
        let target = match (command.operation(), command.has_data_set) {
            (Operation::Cancel, false) => return Ok(()),
            (Operation::Echo, false) if context.class == VERIFICATION_CLASS => {
                Target::Ignored(status::SUCCESS)
            }
            (Operation::Store, true) => target(self.service, &command, context).await,
            (Operation::Store, false) => Target::Ignored(status::MISTYPED_ARGUMENT),
            _ => Target::Ignored(status::UNRECOGNISED_OPERATION),
        };
        let follows = command.has_data_set;
        let message = Message {
            context: id,
            command,
            target,
        };
        if follows {
            self.message = Some(message);
            Ok(())
        } else {
            self.end(message).await
        }
    }

    /// Ends a message whose data set, if it has one, is complete: answers it.
    async fn end(&mut self, message: Message) -> Result<(), Break> {
        let Message {
            context,
            command,
            target,
        } = message;
        let outcome = match target {
            Target::Ignored(status) => {
                return self.respond(context, command.response(status, None)).await;
            }
            Target::Refused(error) => {
                let receiver = &self.service.receiver;
                receiver.note(Protocol::CStore, &Err(&error), 0);
                Err(error)
            }
            Target::Object(object) => self.store(object, &command).await,
        };
        let response = match outcome {
            Ok(()) => command.response(status::SUCCESS, None),
            Err(error) => {
                tracing::warn!(
                    sender = self.origin.sender,
                    status = format!("{:04X}H", error.status()),
                    "an object was refused: {}",
                    error.comment()
                );
                command.response(error.status(), Some(error.comment()))
            }
        };
        self.respond(context, response).await
    }

    async fn store(&mut self, object: Incoming, command: &Command) -> Result<(), ReceiveError> {
        let class = command.sop_class.as_deref().unwrap_or_default();
        let instance = command.sop_instance.as_deref().unwrap_or_default();
        let stated = Stated {
            object: Some((class, instance)),
            study: None,
        };
        let receiver = &self.service.receiver;
        let stored = receiver.store(&self.by, object, stated, &self.origin, &mut self.session);
        stored.await.map_err(|refused| refused.error)?;
        Ok(())
    }

    /// Sends a command set.
    async fn respond(&mut self, context: u8, set: Vec<u8>) -> Result<(), Break> {
        let portions: Vec<&[u8]> = set.chunks(self.portion).collect();
        for (number, portion) in portions.iter().enumerate() {
            let value = PDataValue {
                presentation_context_id: context,
                value_type: PDataValueType::Command,
                is_last: number + 1 == portions.len(),
                data: portion.to_vec(),
            };
            self.write(&Pdu::PData { data: vec![value] }).await?;
        }
        Ok(())
    }
}

/// Where the object of a C-STORE goes.
async fn target(service: &Service, command: &Command, context: &Context) -> Target {
    let (Some(class), Some(instance)) = (&command.sop_class, &command.sop_instance) else {
        return Target::Ignored(status::MISTYPED_ARGUMENT);
    };
    if *class != context.class {
        return Target::Ignored(status::CLASS_NOT_SUPPORTED);
    }
    let Ok(start) = file_start(class, instance, &context.transfer_syntax) else {
        return Target::Ignored(status::MISTYPED_ARGUMENT);
    };
    let begun = async {
        let mut object = service.receiver.begin().await?;
        object.write(&start).await?;
        Ok(object)
    };
    match begun.await {
        Ok(object) => Target::Object(object),
        Err(error) => Target::Refused(error),
    }
}
