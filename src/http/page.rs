//! `/`: a page for people who open the service in a browser.

use axum::response::Html;

/// The page. It has no parts elsewhere.
#[utoipa::path(
    get, path = "/", operation_id = "get_page", tag = "operation", security(()),
    responses((status = 200, description = "The page", content_type = "text/html", body = String)),
)]
pub(crate) async fn page() -> Html<&'static str> {
    Html(include_str!("viewer.html"))
}
