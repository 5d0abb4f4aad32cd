# SPDX-License-Identifier: Apache-2.0
"""Where the server is, and the certificate with which this user asks it.

`rigcal login` keeps both in the folder `identity`; docs/several_pcs.md lists its files.
"""

import ipaddress
import json
import os
import re
import shutil
import socket
import stat
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

from rigcal.errors import RigcalError

LOOPBACK_SERVER = "127.0.0.1:7420"

_CERTIFICATE = re.compile(
    rb"-----BEGIN CERTIFICATE-----.+?-----END CERTIFICATE-----\s*", re.DOTALL
)
_DAY_S = 24 * 60 * 60
_RENEWAL_TIMEOUT_S = 5
_LOGIN_TIMEOUT_S = 60


@dataclass(frozen=True)
class UserIdentity:
    """The files that joining a server leaves; nothing needs to exist.

    Attributes:
        folder: With ca.crt, user.crt, user.key and servers.json.
    """

    folder: Path

    @classmethod
    def of_user(cls) -> "UserIdentity":
        """In $XDG_CONFIG_HOME/rigcal, else ~/.config/rigcal."""
        return cls(_base_folder("XDG_CONFIG_HOME", ".config") / "rigcal" / "identity")

    @property
    def exists(self) -> bool:
        return (self.folder / "user.crt").exists()

    def servers(self) -> list[str]:
        """HOST:PORT of the servers joined; none where the file is missing or damaged."""
        if not self.exists:
            return []
        try:
            addresses = json.loads((self.folder / "servers.json").read_text())["grpc"]
            return [address for address in addresses if isinstance(address, str)]
        except (OSError, ValueError, KeyError, TypeError):
            return []

    def certificates(self) -> tuple[bytes, bytes, bytes]:
        """PEM of the CA's certificate, of the user's, and of its key.

        Raises:
            RigcalError: They are missing, or ca.crt holds more than one certificate, each of which
                would be trusted as the server.
        """
        texts = []
        for name in ("ca.crt", "user.crt", "user.key"):
            try:
                text = (self.folder / name).read_bytes()
            except OSError as error:
                raise self._damaged(f"{name}: {error.strerror}") from None
            if name.endswith(".crt"):
                found = _CERTIFICATE.findall(text)
                if len(found) != 1:
                    raise self._damaged(f"{name} holds {len(found)} certificates, not one")
                text = found[0]
            texts.append(text)
        return texts[0], texts[1], texts[2]

    def renew_if_due(self, address: str) -> None:
        """Has the program `rigcal`, where it is installed, ask once a day for a newer one."""
        program = shutil.which("rigcal")
        asked = self.folder / "asked"
        if program is None or (asked.exists() and time.time() - asked.stat().st_mtime < _DAY_S):
            return
        try:
            subprocess.run(
                [program, "session", "list", "--server", address],
                capture_output=True,
                timeout=_RENEWAL_TIMEOUT_S,
                check=False,
            )
        except (OSError, subprocess.TimeoutExpired):
            pass  # the certificate may still do; the server says why it does not

    def _damaged(self, why: str) -> RigcalError:
        return RigcalError(
            f"the identity in {self.folder} cannot be used: {why}; join again with a new join "
            "string: rigcal login STRING",
            "FAILED_PRECONDITION",
        )


def join_server(join_string: str, name: str | None) -> None:
    """Runs `rigcal login`, which makes the key and has the server sign its certificate.

    Raises:
        RigcalError: The program is not installed, or what it says.
    """
    program = shutil.which("rigcal")
    if program is None:
        raise RigcalError(
            "to join a server the program rigcal is needed once, and it is not on the PATH"
        )
    command = [program, "login", join_string] + (["--name", name] if name else [])
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=_LOGIN_TIMEOUT_S, check=False
        )
    except subprocess.TimeoutExpired:
        raise RigcalError(f"rigcal login gave no answer within {_LOGIN_TIMEOUT_S} s") from None
    if done.returncode != 0:
        raise RigcalError(done.stderr.strip().removeprefix("rigcal: "))


def is_on_this_machine(address: str) -> bool:
    """ "unix:/PATH", or HOST:PORT with a host of loopback."""
    if address.startswith("unix:"):
        return True
    host = address.rpartition(":")[0].removeprefix("[").removesuffix("]")
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def default_address(identity: UserIdentity) -> str:
    """$RIGCAL_SERVER; else the server joined; else a server of this user on this PC, by its
    socket file; else 127.0.0.1:7420."""
    if os.environ.get("RIGCAL_SERVER"):
        return os.environ["RIGCAL_SERVER"]
    joined = identity.servers()
    if joined:
        return joined[0]
    file = _base_folder("XDG_DATA_HOME", ".local/share") / "rigcal" / "rigcal.sock"
    return f"unix:{file}" if _answers(file) else LOOPBACK_SERVER


def _base_folder(variable: str, below_home: str) -> Path:
    # The XDG specification says to ignore a relative path there.
    folder = os.environ.get(variable, "")
    return Path(folder) if folder.startswith("/") else Path.home() / below_home


def _answers(file: Path) -> bool:
    """A server of this user, or of root, listens there."""
    try:
        status = file.lstat()
        if not stat.S_ISSOCK(status.st_mode) or status.st_uid not in (os.geteuid(), 0):
            return False
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
            connection.settimeout(1)
            connection.connect(str(file))
        return True
    except OSError:
        return False
