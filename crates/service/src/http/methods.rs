//! Which methods an address takes, for those who ask by another.

use super::router::document;
use std::collections::BTreeMap;
use std::sync::LazyLock;

/// Methods of routes, as the document has them.
static METHODS: LazyLock<BTreeMap<String, String>> = LazyLock::new(|| {
    let document = document();
    let paths = document["paths"].as_object().into_iter().flatten();
    let named = |method: &String| if method == "get" { "GET, HEAD".to_owned() } else { method.to_uppercase() };
    let methods = |item: &serde_json::Value| {
        item.as_object().map(|item| item.keys().map(named).collect::<Vec<_>>().join(", ")).unwrap_or_default()
    };
    paths.map(|(path, item)| (path.clone(), methods(item))).collect()
});

/// What is said of a method that a route does not take.
pub(super) fn refusal(route: Option<&str>) -> String {
    match route.and_then(|route| METHODS.get(route)) {
        Some(methods) => format!("this address takes {methods}"),
        None => "the header Allow has the methods of this address".to_owned(),
    }
}
