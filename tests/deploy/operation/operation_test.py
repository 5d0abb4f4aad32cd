#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What whoever runs the programs relies on; $RIGCAL_BUILD_DIR names the build."""
import gzip
import json
import os
import pathlib
import re
import signal
import subprocess
import tarfile
import tempfile
import time
import unittest

BIN = pathlib.Path(os.environ["RIGCAL_BUILD_DIR"]) / "bin"
LONGEST_WAIT_S = 100


def wait(condition, what):
    """A generous limit against hanging."""
    deadline = time.monotonic() + LONGEST_WAIT_S
    while not condition():
        if time.monotonic() > deadline:
            raise AssertionError(f"{what} did not come within {LONGEST_WAIT_S} s")
        time.sleep(0.05)


class OperationTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.root = pathlib.Path(self.folder.name)
        self.processes = []
        self.environment = os.environ | {"HOME": self.folder.name, "XDG_DATA_HOME": f"{self.root}/share"}
        self.environment.pop("JOURNAL_STREAM", None)
        self.environment.pop("RIGCAL_CORRELATION_ID", None)

    def tearDown(self):
        for process in reversed(self.processes):
            process.terminate()
            process.wait(LONGEST_WAIT_S)
        self.folder.cleanup()

    def start(self, program, *arguments, log):
        with open(log, "w") as file:
            self.processes.append(subprocess.Popen([BIN / program, *arguments], env=self.environment, stderr=file))
        return self.processes[-1]

    def start_server(self, *arguments, listen="127.0.0.1:0"):
        port = self.root / "port"
        self.log = self.root / "server.log"
        self.server = self.start("rigcal-server", "--listen", listen, "--data-dir", self.root / "data",
                                 "--port-file", port, *arguments, log=self.log)
        wait(lambda: port.exists() and port.read_text().strip(), "the server's port")
        self.port = int(port.read_text())

    def rigcal(self, *arguments, address=None, environment=None):
        address = address or f"127.0.0.1:{self.port}"
        return subprocess.run([BIN / "rigcal", *arguments], capture_output=True, text=True,
                              env=self.environment | {"RIGCAL_SERVER": address} | (environment or {}))

    def lines(self, log=None):
        """Of a log in JSON; every line must be an object."""
        return [json.loads(line) for line in (log or self.log).read_text().splitlines()]

    def test_one_id_follows_a_request_from_the_command_line_to_the_worker(self):
        self.start_server("--log-format", "json")
        agent_log = self.root / "agent.log"
        self.start("rigcal-agent", "--server", f"127.0.0.1:{self.port}", "--state-dir", self.root / "agent",
                   "--log-format", "json", "--source", "sim:camera=0", log=agent_log)
        wait(lambda: '"connected": true' in self.rigcal("agent", "list", "-o", "json").stdout, "the agent")
        # The agent's lines and the server's about its stream share an id.
        mine = next(line for line in self.lines(agent_log) if "connected as" in line["message"])
        server = next(line for line in self.lines() if "connected with 1 cameras" in line["message"])
        self.assertRegex(mine["correlation"], "^[0-9a-f]{16}$")
        self.assertEqual(server["correlation"], mine["correlation"])

        created = self.rigcal("session", "create", "--target", "wand:0,0.13,0.39", "--id", "wave", "--start")
        self.assertEqual(created.returncode, 0, created.stderr)
        wait(lambda: int(json.loads(self.rigcal("session", "get", "wave", "-o", "json").stdout)
                         .get("observation_count", 0)) > 20, "observations")
        stopped = self.rigcal("session", "stop", "wave")
        self.assertEqual(stopped.returncode, 0, stopped.stderr)
        wait(lambda: "STATE_FINISHED" in self.rigcal("session", "get", "wave", "-o", "json").stdout, "the end")
        # One camera cannot be calibrated: the worker runs, and the error names the id.
        failed = self.rigcal("calibrate", "wave", "--wait", environment={"RIGCAL_CORRELATION_ID": "night-run_7"})
        self.assertNotEqual(failed.returncode, 0)
        self.assertIn("night-run_7", failed.stderr)
        about = [line for line in self.lines() if line.get("correlation") == "night-run_7"]
        self.assertEqual({line["program"] for line in about}, {"rigcal-server", "rigcal-worker"}, about)
        of_runner = [line for line in about if line["message"].startswith("calibration ")]
        self.assertGreaterEqual(len(of_runner), 2, about)
        for line in of_runner:
            self.assertEqual(line["calibration"], "c-000001")
        # Lines about something else do not carry it.
        self.assertGreater(len(self.lines()), len(about))

    def test_an_id_that_could_forge_a_line_is_not_used(self):
        self.start_server("--log-format", "json")
        self.rigcal("session", "create", "--target", "wand:0,0.13,0.39", "--id", "wave",
                    environment={"RIGCAL_CORRELATION_ID": 'x"\n{"level":"error"}'})
        created = [line for line in self.lines() if line["message"] == "session wave: created"]
        self.assertEqual(len(created), 1, self.lines())
        self.assertRegex(created[0]["correlation"], "^[0-9a-f]{16}$")
        self.assertEqual(created[0]["session"], "wave")

    def test_the_level_changes_while_the_server_runs(self):
        config = self.root / "server.toml"
        config.write_text('log_level = "warn"\n')
        self.start_server("--config", config)
        before = self.log.read_text()
        self.assertNotIn("[info]", before)
        self.server.send_signal(signal.SIGUSR1)
        wait(lambda: "the log level is info, it was warn" in self.log.read_text(), "the new level")
        self.server.send_signal(signal.SIGUSR2)
        wait(lambda: "the log level is warn, it was info" in self.log.read_text(), "the old level")
        config.write_text('log_level = "debug"\n')
        self.server.send_signal(signal.SIGHUP)
        wait(lambda: "the log level is debug, it was warn" in self.log.read_text(), "the file's level")
        config.write_text('log_level = "loud"\n')
        self.server.send_signal(signal.SIGHUP)
        wait(lambda: "the log level stays as it is" in self.log.read_text(), "the refusal")
        self.assertIn("server.toml:1", self.log.read_text())
        self.assertIsNone(self.server.poll())

    def test_the_journal_is_refused_where_there_is_none(self):
        if pathlib.Path("/run/systemd/journal/socket").exists():
            self.skipTest("this PC has a journal")
        refused = subprocess.run([BIN / "rigcal-server", "--log-format", "journal", "--data-dir", self.root / "data"],
                                 env=self.environment, capture_output=True, text=True)
        self.assertEqual(refused.returncode, 1)
        self.assertIn("use text or json", refused.stderr)

    def test_a_refusal_that_the_server_has_logged_names_the_id_to_look_for(self):
        self.start_server()
        refused = self.rigcal("session", "create", "--target", "wand:0,0.13,0.39", "--id", "wave", "--start")
        self.assertNotEqual(refused.returncode, 0)
        self.assertIn("camera", refused.stderr)
        self.assertRegex(refused.stderr, r"\(correlation id [0-9a-f]{16}\)")
        self.assertIn(re.search(r"correlation id ([0-9a-f]{16})", refused.stderr)[1], self.log.read_text())

    def test_a_port_that_is_taken_is_named_with_what_to_do(self):
        self.start_server()
        second = subprocess.run([BIN / "rigcal-server", "--listen", f"127.0.0.1:{self.port}",
                                 "--data-dir", self.root / "other"],
                                env=self.environment, capture_output=True, text=True)
        self.assertEqual(second.returncode, 1)
        for part in (f"127.0.0.1:{self.port}", f"ss -ltnp 'sport = :{self.port}'", "--listen"):
            self.assertIn(part, second.stderr)

    def check_holds_no_secret(self, bundle, secrets):
        raw = bundle.read_bytes()
        plain = gzip.decompress(raw)
        with tarfile.open(bundle) as archive:
            texts = {member.name: archive.extractfile(member).read() for member in archive.getmembers()}
        for name, text in (texts | {"the file": raw, "the archive": plain}).items():
            for secret in secrets:
                self.assertNotIn(secret.encode(), text, f"{name} holds {secret}")
            self.assertNotRegex(text, rb"-----BEGIN", name)
            self.assertNotRegex(text, rb"rk1\.[A-Za-z0-9_-]", name)
        return {name.removeprefix("rigcal-bundle/"): text.decode() for name, text in texts.items()}

    def test_the_bundle_holds_what_is_needed_and_no_secret(self):
        self.start_server(listen="0.0.0.0:0")
        socket = f"unix:{self.root}/data/rigcal.sock"
        token = self.rigcal("token", "create", address=socket)
        self.assertEqual(token.returncode, 0, token.stderr)
        join = re.search(r"rk1\.([A-Za-z0-9_-]+)", token.stdout)
        keys = [line for file in (self.root / "data").rglob("*.key")
                for line in file.read_text().splitlines() if not line.startswith("-----")]
        self.assertTrue(keys, "the server has no private key")
        # A user pastes secrets where they do not belong.
        created = self.rigcal("session", "create", "--target", "wand:0,0.13,0.39", "--id", "wave",
                              "--title", f"joined with {join[0]}", address=socket)
        self.assertEqual(created.returncode, 0, created.stderr)
        config = self.root / "site.toml"
        config.write_text(
            f'listen = "0.0.0.0:7420"\npassword = "hunter2#a"\n[store]\nurl = "postgres://anna:hunter2b@db/rig"\n'
            f'smtp-Password="hunter2c"\n api_key = [ "hunter2d",\n  "hunter2e" ]\nsecret_text = """hunter2f\nhunter2g"""\n'
            f"header = 'Authorization: Bearer hunter2h.x'\nnote = \"{join[0]}\"\n"
            "-----BEGIN EC PRIVATE KEY-----\n" + "\n".join(keys) + "\n-----END EC PRIVATE KEY-----\nrig = \"lab\"\n")
        bundle = self.root / "bundle.tar.gz"
        made = self.rigcal("doctor", "--bundle", bundle, "--config", config, address=socket)
        self.assertTrue(bundle.exists(), made.stderr)
        secrets = [join[1], *keys, "hunter2"]
        texts = self.check_holds_no_secret(bundle, secrets)
        self.assertEqual(set(texts), {
            "README.txt", "doctor.txt", "versions.txt", "disks.txt", "log.txt", "config/1_site.toml",
            "server/status.json", "server/agents.json", "server/sessions.json", "server/calibrations.json",
            "server/metrics.txt"})
        # What is no secret stays.
        self.assertIn('listen = "0.0.0.0:7420"', texts["config/1_site.toml"])
        self.assertIn('rig = "lab"', texts["config/1_site.toml"])
        self.assertIn("@db/rig", texts["config/1_site.toml"])
        self.assertIn("wave", texts["server/sessions.json"])
        self.assertIn("software_version", texts["server/status.json"])
        self.assertIn("rigcal-worker: ", texts["versions.txt"])
        self.assertIn("reachable at", texts["doctor.txt"])
        for name in texts:
            self.assertIn(name, made.stderr)
        self.assertIn("Look at it before you give it away", made.stderr)
        self.assertEqual(bundle.stat().st_mode & 0o777, 0o600)
        # It is not replaced.
        before = bundle.read_bytes()
        again = self.rigcal("doctor", "--bundle", bundle, address=socket)
        self.assertNotEqual(again.returncode, 0)
        self.assertIn("exists already", again.stderr)
        self.assertEqual(bundle.read_bytes(), before)

    def test_the_bundle_is_made_without_a_server(self):
        bundle = self.root / "bundle.tar.gz"
        made = self.rigcal("doctor", "--bundle", bundle, address="127.0.0.1:1")
        self.assertNotEqual(made.returncode, 0)
        texts = self.check_holds_no_secret(bundle, [])
        self.assertIn("no server answers", texts["server.txt"])
        self.assertIn("127.0.0.1:1", texts["doctor.txt"])

    def test_a_bundle_that_cannot_be_written_says_why(self):
        made = self.rigcal("doctor", "--bundle", self.root / "nowhere" / "bundle.tar.gz", address="127.0.0.1:1")
        self.assertNotEqual(made.returncode, 0)
        self.assertIn("nowhere", made.stderr)


if __name__ == "__main__":
    unittest.main()
