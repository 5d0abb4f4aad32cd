# SPDX-License-Identifier: Apache-2.0
"""The client against a real server with simulated cameras."""

import subprocess
import sys
import threading
import time
import unittest
from unittest import mock

import grpc
import numpy as np

import rig_cases
import rigcal
from rigcal import MarkerRows, RigcalError, TimedPoints
from rigcal.enum_names import enum_name
from rigcal.marker_rows import in_order_of_time
from rigcal.v1.session_pb2 import Session
from rigcal.v1.session_service_pb2 import GetSessionResponse
from running_rig import RunningRig

WAND = "wand:0,0.13,0.39"


def setUpModule():
    global RIG
    RIG = RunningRig()


def tearDownModule():
    RIG.close()


class OneRig(unittest.TestCase):
    """From the wave to files, step by step on one server."""

    @classmethod
    def setUpClass(cls):
        cls.client = rigcal.Client(RIG.address)
        agent = RIG.start_agent("duration=20;speed=max;offset.2=0.008")
        cls.addClassCleanup(RIG.end, agent)
        cls.addClassCleanup(cls.client.close)
        RIG.wait_for(lambda: len(cls.client.live().cameras) == 4)
        cls.session = cls.client.start_session(WAND, id="wave", title="a wave")
        cls.states = [session.state for session in cls.session.watch()]
        job = cls.client.calibrate(cls.session, options={"sigma_px": 0.3}, reason="a test")
        cls.progress = list(job)
        cls.calibration = job.result()

    def test_the_session_ended_by_itself(self):
        self.assertEqual(self.states[-1], "finished")
        self.assertEqual(self.session.cameras, ("sim_0", "sim_1", "sim_2", "sim_3"))
        self.assertEqual(self.session.observation_count, 2000)
        self.assertEqual(self.session.message.title, "a wave")
        again = self.client.session("wave")
        self.assertEqual((again.state, again.observation_count), ("finished", 2000))
        self.assertIn("wave", [session.id for session in self.client.sessions()])
        self.assertEqual([], list(self.client.sessions('rig="another"')))

    def test_the_calibration_tells_its_progress(self):
        self.assertEqual(self.progress[-1].state, "succeeded")
        self.assertEqual(self.calibration.cameras, self.session.cameras)
        self.assertTrue(self.calibration.has_covariance)
        self.assertEqual(self.calibration.message["reason"], "a test")
        self.assertEqual(self.calibration.message["options"]["sigma_px"], 0.3)
        listed = next(c for c in self.client.calibrations() if c.id == self.calibration.id)
        self.assertEqual(list(listed.session_ids), ["wave"])
        late, other = (self.calibration.rig_time(name, 0) for name in ("sim_2", "sim_1"))
        self.assertAlmostEqual((late - other) / 1e9, 0.008, delta=0.0005)

    def test_a_failed_calibration_says_why(self):
        job = self.client.calibrate("wave", options={
            "what_if": True, "without_cameras": ["sim_0", "sim_1", "sim_2"]})
        with self.assertRaisesRegex(RigcalError, f"calibration {job.id} failed: .*camera"):
            job.result()

    def test_activation(self):
        self.client.activate(self.calibration, reason="it is good")
        self.assertEqual(self.client.active_calibration().id, self.calibration.id)
        with self.assertRaisesRegex(RigcalError, "rig nowhere|no rig|'nowhere'") as caught:
            self.client.active_calibration("nowhere")
        self.assertEqual(caught.exception.code, "NOT_FOUND")

    def test_exports_are_those_of_the_command_line(self):
        folder = RIG.folder / "exports"
        for form, end in [("opencv", ""), ("colmap", ""), ("json", ""), ("matlab", "/rig.mat")]:
            written = self.client.export(self.calibration, form, f"{folder}/{form}{end}")
            RIG.rigcal("calibration", "export", self.calibration.id, "--format", form,
                       "--output", str(folder / f"{form}-cli"))
            theirs = sorted((folder / f"{form}-cli").iterdir())
            self.assertEqual(sorted(path.name for path in written), [path.name for path in theirs])
            for ours, other in zip(sorted(written), theirs):
                self.assertEqual(ours.read_bytes(), other.read_bytes(), ours.name)
        self.assertEqual(rigcal.Calibration.load(folder / "json").id, self.calibration.id)
        loaded = rigcal.Calibration.load(folder / "opencv")
        np.testing.assert_allclose(loaded.position("sim_3"), self.calibration.position("sim_3"))
        with self.assertRaisesRegex(RigcalError, "sim_0.yaml exists; force=True replaces it"):
            self.client.export(self.calibration, "opencv", folder / "opencv")
        self.client.export(self.calibration, "opencv", folder / "opencv", force=True)
        with self.assertRaisesRegex(RigcalError, "opencv.*json.*kalibr") as caught:
            self.client.export(self.calibration, "paper", folder)
        self.assertEqual(caught.exception.code, "INVALID_ARGUMENT")

    def test_observations_become_points_as_on_the_command_line(self):
        rows = self.client.observations("wave")
        self.assertEqual(sorted(rows), list(self.session.cameras))
        self.assertEqual(rows["sim_0"].pixels.shape, (500, 3, 2))
        points = TimedPoints.joined(self.client.triangulate(rows, self.calibration))
        folder = RIG.folder / "rows"
        RIG.rigcal("session", "observations", "wave", "--output", str(folder))
        for name, own in rows.items():
            lines = np.loadtxt(folder / f"{name}.csv", delimiter=";")
            seen = np.where(lines[:, 1:] == -1, np.nan, lines[:, 1:]).reshape(-1, 3, 2)
            self.assertGreater(np.isnan(seen).sum(), 50)
            np.testing.assert_allclose(own.pixels, seen, atol=1e-4)
        output = RIG.folder / "points.csv"
        RIG.rigcal("triangulate", self.calibration.id, "--data", str(folder),
                   "--output", str(output))
        theirs = np.genfromtxt(output, delimiter=",", names=True)
        # At the edges of a block the rows around it may be others.
        self.assertGreater(len(theirs), 1400)
        self.assertLess(abs(len(points) - len(theirs)), 5)
        key = lambda time_ns, label: np.rint(time_ns / 1e6).astype(int) * 10 + label.astype(int)
        _, ours_at, theirs_at = np.intersect1d(
            key(points.time_ns, points.marker), key(1e9 * theirs["time_s"], theirs["label"]),
            return_indices=True)
        self.assertGreater(len(ours_at), 1400)
        there = np.stack([theirs[f"{axis}_m"][theirs_at] for axis in "xyz"], axis=-1)
        off = np.linalg.norm(points.position_m[ours_at] - there, axis=-1)
        self.assertLess(np.median(off), 1e-6)
        sigma = np.sqrt(points.covariance_m2[ours_at, 0, 0])
        self.assertLess(np.median(abs(sigma / theirs["sigma_x_m"][theirs_at] - 1)), 0.01)
        lengths = np.linalg.norm(np.diff(points.position_m, axis=0), axis=-1)
        first = (points.marker[:-1] == 0) & (points.marker[1:] == 1)
        first &= np.diff(points.time_ns) == 0
        self.assertAlmostEqual(np.median(lengths[first]), 0.13, delta=0.0005)

    def test_a_stream_that_breaks_goes_on(self):
        rows = self.client.observations("wave")
        whole = TimedPoints.joined(self.client.triangulate(rows, self.calibration))
        keys = lambda points: list(zip(points.time_ns.tolist(), points.marker.tolist()))
        for end in (RIG.stop_server, RIG.kill_server):
            resumed = TimedPoints.joined(self.points_over_a_restart(rows, end))
            self.assertEqual(keys(resumed), sorted(set(keys(resumed))), "points came twice")
            self.assertEqual(set(keys(whole)), set(keys(resumed)))
            np.testing.assert_allclose(resumed.position_m, whole.position_m, atol=1e-5)

    def points_over_a_restart(self, rows, end_server):
        """Rows of half of the time, then the server ends and is started anew, then the others."""
        half_sent, goes_on = threading.Event(), threading.Event()
        pieces = list(in_order_of_time(rows, self.calibration))

        def slowly():
            yield from pieces[: len(pieces) // 2]
            half_sent.set()
            goes_on.wait(60)
            yield from pieces[len(pieces) // 2 :]

        stream = self.client.triangulate(slowly(), self.calibration)
        parts = [next(stream)]
        self.assertTrue(half_sent.wait(60))
        end_server()
        restart = threading.Timer(1.0, lambda: (RIG.start_server(), goes_on.set()))
        restart.start()
        parts += list(stream)
        restart.join()
        return parts

    def test_a_server_that_stays_away_is_given_up(self):
        never = threading.Event()
        self.addCleanup(never.set)

        def waiting():
            yield MarkerRows("sim_0", [1], np.zeros((1, 1, 2)))
            never.wait(60)

        stream = self.client.triangulate(waiting(), self.calibration, patience_s=0.5)
        stop = threading.Timer(0.5, RIG.stop_server)
        stop.start()
        with self.assertRaisesRegex(RigcalError, "cannot reach the server") as caught:
            list(stream)
        self.assertEqual(caught.exception.code, "UNAVAILABLE")
        stop.join()
        RIG.start_server()

    def test_bad_rows_end_the_stream_with_their_reason(self):
        row = lambda camera, markers: MarkerRows(camera, [1], np.zeros((1, markers, 2)))
        with self.assertRaisesRegex(ValueError, "no camera left; it has sim_0"):
            list(self.client.triangulate([row("left", 1)], self.calibration))
        with self.assertRaisesRegex(RigcalError, "markers; the rows before had 1"):
            list(self.client.triangulate([row("sim_0", 1), row("sim_1", 2)], self.calibration))
        with self.assertRaisesRegex(ZeroDivisionError, "division"):
            list(self.client.triangulate((1 / 0 for _ in [1]), self.calibration))
        with self.assertRaisesRegex(RigcalError, "block_s|block"):
            list(self.client.triangulate([row("sim_0", 1)], self.calibration, block_s=99))
        self.assertEqual([], list(self.client.triangulate([], self.calibration)))
        with self.assertRaisesRegex(ValueError, r"must be \(N, M, 2\).*got \(2, 1, 2\) and \(1,\)"):
            MarkerRows("sim_0", [1], np.zeros((2, 1, 2)))

    def test_rows_without_a_point_say_why(self):
        rows = self.client.observations("wave")
        with self.assertRaisesRegex(RigcalError, "wave has no rows of camera left; it has rows of "
                                                 "sim_0, sim_1, sim_2, sim_3"):
            rows["left"]
        first = rows["sim_0"]
        late = MarkerRows("sim_1", rows["sim_1"].time_ns + 100_000_000_000, rows["sim_1"].pixels)
        with self.assertRaisesRegex(
                RigcalError, r"no point: \d+ markers were seen by one camera only.*sim_0 from 0.0 "
                             r"to \d+.\d s, of sim_1 from 10\d.\d to") as caught:
            list(self.client.triangulate({"sim_0": first, "sim_1": late}, self.calibration))
        self.assertEqual(caught.exception.code, "FAILED_PRECONDITION")
        blind = MarkerRows("sim_1", first.time_ns, np.full_like(first.pixels, np.nan))
        with self.assertRaisesRegex(RigcalError, "of sim_1 no marker"):
            list(self.client.triangulate({"sim_0": first, "sim_1": blind}, self.calibration))

    def test_watch_without_a_session_ends(self):
        with self.assertRaisesRegex(
                RigcalError, "no session of rig rig captures.*none began within 0.5 s; start one"):
            for live in self.client.watch(session_wait_s=0.5):
                self.assertEqual(live.rig, "rig")

    def test_everything_else_is_in_the_api(self):
        agents = lambda: self.client.api("agent").ListAgents().agents
        # It comes back by itself after a restart of the server.
        RIG.wait_for(lambda: [len(agent.cameras) for agent in agents()] == [4])
        self.assertEqual(self.client.api("session").GetSession(id="wave").session.id, "wave")
        self.assertEqual(self.client.api("session").GetSession.__doc__,
                         "rigcal.v1.GetSessionRequest(id, audit) to rigcal.v1.GetSessionResponse.")
        with self.assertRaisesRegex(RigcalError, "there is no service wand; there are agent, "):
            self.client.api("wand")


class LiveState(unittest.TestCase):
    def test_changes_are_merged(self):
        client = rigcal.Client(RIG.address)
        self.addCleanup(client.close)
        agent = RIG.start_agent("duration=600;rate=50", cameras=3)
        self.addCleanup(RIG.end, agent)
        connected = lambda: [c for c in client.live().cameras if c.state == 2]
        RIG.wait_for(lambda: len(connected()) == 3)
        session = client.start_session(WAND, until_mm=0.001, cameras=["sim_0", "sim_1", "sim_2"])
        self.addCleanup(session.stop, wait=False)
        counts, deadline = [], time.monotonic() + 60
        for live in client.watch(interval_s=0.1):
            self.assertLess(time.monotonic(), deadline, counts)
            counts.append(sum(camera.observation_count for camera in live.cameras))
            if len(counts) > 3 and counts[-1] > 300:
                break
        self.assertGreater(len(set(counts)), 3)
        self.assertEqual(live.session.id, session.id)
        stop = threading.Timer(1.0, session.stop)
        stop.start()
        for live in client.watch(interval_s=0.1):
            self.assertLess(time.monotonic(), deadline)
        stop.join()
        self.assertEqual((live.session.id, live.session.state), (session.id, 4))
        self.assertEqual(session.stop().state, "finished")


class Errors(unittest.TestCase):
    def setUp(self):
        self.client = rigcal.Client(RIG.address)
        self.addCleanup(self.client.close)

    def test_are_the_servers_words(self):
        with self.assertRaisesRegex(RigcalError, "nowhere") as caught:
            self.client.session("nowhere")
        self.assertEqual(caught.exception.code, "NOT_FOUND")
        said = str(caught.exception)
        with self.assertRaises(RuntimeError) as cli:
            RIG.rigcal("session", "get", "nowhere")
        self.assertIn(said.split(";")[0], str(cli.exception))
        with self.assertRaisesRegex(RigcalError, "positions must increase") as caught:
            self.client.start_session("wand:0,0.2,0.1")
        self.assertEqual(caught.exception.code, "INVALID_ARGUMENT")

    def test_targets_that_are_none(self):
        for text in ("stick:1", "wand:0,a", "wand:0,0.1;colour=red", "board:checker,9x6,0.04;x=1"):
            with self.assertRaisesRegex(RigcalError, "such as wand:0,0.13,0.39"):
                self.client.start_session(text)

    def test_a_server_that_is_not_there(self):
        with rigcal.Client("127.0.0.1:1") as client:
            with self.assertRaisesRegex(RigcalError, "cannot reach .* 127.0.0.1:1 ") as caught:
                client.version()
        self.assertEqual(caught.exception.code, "UNAVAILABLE")

    def test_what_is_no_address(self):
        for address in ("127.0.0.1", "http://127.0.0.1:7420", "a b:1", "1:2:3:4"):
            with self.assertRaisesRegex(RigcalError, "is no server address; give HOST:PORT"):
                rigcal.Client(address)

    def test_of_several_servers_the_one_that_answers(self):
        with rigcal.Client(f"127.0.0.1:1, {RIG.address}") as client:
            self.assertEqual(client.version(), self.client.version())
        with rigcal.Client("127.0.0.1:1,127.0.0.1:2") as client:
            with self.assertRaisesRegex(RigcalError, "127.0.0.1:2"):
                client.version()
        with self.assertRaisesRegex(RigcalError, "'' is no server address"):
            rigcal.Client(RIG.address + ",")

    def test_a_call_that_the_server_does_not_know_names_the_version(self):
        connection = self.client._connection
        call = connection.multi_callable(
            "unary_unary", "/rigcal.v1.SessionService/Juggle", GetSessionResponse)
        with self.assertRaises(grpc.RpcError) as caught:
            call(GetSessionResponse())
        said = str(connection.explain(caught.exception, "SessionService.Juggle", 1))
        self.assertIn(
            f"is rigcal-server {self.client.version()} and does not know SessionService.Juggle: "
            f"a server of version {rigcal.__version__} or newer", said)
        status = mock.Mock(GetStatus=lambda: mock.Mock(software_version="99.1.0"))
        with mock.patch.object(connection, "service", lambda name: status):
            said = str(connection.explain(caught.exception, "SessionService.Juggle", 1))
        self.assertIn("99.1.0 and does not know SessionService.Juggle of this package's version "
                      f"{rigcal.__version__}: install the Python package of version 99.1.0", said)

    def test_fields_and_values_of_a_newer_server(self):
        newer = Session(id="wave").SerializeToString() + b"\x20\x63" + b"\xba\x3e\x03new"
        session = Session.FromString(newer)
        self.assertEqual((session.id, session.state), ("wave", 99))
        self.assertEqual(enum_name(Session.State, session.state, "STATE_"), "99")
        self.assertEqual(rigcal.Session(self.client._connection, session).state, "99")


class WithoutServer(unittest.TestCase):
    def test_calibrations_need_no_grpc(self):
        code = ("import sys; sys.modules['grpc'] = None; sys.modules['google'] = None\n"
                "import rigcal; rigcal.Calibration\n"
                "try: rigcal.Client\n"
                "except ImportError as error: print(error)\n")
        said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True,
                              check=True)
        self.assertIn("rigcal.Client needs grpc and protobuf (Debian: python3-grpcio", said.stdout)

    def test_the_release_is_that_of_the_programs(self):
        said = subprocess.run([rig_cases.program("rigcal"), "--version"], capture_output=True,
                              text=True, check=True)
        self.assertIn(rigcal.__version__, said.stdout)
