//! The web side: a page to look at, previews, metrics, JSON. It changes nothing, so everything is a GET.

mod access;
mod metrics;
mod page;
mod preview;

use crate::grpc::Token;
use crate::hub::Hub;
use crate::{convert, ids::JobId};
use access::Access;
use axum::extract::{Path, Request, State};
use axum::http::{StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{Html, IntoResponse, Response};
use axum::routing::get;
use axum::{Json, Router};
use preview::Previews;
use std::sync::Arc;
use uuid::Uuid;

/// Jobs shown, the newest first.
const MAX_JOBS: usize = 200;
/// Nothing on the page comes from elsewhere, and nothing runs.
const POLICY: &str = "default-src 'none'; img-src 'self'; style-src 'unsafe-inline'";

/// What the handlers share.
pub struct Web {
    hub: Arc<Hub>,
    previews: Previews,
    access: Access,
}

/// The routes; all but the health check ask for the token, if there is one.
pub fn router(hub: &Arc<Hub>, token: Option<Token>) -> Router {
    let web = Arc::new(Web { hub: hub.clone(), previews: Previews::default(), access: Access::new(token) });
    Router::new()
        .route("/", get(page))
        .route("/metrics", get(metrics))
        .route("/api/jobs", get(api_jobs))
        .route("/api/workers", get(api_workers))
        .route("/jobs/{id}/preview.png", get(preview))
        .route_layer(middleware::from_fn_with_state(web.clone(), guard))
        .route("/healthz", get(|| async { "ok\n" }))
        .with_state(web)
}

async fn guard(State(web): State<Arc<Web>>, request: Request, next: Next) -> Response {
    if web.access.admits(request.headers(), request.uri()) {
        return next.run(request).await;
    }
    let realm = (header::WWW_AUTHENTICATE, "Basic realm=\"lightfarm (any user, the token as password)\"");
    (StatusCode::UNAUTHORIZED, [realm], "this farm asks for its token\n").into_response()
}

/// Jobs and workers as the clients see them.
fn statuses(hub: &Hub) -> (Vec<proto::JobStatus>, Vec<proto::WorkerStatus>) {
    hub.with(|farm, now| {
        let mut jobs: Vec<_> = farm.jobs().values().collect();
        jobs.sort_by_key(|j| std::cmp::Reverse(j.order));
        let jobs = jobs.into_iter().take(MAX_JOBS).map(|j| convert::status(farm, j, now)).collect();
        (jobs, convert::workers(farm, now))
    })
}

async fn page(State(web): State<Arc<Web>>, request: Request) -> Response {
    let (jobs, workers) = statuses(&web.hub);
    let html = page::render(&jobs, &workers, request.uri().query().unwrap_or_default());
    ([(header::CONTENT_SECURITY_POLICY, POLICY)], Html(html)).into_response()
}

async fn metrics(State(web): State<Arc<Web>>) -> Response {
    let text = metrics::render(&web.hub);
    ([(header::CONTENT_TYPE, "text/plain; version=0.0.4; charset=utf-8")], text).into_response()
}

async fn api_jobs(State(web): State<Arc<Web>>) -> Json<serde_json::Value> {
    Json(statuses(&web.hub).0.iter().map(proto::json::job).collect())
}

async fn api_workers(State(web): State<Arc<Web>>) -> Json<serde_json::Value> {
    Json(statuses(&web.hub).1.iter().map(proto::json::worker).collect())
}

async fn preview(State(web): State<Arc<Web>>, Path(id): Path<String>) -> Response {
    let Ok(id) = Uuid::parse_str(&id).map(JobId) else {
        return (StatusCode::NOT_FOUND, "not the id of a job\n").into_response();
    };
    match web.previews.get(&web.hub, id).await {
        Ok(png) => ([(header::CONTENT_TYPE, "image/png"), (header::CACHE_CONTROL, "no-cache")], png).into_response(),
        Err(why) => (StatusCode::NOT_FOUND, format!("{why}\n")).into_response(),
    }
}

#[cfg(test)]
mod tests;
