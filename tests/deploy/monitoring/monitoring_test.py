#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""deploy/monitoring: what it names is exported; $RIGCAL_BUILD_DIR names the build."""
import json
import os
import pathlib
import re
import subprocess
import tempfile
import time
import unittest
import urllib.request

FOLDER = pathlib.Path(__file__).resolve().parents[3] / "deploy" / "monitoring"
BIN = pathlib.Path(os.environ["RIGCAL_BUILD_DIR"]) / "bin"
# Of a series that Prometheus itself makes for each scrape.
MADE_BY_PROMETHEUS = {"up"}
LONGEST_WAIT_S = 60


def expressions_of_alerts():
    text = (FOLDER / "alerts.yml").read_text()
    return re.findall(r"^\s+expr: (.+)$", text, re.MULTILINE)


def expressions_of_dashboard():
    dashboard = json.loads((FOLDER / "dashboard.json").read_text())
    return ([target["expr"] for panel in dashboard["panels"] for target in panel["targets"]] +
            [re.search(r"label_values\((\w+),", variable["query"]["query"])[1]
             for variable in dashboard["templating"]["list"] if variable["type"] == "query"])


def metrics_in(expression):
    """Names of metrics and, for each, the labels and values that select its series."""
    found = []
    for name, selectors in re.findall(r"\b((?:rigcal|process)_\w+|up)\b(?:\{([^}]*)\})?", expression):
        found.append((name, re.findall(r'(\w+)(=~|=)"([^"]*)"', selectors or "")))
    return found


class ScrapedServer:
    """A server with one agent, whose spool is on the disk."""

    def __enter__(self):
        self.folder = tempfile.TemporaryDirectory()
        root = pathlib.Path(self.folder.name)
        ports = [root / "port", root / "http_port"]
        self.processes = [subprocess.Popen(
            [BIN / "rigcal-server", "--listen", "127.0.0.1:0", "--data-dir", root / "data",
             "--port-file", ports[0], "--http-port-file", ports[1]], stderr=subprocess.DEVNULL)]
        self.wait(lambda: all(port.exists() and port.read_text().strip() for port in ports), "the server's ports")
        self.port, self.http_port = (int(port.read_text()) for port in ports)
        self.processes.append(subprocess.Popen(
            [BIN / "rigcal-agent", "--server", f"127.0.0.1:{self.port}", "--state-dir", root / "agent",
             "--agent-id", "pc", "--source", "sim:camera=0"], stderr=subprocess.DEVNULL))
        self.wait(lambda: "rigcal_agent_spool_bytes{" in self.scrape(), "the agent's spool in the metrics")
        return self

    def __exit__(self, *error):
        for process in reversed(self.processes):
            process.terminate()
            process.wait(LONGEST_WAIT_S)
        self.folder.cleanup()

    def scrape(self):
        with urllib.request.urlopen(f"http://127.0.0.1:{self.http_port}/metrics", timeout=10) as answer:
            return answer.read().decode()

    @staticmethod
    def wait(condition, what):
        deadline = time.monotonic() + LONGEST_WAIT_S
        while not condition():
            if time.monotonic() > deadline:
                raise AssertionError(f"{what} did not come within {LONGEST_WAIT_S} s")
            time.sleep(0.05)


class MonitoringTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        with ScrapedServer() as server:
            cls.series = {}
            for name, labels in re.findall(r"^(\w+)(?:\{([^}]*)\})? \S+$", server.scrape(), re.MULTILINE):
                cls.series.setdefault(name, []).append(dict(re.findall(r'(\w+)="([^"]*)"', labels)))

    def check(self, expression):
        metrics = metrics_in(expression)
        self.assertTrue(metrics, f"{expression} names no metric")
        for name, selectors in metrics:
            if name in MADE_BY_PROMETHEUS:
                continue
            self.assertIn(name, self.series, f"{expression}: a running server exports no {name}")
            for label, operator, value in selectors:
                # The address of the server, which the scrape adds.
                if label == "instance":
                    continue
                self.assertEqual(operator, "=~")
                for alternative in value.split("|"):
                    self.assertIn(alternative, [each.get(label) for each in self.series[name]], expression)

    def check_labels_in_texts(self, expressions, texts):
        known = {label for expression in expressions for name, _ in metrics_in(expression)
                 for each in self.series.get(name, []) for label in each}
        for label in re.findall(r"\$labels\.(\w+)|\{\{(\w+)\}\}", texts):
            self.assertIn("".join(label), known | {"instance"})

    def test_alerts_are_about_what_a_server_exports(self):
        expressions = expressions_of_alerts()
        text = (FOLDER / "alerts.yml").read_text()
        self.assertEqual(len(expressions), text.count("- alert:"))
        for expression in expressions:
            self.check(expression)
        self.check_labels_in_texts(expressions, text)

    def test_dashboard_shows_what_a_server_exports(self):
        expressions = expressions_of_dashboard()
        self.assertGreater(len(expressions), 10)
        for expression in expressions:
            self.check(expression)
        self.check_labels_in_texts(expressions, (FOLDER / "dashboard.json").read_text())

    def test_panels_of_the_dashboard_do_not_overlap(self):
        panels = json.loads((FOLDER / "dashboard.json").read_text())["panels"]
        self.assertEqual(len({panel["id"] for panel in panels}), len(panels))
        cells = [(x, y) for panel in panels
                 for x in range(panel["gridPos"]["x"], panel["gridPos"]["x"] + panel["gridPos"]["w"])
                 for y in range(panel["gridPos"]["y"], panel["gridPos"]["y"] + panel["gridPos"]["h"])]
        self.assertEqual(len(set(cells)), len(cells))
        self.assertLess(max(x for x, _ in cells), 24)

    def test_a_metric_that_does_not_exist_is_noticed(self):
        for bad in ("rigcal_nothing > 0", 'rigcal_ingest_observations_total{result=~"eaten"} > 0'):
            with self.assertRaises(AssertionError):
                self.check(bad)

    def test_each_alert_has_a_test(self):
        tests = (FOLDER / "alerts_test.yml").read_text()
        for name in re.findall(r"- alert: (\w+)", (FOLDER / "alerts.yml").read_text()):
            self.assertRegex(tests, rf"alertname: {name}\n\s+exp_alerts:\n", name)


if __name__ == "__main__":
    unittest.main()
