//! Foreign pages, wrong methods, oversized bodies, the page's own headers.

use axum::body::Body;
use axum::http::{Method, Request, StatusCode, header};
use tokio_tungstenite::tungstenite::client::IntoClientRequest;

use crate::support::{Service, small_scene};

fn request(method: Method, path: &str, host: &str, origin: Option<&str>) -> Request<Body> {
    let mut request = Request::builder().method(method).uri(path).header(header::HOST, host);
    if let Some(origin) = origin {
        request = request.header(header::ORIGIN, origin);
    }
    request.body(Body::from(serde_json::json!({"scene": small_scene()}).to_string())).unwrap()
}

#[tokio::test]
async fn foreign_pages_change_nothing() {
    let service = Service::with(|config| config.allowed_origins = vec!["https://lab.example".into()]);
    let host = "localhost:8080";
    for origin in ["http://evil.example", "null", "http://localhost:9999"] {
        let answer = service.send(request(Method::POST, "/api/v1/sessions", host, Some(origin))).await;
        assert_eq!(answer.problem(403).kind, "/problems/forbidden");
        let answer =
            service.send(request(Method::DELETE, "/api/v1/datasets/pillars", host, Some(origin))).await;
        answer.problem(403);
    }
    for origin in [None, Some("http://localhost:8080"), Some("https://lab.example")] {
        let answer = service.send(request(Method::POST, "/api/v1/sessions", host, origin)).await;
        assert_eq!(answer.status, StatusCode::CREATED, "{origin:?}");
    }
    let answer = service.send(request(Method::GET, "/api/v1/status", "rebound.example", None)).await;
    answer.problem(403);
    let answer = service.send(request(Method::GET, "/", "rebound.example", None)).await;
    answer.problem(403);
}

#[tokio::test]
async fn listed_origins_may_read_answers() {
    let service = Service::with(|config| config.allowed_origins = vec!["https://lab.example".into()]);
    let allowed = |origin: &'static str| {
        let request = request(Method::GET, "/api/v1/status", "localhost", Some(origin));
        async { service.send(request).await.headers.get(header::ACCESS_CONTROL_ALLOW_ORIGIN).cloned() }
    };
    assert_eq!(allowed("https://lab.example").await.unwrap(), "https://lab.example");
    assert_eq!(allowed("https://evil.example").await, None);
}

#[tokio::test]
async fn foreign_pages_open_no_viewer() {
    let service = Service::new();
    let session = service.session().await;
    let listening = service.listen().await;
    let connect = |origin: Option<String>| {
        let mut request = listening.view_url(&session.id).into_client_request().unwrap();
        if let Some(origin) = origin {
            request.headers_mut().insert("origin", origin.parse().unwrap());
        }
        tokio_tungstenite::connect_async(request)
    };
    let refused = connect(Some("http://evil.example".into())).await;
    match refused {
        Err(tokio_tungstenite::tungstenite::Error::Http(response)) => assert_eq!(response.status(), 403),
        other => panic!("{other:?}"),
    }
    assert!(connect(Some(format!("http://{}", listening.address))).await.is_ok());
    assert!(connect(None).await.is_ok());
}

#[tokio::test]
async fn unknown_addresses_and_methods_are_problems() {
    let service = Service::new();
    service.get("/nothing").await.problem(404);
    service.get("/../../etc/passwd").await.problem(404);
    let answer = service.json(Method::PUT, "/status", serde_json::json!({})).await;
    answer.problem(405);
    assert!(answer.headers.contains_key(header::ALLOW));
    let old = Request::get("/api/v0/status").body(Body::empty()).unwrap();
    service.send(old).await.problem(404);
    service.get("/sessions/x/view").await.problem(400);
}

#[tokio::test]
async fn json_bodies_are_bounded() {
    let service = Service::with(|config| config.limits.max_json_bytes = 100);
    let long = Request::post("/api/v1/sessions").body(Body::from(vec![b' '; 101])).unwrap();
    let problem = service.send(long).await.problem(413);
    assert!(problem.detail.contains("max_json_bytes"));
}

#[tokio::test]
async fn too_many_requests_at_once_are_asked_to_wait() {
    let service = Service::with(|config| config.limits.max_requests = 1);
    let (sender, receiver) = tokio::sync::oneshot::channel::<()>();
    let held = futures_util::stream::once(async {
        drop(receiver.await);
        Ok::<_, std::io::Error>(axum::body::Bytes::new())
    });
    let slow = service.put("/datasets/a.nrrd", Body::from_stream(held));
    let other = async {
        // The first request is polled first and waits for its body.
        let answer = service.get("/status").await;
        drop(sender);
        answer
    };
    let (slow, other) = tokio::join!(slow, other);
    slow.problem(422);
    other.problem(503);
    assert!(other.headers.contains_key(header::RETRY_AFTER));
}

#[tokio::test]
async fn the_page_is_served_with_its_headers() {
    let service = Service::new();
    for path in ["/", "/index.html", "/some/place"] {
        let answer = service.send(Request::get(path).body(Body::empty()).unwrap()).await;
        assert_eq!(answer.status, StatusCode::OK, "{path}");
        assert_eq!(answer.headers[header::CONTENT_TYPE], "text/html; charset=utf-8");
        assert_eq!(answer.headers[header::CACHE_CONTROL], "no-cache");
        assert_eq!(answer.headers[header::X_CONTENT_TYPE_OPTIONS], "nosniff");
        let policy = answer.headers[header::CONTENT_SECURITY_POLICY].to_str().unwrap();
        assert!(policy.contains("default-src 'self'") && policy.contains("frame-ancestors 'none'"));
        assert!(answer.headers.contains_key("x-request-id"));
        let known = Request::get(path).header(header::IF_NONE_MATCH, answer.headers[header::ETAG].clone());
        let known = service.send(known.body(Body::empty()).unwrap()).await;
        assert_eq!(known.status, StatusCode::NOT_MODIFIED);
    }
    let missing = service.send(Request::get("/assets/none.js").body(Body::empty()).unwrap()).await;
    assert_eq!(missing.status, StatusCode::NOT_FOUND);
    let written = service.send(Request::post("/").body(Body::empty()).unwrap()).await;
    assert_eq!(written.status, StatusCode::METHOD_NOT_ALLOWED);
}
