//! The routes over a real socket, spoken by hand.

use crate::{Config, Coordinator};
use std::net::SocketAddr;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

async fn get(address: SocketAddr, path: &str, header: &str) -> (u16, String) {
    let mut stream = TcpStream::connect(address).await.unwrap();
    let request = format!("GET {path} HTTP/1.1\r\nhost: x\r\nconnection: close\r\n{header}\r\n");
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).await.unwrap();
    let text = String::from_utf8_lossy(&answer).into_owned();
    let status = text.split(' ').nth(1).and_then(|s| s.parse().ok()).expect("a status");
    (status, text)
}

#[tokio::test]
async fn the_page_and_the_metrics_are_served_to_those_who_may_see_them() {
    let folder = tempfile::tempdir().unwrap();
    let mut config = Config::new("127.0.0.1:0".parse().unwrap(), folder.path().to_path_buf());
    config.http = Some("127.0.0.1:0".parse().unwrap());
    config.token = Some("secret".into());
    let coordinator = Coordinator::bind(&config).await.unwrap();
    let address = coordinator.http_address().unwrap();
    let (end, ended) = tokio::sync::oneshot::channel::<()>();
    let served = tokio::spawn(coordinator.serve(async move { drop(ended.await) }));

    let (status, text) = get(address, "/healthz", "").await;
    assert!(status == 200 && text.ends_with("ok\n"));
    for path in ["/", "/metrics", "/api/jobs", "/api/workers", "/jobs/x/preview.png", "/?token=wrong"] {
        let (status, text) = get(address, path, "").await;
        assert_eq!(status, 401, "{path}: {text}");
        assert!(text.to_lowercase().contains("www-authenticate"));
    }
    let bearer = "authorization: Bearer secret\r\n";
    let (status, text) = get(address, "/?token=secret", "").await;
    assert!(status == 200 && text.contains("<h1>lightfarm</h1>"), "{text}");
    let (status, text) = get(address, "/metrics", bearer).await;
    assert!(status == 200 && text.contains("\nlightfarm_jobs{state=\"active\"} 0\n"), "{text}");
    // Every line is a comment or a name with a number.
    for line in text.split("\r\n\r\n").nth(1).unwrap().lines().filter(|l| l.starts_with("lightfarm")) {
        assert!(line.rsplit(' ').next().unwrap().parse::<f64>().is_ok(), "{line}");
    }
    let (status, text) = get(address, "/api/jobs", bearer).await;
    assert!(status == 200 && text.ends_with("[]"), "{text}");
    assert_eq!(get(address, "/jobs/nonsense/preview.png", bearer).await.0, 404);
    assert_eq!(get(address, "/jobs/00000000-0000-0000-0000-000000000001/preview.png", bearer).await.0, 404);
    assert_eq!(get(address, "/nowhere", bearer).await.0, 404);
    end.send(()).unwrap();
    served.await.unwrap().unwrap();
}
