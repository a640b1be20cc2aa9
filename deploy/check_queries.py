"""Parses every query of the alerts and the dashboard. Needs promql-parser and PyYAML; `make lint-deploy` brings them."""

import json
import pathlib
import re

import promql_parser
import yaml

deploy = pathlib.Path(__file__).parent
alerts = yaml.safe_load((deploy / "prometheus/alerts.yaml").read_text())
queries = [rule["expr"] for group in alerts["groups"] for rule in group["rules"]]
dashboard = json.loads((deploy / "grafana/cager.json").read_text())
queries += [target["expr"] for panel in dashboard["panels"] for target in panel.get("targets", [])]
for query in queries:
    # What Grafana puts in itself.
    promql_parser.parse(re.sub(r"\$__rate_interval", "1m", query).replace("$instance", ".*"))
print(f"{len(queries)} queries can be parsed")

# Rows of the document whose last column says what to be alarmed by.
rows = [line.split("|") for line in (deploy.parent / "docs/OPERATIONS.md").read_text().splitlines()]
alarming = [row[1].strip("` ") for row in rows if len(row) == 6 and row[1].startswith(" `cager_") and row[4].strip()]
rules = " ".join(rule["expr"] for group in alerts["groups"] for rule in group["rules"])
missing = [metric for metric in alarming if metric not in rules]
assert alarming and not missing, f"{missing} of docs/OPERATIONS.md have no alert in deploy/prometheus/alerts.yaml"
