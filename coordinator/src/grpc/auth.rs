//! Who may call: the shared token and the protocol's version, checked before every call.

use proto::connect::PROTOCOL_KEY;
use std::fmt;
use tonic::service::Interceptor;
use tonic::{Request, Status};

/// The shared secret, kept as a hash: comparing hashes takes the same time whatever the guess.
#[derive(Clone)]
pub struct Token(blake3::Hash);

impl Token {
    /// Of a token's text.
    pub fn new(text: &str) -> Self {
        Self(blake3::hash(text.as_bytes()))
    }

    /// Whether a guess is right. (`blake3::Hash` compares in constant time.)
    pub fn admits(&self, guess: &[u8]) -> bool {
        self.0 == blake3::hash(guess)
    }
}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token")
    }
}

/// Stands before every service.
#[derive(Clone, Debug)]
pub struct Guard {
    token: Option<Token>,
}

impl Guard {
    /// With the token that calls need, if any.
    pub fn new(token: Option<Token>) -> Self {
        Self { token }
    }
}

impl Interceptor for Guard {
    fn call(&mut self, request: Request<()>) -> Result<Request<()>, Status> {
        let header = |key: &str| request.metadata().get(key).and_then(|v| v.to_str().ok());
        if let Some(token) = &self.token {
            let given = header("authorization").and_then(|v| v.strip_prefix("Bearer "));
            if !given.is_some_and(|g| token.admits(g.as_bytes())) {
                return Err(Status::unauthenticated(match given {
                    None => "this coordinator asks for a token: give --token or set LIGHTFARM_TOKEN",
                    Some(_) => "the token is not that of this coordinator",
                }));
            }
        }
        let version = header(PROTOCOL_KEY).unwrap_or("none");
        if version != proto::PROTOCOL.to_string() {
            return Err(Status::failed_precondition(format!(
                "the coordinator speaks protocol {}, the caller {version}; use the same version of lightfarm on both sides",
                proto::PROTOCOL
            )));
        }
        Ok(request)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::connect::Credentials;

    #[test]
    fn only_the_right_token_and_version_pass() {
        let call = |guard: Option<&str>, caller: Option<&str>| {
            let mut credentials = Credentials::new(caller).unwrap();
            let request = credentials.call(Request::new(())).unwrap();
            Guard::new(guard.map(Token::new)).call(request).map(drop).map_err(|s| s.code())
        };
        use tonic::Code::Unauthenticated;
        assert_eq!(call(None, None), Ok(()));
        assert_eq!(call(None, Some("x")), Ok(()));
        assert_eq!(call(Some("secret"), Some("secret")), Ok(()));
        assert_eq!(call(Some("secret"), Some("Secret")), Err(Unauthenticated));
        assert_eq!(call(Some("secret"), None), Err(Unauthenticated));
        let old = Guard::new(None).call(Request::new(())).unwrap_err();
        assert_eq!(old.code(), tonic::Code::FailedPrecondition);
        assert!(old.message().contains(&proto::PROTOCOL.to_string()) && old.message().contains("none"));
    }
}
