//! `/`: a page for people who open the service in a browser.

use axum::response::Html;

/// The page. It has no parts elsewhere.
pub(crate) async fn page() -> Html<&'static str> {
    Html(include_str!("viewer.html"))
}
