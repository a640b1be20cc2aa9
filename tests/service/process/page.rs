//! The page and its files, with the viewer or, where Node was missing, without.

use crate::support::TestApp;

#[tokio::test]
async fn the_page_is_served_under_a_strict_policy_and_its_files_are_kept_for_ever() {
    let app = TestApp::start();
    let page = app.get("/").await.expect(200);
    assert!(page.header("content-type").starts_with("text/html"));
    let policy = page.header("content-security-policy");
    assert!(policy.starts_with("default-src 'none'; script-src 'self';") && !policy.contains("unsafe"), "{policy}");
    let html = page.text();
    // No request to any other host, no script or style within.
    assert!(!html.contains("http://") && !html.contains("https://") && !html.contains("<style"), "{html}");
    let names = html.split('"').filter(|part| part.starts_with("./assets/")).map(|part| &part[1..]);
    let mut names: Vec<&str> = names.collect();
    if names.is_empty() {
        assert!(html.contains("make web"), "a page without the viewer says how to get it: {html}");
        return;
    }
    names.push("/cager-viewer.js");
    for name in names {
        let file = app.get(name).await.expect(200);
        let is_hashed = name.starts_with("/assets/");
        assert_eq!(file.header("cache-control").contains("immutable"), is_hashed, "{name}");
        assert_eq!(file.header("x-content-type-options"), "nosniff");
        let tag = file.header("etag").to_owned();
        let again = app.get_with(name, &[("if-none-match", &tag)]).await.expect(304);
        assert!(again.body.is_empty() && again.header("etag") == tag);
        app.get_with(name, &[("if-none-match", "\"another\"")]).await.expect(200);
    }
}

#[tokio::test]
async fn files_that_the_page_does_not_have_are_not_found() {
    let app = TestApp::start();
    for path in ["/assets/none.js", "/assets/..%2findex.html", "/assets/%2e%2e%2f%2e%2e%2fCargo.toml", "/assets/"] {
        app.get(path).await.problem(404, "not-found");
    }
}
