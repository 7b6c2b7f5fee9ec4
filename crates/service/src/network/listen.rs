//! The sockets on which the service waits for its clients.

use socket2::{Domain, Socket, Type};
use std::io;
use std::net::{SocketAddr, TcpListener};

/// Connections that the system completes before the service takes them; Linux allows at most `net.core.somaxconn`
/// (4096 by default). The standard library asks for 128: where hundreds of clients come at once, the system drops the
/// packets of the others, who ask again after 1, 3 and 7 s.
const BACKLOG: i32 = 4096;

/// Listens on `address`.
///
/// # Errors
/// If the system refuses the address.
pub fn listen(address: SocketAddr) -> io::Result<TcpListener> {
    let socket = Socket::new(Domain::for_address(address), Type::STREAM, None)?;
    // As the standard library does: a service that starts again takes its address from connections that are ending.
    #[cfg(unix)]
    socket.set_reuse_address(true)?;
    socket.bind(&address.into())?;
    socket.listen(BACKLOG)?;
    Ok(socket.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::TcpStream;
    use std::time::Duration;

    #[test]
    fn hundreds_who_come_at_once_need_not_ask_again() {
        let listener = listen("127.0.0.1:0".parse().unwrap()).unwrap();
        let address = listener.local_addr().unwrap();
        // Asked again, a client would wait for a second.
        let connect = |_| TcpStream::connect_timeout(&address, Duration::from_millis(900));
        let clients: Vec<_> = (0..400).map(connect).collect();
        assert!(clients.iter().all(Result::is_ok));
    }

    #[test]
    fn an_address_that_is_taken_is_refused() {
        let first = listen("127.0.0.1:0".parse().unwrap()).unwrap();
        let taken = listen(first.local_addr().unwrap());
        assert_eq!(taken.unwrap_err().kind(), io::ErrorKind::AddrInUse);
    }
}
