#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The services that `cmake --install --component service` installs; $RIGCAL_BUILD_DIR names the build."""
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import tempfile
import tomllib
import unittest

SOURCES = pathlib.Path(__file__).resolve().parents[3]
BUILD = pathlib.Path(os.environ["RIGCAL_BUILD_DIR"])
ANALYZE = shutil.which("systemd-analyze")
UNITS = "usr/lib/systemd/system"


class InstalledFilesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls.folder.name)
        subprocess.run(
            ["cmake", "--install", BUILD, "--component", "service"],
            env=os.environ | {"DESTDIR": cls.folder.name}, check=True, stdout=subprocess.DEVNULL)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def unit(self, name):
        return (self.root / UNITS / f"rigcal-{name}.service").read_text()

    def analyze(self, *arguments):
        """With the programs of this build in the place of those in /usr/bin."""
        with tempfile.TemporaryDirectory() as folder:
            files = []
            for name in ("agent", "server", "worker"):
                files.append(pathlib.Path(folder) / f"rigcal-{name}.service")
                files[-1].write_text(self.unit(name).replace("/usr/bin/rigcal", f"{BUILD}/bin/rigcal"))
            return subprocess.run([ANALYZE, *arguments, *files], capture_output=True, text=True)

    def test_holds_units_users_rules_and_configuration_and_nothing_else(self):
        files = sorted(str(f.relative_to(self.root)) for f in self.root.rglob("*") if f.is_file())
        self.assertEqual(files, [
            "etc/rigcal/agent.toml", "etc/rigcal/server.toml",
            f"{UNITS}/rigcal-agent.service", f"{UNITS}/rigcal-server.service", f"{UNITS}/rigcal-worker.service",
            "usr/lib/sysusers.d/rigcal-agent.conf", "usr/lib/sysusers.d/rigcal-server.conf",
            "usr/lib/udev/rules.d/60-rigcal-agent.rules"])

    def test_configurations_set_the_folder_and_leave_the_rest_as_it_is(self):
        for name, wanted in (("server", {"data_dir": "/var/lib/rigcal"}),
                             ("agent", {"state_dir": "/var/lib/rigcal-agent"})):
            text = (self.root / f"etc/rigcal/{name}.toml").read_text()
            self.assertEqual(tomllib.loads(text), wanted)
            # All else is the example's, commented out.
            example = (SOURCES / "deploy" / f"{name}.toml").read_text()
            self.assertEqual(re.sub(r"^#", "", text, flags=re.MULTILINE), re.sub(r"^#", "", example, flags=re.MULTILINE))

    def test_the_agent_starts_without_a_camera(self):
        # It offers what it sees, and cameras are chosen at the server.
        self.assertNotIn("ExecCondition", self.unit("agent"))
        self.assertNotIn("camera", tomllib.loads((self.root / "etc/rigcal/agent.toml").read_text()))

    @unittest.skipUnless(ANALYZE, "systemd-analyze is not installed")
    def test_units_are_valid(self):
        verified = self.analyze("verify", "--man=no")
        self.assertEqual((verified.returncode, verified.stdout, verified.stderr), (0, "", ""))

    @unittest.skipUnless(ANALYZE, "systemd-analyze is not installed")
    def test_units_that_are_not_valid_are_found(self):
        with tempfile.TemporaryDirectory() as folder:
            broken = pathlib.Path(folder) / "broken.service"
            broken.write_text("[Service]\nType=notify\nExecStart=/nowhere/program\n")
            self.assertNotEqual(subprocess.run([ANALYZE, "verify", broken], capture_output=True).returncode, 0)

    @unittest.skipUnless(ANALYZE, "systemd-analyze is not installed")
    def test_services_may_do_little(self):
        # Exposure, from 0 to 10: at most 2.0.
        judged = self.analyze("security", "--offline=true", "--threshold=20")
        self.assertEqual(judged.returncode, 0, judged.stdout)


class NoticeTest(unittest.TestCase):
    """What the programs themselves say to $NOTIFY_SOCKET."""

    def notices_of(self, *command):
        """All that a program says until SIGTERM, which it gets after its first sign of life."""
        with tempfile.TemporaryDirectory() as folder, socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
            manager.bind(f"{folder}/notify")
            manager.settimeout(60)
            environment = os.environ | {
                "NOTIFY_SOCKET": f"{folder}/notify", "WATCHDOG_USEC": "60000000", "HOME": folder}
            environment.pop("WATCHDOG_PID", None)
            arguments = [part.replace("FOLDER", folder) for part in command]
            with subprocess.Popen(arguments, env=environment, stderr=subprocess.PIPE, text=True) as program:
                try:
                    notices = []
                    while not notices or notices[-1] != "WATCHDOG=1":
                        notices.append(manager.recv(4096).decode())
                    program.send_signal(signal.SIGTERM)
                    notices.append(manager.recv(4096).decode())
                    log = program.communicate(timeout=60)[1]
                except BaseException:
                    program.kill()
                    raise
                self.assertEqual(program.returncode, 0, log)
            return notices

    def test_the_server_is_ready_when_it_listens_and_says_that_it_stops(self):
        ready, alive, stopping = self.notices_of(
            f"{BUILD}/bin/rigcal-server", "--listen", "127.0.0.1:0", "--data-dir", "FOLDER/data")
        self.assertRegex(ready, r"^READY=1\nSTATUS=accepts calls at port [1-9]\d*, the dashboard is at http://[^\n]+$")
        self.assertEqual((alive, stopping), ("WATCHDOG=1", "STOPPING=1"))

    def test_the_agent_is_ready_when_it_captures_and_says_that_it_stops(self):
        ready, alive, stopping = self.notices_of(
            f"{BUILD}/bin/rigcal-agent", "--server", "127.0.0.1:1", "--source", "sim:camera=0",
            "--state-dir", "FOLDER/state")
        self.assertEqual(ready, "READY=1\nSTATUS=sends to 127.0.0.1:1")
        self.assertEqual((alive, stopping), ("WATCHDOG=1", "STOPPING=1"))


if __name__ == "__main__":
    unittest.main()
