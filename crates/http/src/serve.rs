//! The HTTP interface on a service, served until the service shuts down.

use super::app::App;
use super::router::router;
use crate::edge::connections::tls::Tls;
use crate::edge::connections::{self, ConnectionLimits, Linger};
use crate::edge::guard::hosts::HostPolicy;
use crate::edge::guard::state::Guard;
use std::io;
use std::net::TcpListener;
use std::sync::Arc;
use tokio::task::JoinHandle;
use ventriform_service::config::Settings;
use ventriform_service::run::start::Entrance;
use ventriform_service::use_cases::service::Service;

/// Serves the service on a bound listener to those whom `entrance` admits, over TLS if `tls` says how. The task ends
/// after the service has begun to shut down.
///
/// # Errors
/// If the system refuses the socket.
pub fn serve(
    service: &Arc<Service>,
    listener: TcpListener,
    entrance: Entrance,
    tls: Option<Arc<Tls>>,
) -> io::Result<JoinHandle<()>> {
    let settings = service.settings();
    let hosts = HostPolicy {
        names: settings.hosts.clone(),
        origins: settings.cors_origins.clone(),
        loopback: entrance.loopback,
        open: entrance.open,
    };
    let guard = Guard::new(
        entrance.gate,
        hosts,
        settings.auth_failure_limit,
        !entrance.loopback,
    );
    listener.set_nonblocking(true)?;
    let listener = tokio::net::TcpListener::from_std(listener)?;
    let open = service.request_metrics().connections.clone();
    let router = router(App::new(service.clone(), guard));
    let (limits, closing) = (connection_limits(settings), service.closing().clone());
    let server = connections::serve(listener, router, tls, limits, open, closing);
    Ok(tokio::spawn(server))
}

fn connection_limits(settings: &Settings) -> ConnectionLimits {
    ConnectionLimits {
        connections: settings.connection_limit,
        of_one_client: settings.client_connection_limit,
        trusted_proxies: settings.trusted_proxies.clone(),
        base_path: settings.base_path.clone(),
        head: settings.header_timeout.0,
        idle: settings.keep_alive_timeout.0,
        write: settings.write_timeout.0,
        linger: Linger {
            total: settings.linger_time.0,
            pause: settings.linger_pause.0,
            bytes: settings.linger_bytes.0,
        },
        grace: settings.shutdown_grace.0,
    }
}
