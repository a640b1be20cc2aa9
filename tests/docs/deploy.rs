//! The files in `deploy/` fit the program.

use crate::support::{cager, metrics, repository, succeeds, text, words};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;

const STATEFUL_SET: &str = "deploy/kubernetes/statefulset.yaml";

/// Metrics as Prometheus has them: histograms in three parts.
fn stored() -> BTreeSet<String> {
    metrics()
        .into_iter()
        .flat_map(|name| ["", "_bucket", "_sum", "_count"].map(|part| format!("{name}{part}")))
        .collect()
}

#[test]
fn dashboard_and_alerts_use_metrics_that_exist() {
    let known = stored();
    for file in ["deploy/grafana/cager.json", "deploy/prometheus/alerts.yaml"] {
        let used = words(&text(file));
        assert!(used.len() > 8, "{file}: {used:?}");
        let unknown: BTreeSet<_> = used.difference(&known).collect();
        assert!(unknown.is_empty(), "{file}: {unknown:?}");
    }
}

#[test]
fn the_dashboard_shows_every_metric_in_panels_that_do_not_overlap() {
    let dashboard: Value = serde_json::from_str(&text("deploy/grafana/cager.json")).expect("JSON");
    let panels = dashboard["panels"].as_array().expect("panels");
    let expressions: String = panels
        .iter()
        .flat_map(|p| p["targets"].as_array().into_iter().flatten())
        .map(|t| t["expr"].to_string())
        .collect();
    let shown = words(&expressions);
    for metric in metrics() {
        assert!(shown.contains(&metric) || shown.contains(&format!("{metric}_bucket")), "{metric} is not shown");
    }
    let mut taken = BTreeSet::new();
    let mut ids = BTreeSet::new();
    for panel in panels {
        assert!(ids.insert(panel["id"].as_u64()), "{} is there twice", panel["id"]);
        let at = |key: &str| panel["gridPos"][key].as_u64().expect(key);
        assert!(at("x") + at("w") <= 24, "{}", panel["title"]);
        for (x, y) in (at("x")..at("x") + at("w")).flat_map(|x| (at("y")..at("y") + at("h")).map(move |y| (x, y))) {
            assert!(taken.insert((x, y)), "{} lies on another panel", panel["title"]);
        }
    }
}

#[test]
fn the_settings_of_the_manifests_are_settings() {
    let config = text("deploy/kubernetes/configmap.yaml");
    let config = config.split("cager.toml: |\n").nth(1).expect("a file of settings").replace("\n    ", "\n");
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("cager.toml");
    fs::write(&file, config.trim_start()).expect("a file");
    let shown = succeeds(cager().args(["serve", "--check-config", "--config"]).arg(&file));
    let shown = String::from_utf8(shown.stdout).expect("UTF-8");
    assert!(shown.contains("# file "), "{shown}");

    let keys: BTreeSet<String> = shown
        .lines()
        .filter_map(|line| line.trim_start_matches("# ").split(' ').next())
        .map(|key| format!("CAGER_{}", key.to_uppercase()))
        .collect();
    for file in ["Dockerfile", "deploy/compose.yaml", STATEFUL_SET] {
        let text: String =
            text(file).lines().filter(|line| !line.trim_start().starts_with('#')).map(|l| format!("{l}\n")).collect();
        let used: BTreeSet<&str> =
            text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').filter(|w| w.starts_with("CAGER_")).collect();
        assert!(used.len() > 2, "{file}: {used:?}");
        // The commit is an argument of the build.
        for name in used.into_iter().filter(|name| *name != "CAGER_COMMIT") {
            assert!(keys.contains(name), "{file}: {name} is no setting");
        }
    }
    let number = |text: &str, key: &str| -> u64 {
        let rest = text.split(key).nth(1).unwrap_or_else(|| panic!("{key} is missing"));
        let digits: String =
            rest.chars().skip_while(|c| !c.is_ascii_digit()).take_while(char::is_ascii_digit).collect();
        digits.parse().expect("a number")
    };
    let drain = number(&shown, "drain_timeout_s");
    // Streams end at once; after the drain time, cutting connections and leaving threads take three seconds at most.
    assert!(number(&text(STATEFUL_SET), "terminationGracePeriodSeconds:") >= drain + 5);
    let compose = text("deploy/compose.yaml");
    assert!(number(&compose, "stop_grace_period:") >= number(&compose, "CAGER_DRAIN_TIMEOUT_S:") + 5);
}

