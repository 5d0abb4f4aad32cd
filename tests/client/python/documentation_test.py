# SPDX-License-Identifier: Apache-2.0
"""The examples of the pages on Python run, one after the other, against a real server."""

import contextlib
import io
import os
import re
import unittest
from pathlib import Path
from unittest import mock

from running_rig import RunningRig

DOCS = Path(os.environ["RIGCAL_SOURCE_DIR"]) / "docs"
PAGES = (DOCS / "python.md", DOCS / "python_wave_to_plot.md")
LONGEST_EXAMPLE = 12


def examples(page):
    """The code of each block, with the line where it begins."""
    text = page.read_text()
    for found in re.finditer(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
        yield text.count("\n", 0, found.start(1)) + 1, found[1]


class Page(unittest.TestCase):
    def run_examples(self, page):
        """The names that all examples of a page leave, what each prints, and where they ran."""
        rig = RunningRig()
        self.addCleanup(rig.close)
        rig.start_agent("duration=600;rate=50;speed=8")
        rig.wait_for(lambda: rig.rigcal("agent", "list").count("sim:camera=") == 4)
        folder = rig.folder / "examples"
        folder.mkdir()
        names, printed = {}, []
        before = os.getcwd()
        os.chdir(folder)
        self.addCleanup(os.chdir, before)
        for line, code in examples(page):
            out = io.StringIO()
            with mock.patch.dict(os.environ, {"RIGCAL_SERVER": rig.address}):
                with contextlib.redirect_stdout(out):
                    # As many lines before it as on the page, for what is raised.
                    exec(compile("\n" * (line - 1) + code, page, "exec"), names)
            printed.append(out.getvalue())
        names["client"].close()
        return names, printed, folder

    def test_all_examples_run(self):
        names, printed, folder = self.run_examples(PAGES[0])
        self.assertEqual(len(printed), 4)
        _, alone, live, rest = printed
        self.assertGreater((folder / "wave.png").stat().st_size, 10_000)
        self.assertGreater(len(names["points"]), 0)
        self.assertIn("[4 4 4]", alone)
        self.assertRegex(live.splitlines()[-1], r"\d+ \[.*\]")
        self.assertRegex(rest, r"NOT_FOUND .*nowhere")

    def test_all_steps_run(self):
        _, printed, folder = self.run_examples(PAGES[1])
        self.assertEqual(len(printed), 4)
        wave, calibrated, measured, _ = printed
        self.assertRegex(wave, r"\d\.\d mm")
        self.assertRegex(calibrated, r"c-000001 (good|usable) \d+\.\d\d mm")
        self.assertRegex(measured, r"0\.13 m is measured as 0\.1(29[5-9]|30[0-5])")
        self.assertGreater((folder / "steps.png").stat().st_size, 10_000)

    def test_examples_are_short(self):
        for page in PAGES:
            for line, code in examples(page):
                self.assertLessEqual(
                    len(code.strip().splitlines()), LONGEST_EXAMPLE, f"{page}:{line}")

    def test_the_page_is_short(self):
        for page in PAGES:
            self.assertLessEqual(len(page.read_text().splitlines()), 120, page)
