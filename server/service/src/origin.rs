//! Who may use the service from a browser.
//!
//! A page of another site must not reach the service with its visitor's network position. Three
//! rules: a request that changes something or opens a viewer, and names an `Origin`, must come
//! from the service's own origin or a listed one; a service on a loopback address answers only to
//! names that cannot be made to point at it from outside (names of this machine, addresses, hosts
//! of listed origins); what a listed origin may read is said by CORS headers.

use std::net::IpAddr;
use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, Method, header, uri::Authority};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use crate::App;
use crate::problem::Fault;

/// Host and port of an origin (`https://example.org:8443`), `None` if it is not one.
pub(crate) fn host_of_origin(origin: &str) -> Option<Authority> {
    let rest = origin.strip_prefix("https://").or_else(|| origin.strip_prefix("http://"))?;
    let authority: Authority = rest.parse().ok()?;
    (!rest.contains('@') && !authority.host().is_empty()).then_some(authority)
}

/// Middleware: refuses foreign pages.
pub async fn guard(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    let allowed = &app.config().allowed_origins;
    let verdict = check(
        request.method(),
        request.headers(),
        request.uri().authority(),
        allowed,
        app.config().listen.ip().is_loopback(),
    );
    match verdict {
        Ok(()) => next.run(request).await,
        Err(reason) => Fault::forbidden(reason).into_response(),
    }
}

fn check(
    method: &Method,
    headers: &HeaderMap,
    uri_authority: Option<&Authority>,
    allowed_origins: &[String],
    loopback: bool,
) -> Result<(), String> {
    let host = headers
        .get(header::HOST)
        .and_then(|value| value.to_str().ok())
        .and_then(|value| value.parse::<Authority>().ok())
        .or_else(|| uri_authority.cloned());
    if let Some(host) = host.as_ref().filter(|_| loopback)
        && !is_local_name(host.host())
        && !allowed_origins
            .iter()
            .filter_map(|origin| host_of_origin(origin))
            .any(|known| known.host().eq_ignore_ascii_case(host.host()))
    {
        return Err(format!(
            "This service listens on this machine only and does not answer to the name `{}`; add its origin to `allowed_origins`.",
            host.host()
        ));
    }
    let upgrade = headers.contains_key(header::UPGRADE);
    let reads_only = matches!(*method, Method::GET | Method::HEAD | Method::OPTIONS) && !upgrade;
    let Some(origin) = headers.get(header::ORIGIN).filter(|_| !reads_only) else {
        return Ok(());
    };
    let origin = origin.to_str().unwrap_or("null");
    let own = host_of_origin(origin).zip(host).is_some_and(|(origin, host)| {
        origin.host().eq_ignore_ascii_case(host.host()) && origin.port_u16() == host.port_u16()
    });
    if own || allowed_origins.iter().any(|known| known == origin) {
        return Ok(());
    }
    Err(format!(
        "Pages of `{origin}` may not use this service; add the origin to `allowed_origins` if they should."
    ))
}

/// Names that always mean this machine, and addresses, which no name server can redirect.
fn is_local_name(host: &str) -> bool {
    let bare = host.trim_start_matches('[').trim_end_matches(']');
    let host = host.to_ascii_lowercase();
    host == "localhost" || host.ends_with(".localhost") || bare.parse::<IpAddr>().is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn verdict(method: Method, pairs: &[(&str, &str)], allowed: &[&str], loopback: bool) -> bool {
        let mut headers = HeaderMap::new();
        for (name, value) in pairs {
            let name: header::HeaderName = name.parse().unwrap();
            headers.insert(name, value.parse().unwrap());
        }
        let allowed: Vec<String> = allowed.iter().map(|&o| o.to_owned()).collect();
        check(&method, &headers, None, &allowed, loopback).is_ok()
    }

    #[test]
    fn own_pages_and_tools_may_write() {
        let host = ("host", "localhost:8080");
        assert!(verdict(Method::POST, &[host], &[], true), "no Origin: not a browser");
        assert!(verdict(Method::POST, &[host, ("origin", "http://localhost:8080")], &[], true));
        assert!(verdict(Method::PUT, &[("host", "[::1]:8080"), ("origin", "http://[::1]:8080")], &[], true));
    }

    #[test]
    fn foreign_pages_may_not() {
        let host = ("host", "localhost:8080");
        for origin in [
            "http://evil.org",
            "http://localhost:81",
            "null",
            "http://localhost:8080@evil.org",
            "https://localhost",
        ] {
            assert!(!verdict(Method::POST, &[host, ("origin", origin)], &[], true), "{origin}");
            let upgrade = ("upgrade", "websocket");
            assert!(!verdict(Method::GET, &[host, ("origin", origin), upgrade], &[], true), "{origin}");
        }
        assert!(verdict(Method::POST, &[host, ("origin", "https://ok.org")], &["https://ok.org"], true));
        assert!(!verdict(
            Method::POST,
            &[host, ("origin", "https://ok.org.evil.org")],
            &["https://ok.org"],
            true
        ));
    }

    #[test]
    fn a_loopback_service_answers_to_no_foreign_name() {
        assert!(!verdict(Method::GET, &[("host", "evil.org:8080")], &[], true));
        assert!(verdict(Method::GET, &[("host", "evil.org:8080")], &[], false));
        assert!(verdict(Method::GET, &[("host", "viz.org")], &["https://viz.org"], true));
        assert!(verdict(Method::GET, &[("host", "127.0.0.1:8080")], &[], true));
    }
}