#[test]
fn the_manifests_allow_the_memory_that_their_settings_take() {
    let config = text("deploy/kubernetes/configmap.yaml");
    let config = config.split("cager.toml: |\n").nth(1).expect("a file of settings").replace("\n    ", "\n");
    let compose = text("deploy/compose.yaml");
    let of_compose: String = compose
        .lines()
        .filter_map(|line| line.trim().strip_prefix("CAGER_")?.split_once(": "))
        .map(|(key, value)| format!("{} = \"{}\"\n", key.to_lowercase(), value.trim_matches('"')))
        .collect();
    for (file, settings) in [(STATEFUL_SET, config.trim_start()), ("deploy/compose.yaml", &of_compose)] {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("cager.toml");
        fs::write(&path, settings).expect("a file");
        let flags = cager_service::config::ServeFlags::default();
        let config = cager_service::config::ServeConfig::load(Some(&path), std::iter::empty(), &flags).expect(file);
        let gib = |bytes: u64| bytes as f64 / (1u64 << 30) as f64;
        // The rows of the table in docs/OPERATIONS.md, for cages of 350 vertices and captures of 20,000 points.
        let coders = config.worker_threads().div_ceil(2).min(8) as f64;
        let recoveries = (4 + 2 * config.max_recoveries) as f64 * gib(24 * 20_000 * 350);
        let taken = config.max_preparing as f64 * gib(config.max_prepare_bytes)
            + gib(config.cache_bytes + config.shape_bytes)
            + gib(config.frame_bytes + config.upload_bytes + config.download_bytes)
            + config.max_designs as f64 * gib(2 * config.max_design_bytes + 240 * 1500 * 1500)
            + coders * (0.5 + 0.06)
            + recoveries
            + 0.5
            + 0.1;
        let limit: f64 = text(file)
            .lines()
            .filter_map(|line| line.trim().strip_prefix("memory: ")?.trim_end_matches(['G', 'i']).parse().ok())
            .fold(0.0, f64::max);
        assert!(taken < limit, "{file}: {taken} of {limit}");
        assert!(taken > 0.8 * limit, "{file}: {limit} GiB are much more than {taken}");
    }
}

#[test]
fn the_network_policy_lets_through_what_the_settings_may_name_and_keeps_metrics_apart() {
    let policy = text("deploy/kubernetes/networkpolicy.yaml");
    let (ingress, egress) = policy.split_once("\n  egress:\n").expect("rules for what goes out");
    for (what, port) in [("names", "53"), ("webhooks and the identity provider", "443"), ("traces", "4318")] {
        assert!(egress.contains(&format!("- port: {port}\n")), "{what}");
    }
    let rules: Vec<&str> = ingress.split("- from:").skip(1).collect();
    let [api, operators] = rules[..] else { panic!("{} rules", rules.len()) };
    assert!(api.contains("- port: http\n") && !api.contains("operators") && !api.contains("monitoring"), "{api}");
    assert!(operators.contains("- port: operators\n") && operators.contains("monitoring"), "{operators}");
    let scraped = text("deploy/kubernetes/servicemonitor.yaml");
    assert!(scraped.contains("- port: operators\n") && scraped.contains("path: /metrics"), "{scraped}");
    for (file, wanted) in
        [("service.yaml", "- name: operators\n      port: 8081"), ("statefulset.yaml", "containerPort: 8081")]
    {
        assert!(text(&format!("deploy/kubernetes/{file}")).contains(wanted), "{file}");
    }
    assert!(text(STATEFUL_SET).contains("CAGER_ADMIN_LISTEN\n              value: 0.0.0.0:8081"));
    assert!(text(STATEFUL_SET).contains("prometheus.io/port: \"8081\""));
}

#[test]
fn what_the_manifests_name_is_there_and_nothing_runs_as_root() {
    let folder = repository().join("deploy/kubernetes");
    let list = text("deploy/kubernetes/kustomization.yaml");
    let named: BTreeSet<&str> = list
        .lines()
        .filter_map(|line| line.trim().strip_prefix("- ").and_then(|line| line.strip_suffix(".yaml")))
        .collect();
    assert!(named.len() >= 6, "{named:?}");
    for name in named {
        assert!(folder.join(name).with_extension("yaml").exists(), "{name}.yaml");
    }
    for wanted in [
        "runAsNonRoot: true",
        "runAsUser: 65532",
        "fsGroup: 65532",
        "readOnlyRootFilesystem: true",
        "allowPrivilegeEscalation: false",
        "drop: [\"ALL\"]",
        "type: RuntimeDefault",
        "automountServiceAccountToken: false",
        "replicas: 1",
    ] {
        assert!(text(STATEFUL_SET).contains(wanted), "{wanted}");
    }
    for wanted in ["read_only: true", "no-new-privileges:true", "cap_drop:", "- ALL", "user: \"65532:65532\""] {
        assert!(text("deploy/compose.yaml").contains(wanted), "{wanted}");
    }
    for wanted in ["USER 65532:65532", "STOPSIGNAL SIGTERM", "VOLUME /data", "EXPOSE 8080", "--locked"] {
        assert!(text("Dockerfile").contains(wanted), "{wanted}");
    }
}
