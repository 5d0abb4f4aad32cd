# SPDX-License-Identifier: Apache-2.0
"""Joining a server over TLS, and what is wrong with an identity."""

import os
import tempfile
import time
import unittest
from pathlib import Path
from unittest import mock

import rigcal
from rigcal import RigcalError
from rigcal.identity import LOOPBACK_SERVER, UserIdentity, default_address, is_on_this_machine
from running_rig import RunningRig


class User(unittest.TestCase):
    """A user with a home of his own, and the programs on the PATH."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.home = Path(folder.name)
        self.environment = {"HOME": str(self.home), "XDG_CONFIG_HOME": "", "XDG_DATA_HOME": "",
                            "RIGCAL_SERVER": "",
                            "PATH": os.environ["RIGCAL_PROGRAMS"] + ":" + os.environ["PATH"]}
        patch = mock.patch.dict(os.environ, self.environment)
        patch.start()
        self.addCleanup(patch.stop)
        self.identity = self.home / ".config/rigcal/identity"


class Joining(User):
    def setUp(self):
        super().setUp()
        # With a port for joining, whoever has joined is asked for a certificate.
        self.rig = RunningRig('[https]\nlisten = "127.0.0.1:0"\n')
        self.addCleanup(self.rig.close)

    def token(self, role):
        return self.rig.rigcal("token", "create", "--role", role).split()[0]

    def test_a_user_joins_once(self):
        with rigcal.Client.join(self.token("operator"), name="anna") as client:
            self.assertEqual(client.address, self.rig.address)
            self.assertEqual(list(client.sessions()), [])
        with rigcal.Client() as again:
            self.assertEqual(again.address, self.rig.address)
            self.assertEqual(again.version(), rigcal.__version__)
            with self.assertRaises(RigcalError) as caught:
                again.api("identity").ListTokens()
        self.assertEqual(caught.exception.code, "PERMISSION_DENIED")

    def test_a_used_string_is_refused_in_the_servers_words(self):
        token = self.token("viewer")
        rigcal.Client.join(token).close()
        with self.assertRaisesRegex(RigcalError, "used"):
            rigcal.Client.join(token)
        with self.assertRaisesRegex(RigcalError, "not a join string"):
            rigcal.Client.join("nonsense")

    def test_a_viewer_reads_and_does_not_write(self):
        with rigcal.Client.join(self.token("viewer")) as client:
            self.assertEqual(list(client.calibrations()), [])
            with self.assertRaises(RigcalError) as caught:
                client.start_session("wand:0,0.13,0.39")
        self.assertEqual(caught.exception.code, "PERMISSION_DENIED")

    def test_a_ca_with_a_second_certificate_is_not_trusted(self):
        rigcal.Client.join(self.token("operator")).close()
        ca = self.identity / "ca.crt"
        ca.write_bytes(ca.read_bytes() + (self.identity / "user.crt").read_bytes())
        with self.assertRaisesRegex(RigcalError, "ca.crt holds 2 certificates, not one; join"):
            rigcal.Client()

    def test_the_program_asks_once_a_day_for_a_newer_certificate(self):
        rigcal.Client.join(self.token("operator")).close()
        asked = self.identity / "asked"
        asked.touch()
        for age_s, asks in ((3600, False), (2 * 24 * 3600, True)):
            before = time.time() - age_s
            os.utime(asked, (before, before))
            rigcal.Client().close()
            self.assertEqual(asked.stat().st_mtime > before + 1, asks, age_s)

    def test_a_missing_key_is_named(self):
        rigcal.Client.join(self.token("operator")).close()
        (self.identity / "user.key").unlink()
        with self.assertRaisesRegex(RigcalError, "user.key: No such file or directory"):
            rigcal.Client()


class Addresses(User):
    def test_without_anything_it_is_loopback(self):
        self.assertEqual(default_address(UserIdentity.of_user()), LOOPBACK_SERVER)

    def test_the_environment_goes_first(self):
        with mock.patch.dict(os.environ, {"RIGCAL_SERVER": "10.0.0.5:7420"}):
            self.assertEqual(default_address(UserIdentity.of_user()), "10.0.0.5:7420")
            with self.assertRaisesRegex(
                    RigcalError, "10.0.0.5:7420 is on another machine .*rigcal.Client.join"):
                rigcal.Client()

    def test_a_socket_file_of_this_user(self):
        rig = RunningRig()
        self.addCleanup(rig.close)
        folder = self.home / ".local/share"
        folder.mkdir(parents=True)
        (rig.folder / "data").rename(folder / "rigcal")
        (rig.folder / "data").symlink_to(folder / "rigcal")
        address = default_address(UserIdentity.of_user())
        self.assertEqual(address, f"unix:{folder}/rigcal/rigcal.sock")
        with rigcal.Client() as client:
            self.assertEqual(client.version(), rigcal.__version__)

    def test_what_is_on_this_machine(self):
        for address in ("127.0.0.1:1", "127.8.9.1:1", "[::1]:1", "localhost:1", "unix:/run/x"):
            self.assertTrue(is_on_this_machine(address), address)
        for address in ("10.0.0.5:7420", "server:7420", "[fe80::1]:7420"):
            self.assertFalse(is_on_this_machine(address), address)

    def test_joining_needs_the_program(self):
        with mock.patch.dict(os.environ, {"PATH": ""}):
            with self.assertRaisesRegex(RigcalError, "the program rigcal is needed once"):
                rigcal.Client.join("rk1.AAAA")
