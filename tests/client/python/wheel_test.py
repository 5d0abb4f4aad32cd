# SPDX-License-Identifier: Apache-2.0
"""The wheel, made without network, holds all of the package."""

import os
import shutil
import subprocess
import sys
import tempfile
import unittest
import zipfile
from pathlib import Path

import rig_cases
import rigcal

PACKAGE = Path(rigcal.__file__).parent


class Wheel(unittest.TestCase):
    def test_can_be_made_and_used(self):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            # What a build of the wheel leaves behind stays out of the build's own folder.
            source = folder / "source"
            source.mkdir()
            shutil.copytree(PACKAGE, source / "rigcal",
                            ignore=shutil.ignore_patterns("__pycache__"))
            for file in ("pyproject.toml", "README.md"):
                shutil.copy(PACKAGE.parent / file, source)
            subprocess.run([sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-index",
                            "--no-build-isolation", "--wheel-dir", folder, source],
                           check=True, capture_output=True)
            wheel = folder / f"rigcal-{rigcal.__version__}-py3-none-any.whl"
            with zipfile.ZipFile(wheel) as archive:
                inside = {file for file in archive.namelist() if file.endswith(".py")}
                archive.extractall(folder / "installed")
            ours = {str(file.relative_to(PACKAGE.parent)) for file in PACKAGE.rglob("*.py")}
            self.assertEqual(inside, ours)
            self.assertIn("rigcal/v1/session_service_pb2.py", inside)
            path = rig_cases.write(rig_cases.rig(), folder)
            code = (f"import rigcal; rigcal.Client; print(rigcal.__file__); "
                    f"print(rigcal.Calibration.load({str(path)!r}).id)")
            said = subprocess.run(
                [sys.executable, "-c", code], check=True, capture_output=True, text=True,
                cwd=folder, env={**os.environ, "PYTHONPATH": str(folder / "installed")})
            self.assertEqual(said.stdout.split(),
                             [str(folder / "installed/rigcal/__init__.py"), "c-000009"])
