# SPDX-License-Identifier: Apache-2.0
"""A rigcal-server of this build on a free loopback port, with simulated cameras."""

import os
import subprocess
import tempfile
import time
from pathlib import Path

import rig_cases

LIMIT_S = 60


class RunningRig:
    """Server and agent, ended by their ids with the object; their data are removed."""

    def __init__(self, config: str = ""):
        self._folder = tempfile.TemporaryDirectory()
        self.folder = Path(self._folder.name)
        self._config = self.folder / "server.toml"
        self._config.write_text(config)
        self._processes: list[subprocess.Popen] = []
        self.server: subprocess.Popen | None = None
        self.port = 0
        self.environment = {**os.environ, "HOME": str(self.folder), "XDG_CONFIG_HOME": "",
                            "XDG_DATA_HOME": "", "XDG_STATE_HOME": "", "RIGCAL_SERVER": ""}
        try:
            self.start_server()
        except BaseException:
            self.close()
            raise

    @property
    def address(self) -> str:
        return f"127.0.0.1:{self.port}"

    def start_server(self) -> None:
        """At the port it had before, if it had one."""
        port_file = self.folder / "port"
        port_file.unlink(missing_ok=True)
        self.server = self._start("rigcal-server", "--config", self._config, "--data-dir",
                                  self.folder / "data", "--listen", f"127.0.0.1:{self.port}",
                                  "--port-file", port_file)
        self.wait_for(lambda: port_file.exists() and port_file.read_text().strip(), self.server)
        self.port = int(port_file.read_text())

    def stop_server(self) -> None:
        self.end(self.server)

    def kill_server(self) -> None:
        """Without a chance to say goodbye."""
        self.server.kill()
        self.server.wait()

    def start_agent(self, options: str = "", cameras: int = 4) -> subprocess.Popen:
        """One agent with all cameras of a simulated rig."""
        sources = []
        for i in range(cameras):
            sources += ["--source", f"sim:camera={i};cameras={cameras};{options}"]
        return self._start("rigcal-agent", "--server", self.address, "--state-dir",
                           self.folder / "agent", *sources)

    def rigcal(self, *arguments: str) -> str:
        """What the command line prints."""
        done = subprocess.run([rig_cases.program("rigcal"), *arguments, "--server", self.address],
                              capture_output=True, text=True, check=False, env=self.environment)
        if done.returncode != 0:
            raise RuntimeError(done.stderr)
        return done.stdout

    def wait_for(self, condition, process=None) -> None:
        deadline = time.monotonic() + LIMIT_S
        while not condition():
            if process is not None and process.poll() is not None:
                raise RuntimeError(f"{process.args} ended: {self._log.read_text()}")
            if time.monotonic() > deadline:
                raise TimeoutError(f"{condition} did not come about; {self._log.read_text()}")
            time.sleep(0.02)

    def close(self) -> None:
        for process in reversed(self._processes):
            self.end(process)
        self._folder.cleanup()

    @staticmethod
    def end(process) -> None:
        if process.poll() is None:
            process.terminate()
            try:
                process.wait(LIMIT_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    @property
    def _log(self) -> Path:
        return self.folder / "log"

    def _start(self, name: str, *arguments) -> subprocess.Popen:
        with self._log.open("a") as log:
            process = subprocess.Popen([rig_cases.program(name), *map(str, arguments)],
                                       stdout=log, stderr=log, env=self.environment)
        self._processes.append(process)
        return process
