//! Who may open the page and the line.
//!
//! A page of another origin could reach a server on this computer. So the request's host must be the one that is served (which also
//! stops DNS rebinding), and a WebSocket's origin must be the page's own.

use std::net::{IpAddr, SocketAddr};

/// What a request must have.
#[derive(Clone, Debug)]
pub struct Access {
    address: SocketAddr,
    token: Option<String>,
}

impl Access {
    /// For the address that is served: a token, unless only this computer reaches it.
    ///
    /// # Errors
    /// The system has no random numbers.
    pub fn new(address: SocketAddr) -> Result<Self, getrandom::Error> {
        let token = if address.ip().is_loopback() {
            None
        } else {
            let mut bytes = [0; 16];
            getrandom::fill(&mut bytes)?;
            Some(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
        };
        Ok(Self { address, token })
    }

    /// The address of the page.
    #[must_use]
    pub fn url(&self, simulated: bool) -> String {
        let query = match (&self.token, simulated) {
            (Some(token), true) => format!("?token={token}&sim"),
            (Some(token), false) => format!("?token={token}"),
            (None, true) => "?sim".to_owned(),
            (None, false) => String::new(),
        };
        format!("http://{}/{query}", self.address)
    }

    /// Why a request is refused; `None`: it is not. `origin` is that of a WebSocket.
    #[must_use]
    pub fn refusal(
        &self,
        host: Option<&str>,
        origin: Option<&str>,
        token: Option<&str>,
    ) -> Option<&'static str> {
        let Some(host) = host.filter(|host| self.serves(host)) else {
            return Some("The host of the request is not the one that is served.");
        };
        if origin.is_some_and(|origin| origin.strip_prefix("http://") != Some(host)) {
            return Some("The page of the request is not the one that is served.");
        }
        if self.token.as_deref().is_some_and(|own| token != Some(own)) {
            return Some(
                "The token is missing or wrong: open the address that ddfeed has printed.",
            );
        }
        None
    }

    fn serves(&self, host: &str) -> bool {
        if host == format!("localhost:{}", self.address.port()) {
            return self.address.ip().is_loopback();
        }
        let Ok(asked) = host.parse::<SocketAddr>() else {
            return false;
        };
        let everywhere = |ip: IpAddr| ip.is_unspecified();
        asked.port() == self.address.port()
            && (asked.ip() == self.address.ip() || everywhere(self.address.ip()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn access(address: &str) -> Access {
        Access::new(address.parse().unwrap()).unwrap()
    }

    #[test]
    fn another_host_or_origin_is_refused() {
        let own = access("127.0.0.1:7475");
        let host = Some("127.0.0.1:7475");
        assert_eq!(own.refusal(host, None, None), None);
        assert_eq!(own.refusal(host, Some("http://127.0.0.1:7475"), None), None);
        assert_eq!(own.refusal(Some("localhost:7475"), None, None), None);
        for (host, origin) in [
            (None, None),
            (Some("127.0.0.1:80"), None),
            (Some("evil.example:7475"), None),
            (host, Some("http://evil.example")),
            (host, Some("http://localhost:7475")),
            (host, Some("null")),
        ] {
            assert!(
                own.refusal(host, origin, None).is_some(),
                "{host:?} {origin:?}"
            );
        }
    }

    #[test]
    fn a_server_for_others_takes_a_token() {
        let open = access("0.0.0.0:7475");
        let host = Some("192.168.1.7:7475");
        assert!(open.refusal(host, None, None).is_some());
        assert!(open.refusal(host, None, Some("")).is_some());
        let token = open.token.clone();
        assert_eq!(open.refusal(host, None, token.as_deref()), None);
        assert!(open.url(false).contains(&token.unwrap()));
    }
}
