#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What `install-deps.sh --agent` installs, against the agent of the build in $RIGCAL_BUILD_DIR."""
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

SCRIPT = pathlib.Path(__file__).resolve().parents[3] / "deploy/install-deps.sh"
AGENT = pathlib.Path(os.environ["RIGCAL_BUILD_DIR"]) / "bin/rigcal-agent"
VERSION = pathlib.Path("/etc/debian_version")
IS_KNOWN = VERSION.exists() and VERSION.read_text().startswith(("12.", "13."))


def run_script(*arguments):
    """As on a PC where no package is installed."""
    with tempfile.TemporaryDirectory() as folder:
        query = pathlib.Path(folder) / "dpkg-query"
        query.write_text("#!/bin/sh\nexit 1\n")
        query.chmod(0o755)
        return subprocess.run([SCRIPT, *arguments], capture_output=True, text=True,
                              env=os.environ | {"PATH": f"{folder}:{os.environ['PATH']}"})


def agent_packages():
    return run_script("--agent", "--list").stdout.split()


class Packages:
    """The installed ones, with what they depend on."""

    def __init__(self):
        fields = "${Package}\t${Provides}\t${Depends}, ${Pre-Depends}\t${db:Status-Status}\n"
        lines = subprocess.run(["dpkg-query", "-W", "-f", fields], capture_output=True, text=True,
                               check=True).stdout.splitlines()
        self.depends = {}
        self.providers = {}  # of virtual packages
        for line in lines:
            name, provides, depends, status = line.split("\t")
            if status != "installed":
                continue
            self.depends[name] = [group for group in depends.split(",") if group.strip()]
            for alias in filter(None, provides.split(",")):
                self.providers.setdefault(self.bare(alias), set()).add(name)

    @staticmethod
    def bare(text):
        return re.split(r"[\s(:]", text.strip(), maxsplit=1)[0]

    def closure(self, names, alternatives=False):
        """With `alternatives` all of "a | b" that are here, else the first, as apt on a bare PC."""
        found, waiting = set(), list(names)
        while waiting:
            for name in self.meant(waiting.pop(), alternatives):
                if name not in found:
                    found.add(name)
                    waiting += self.depends[name]
        return found

    def meant(self, dependency, alternatives):
        names = [self.bare(alternative) for alternative in dependency.split("|")]
        found = [{name} for name in names if name in self.depends]
        found += [self.providers[name] for name in names if name in self.providers]
        return set().union(*(found if alternatives else found[:1]))

    @staticmethod
    def owners(files):
        """Of libraries, by their file; Debian 12 knows some of /usr/lib by /lib."""
        paths = [p for f in files for p in (f, f.removeprefix("/usr"))]
        answer = subprocess.run(["dpkg", "-S", *paths], capture_output=True, text=True).stdout
        owners = {}
        for line in answer.splitlines():
            if line.startswith("diversion by "):  # where Debian 13 moved /lib to /usr/lib
                continue
            package, path = line.split(": ", 1)
            name = path if path.startswith("/usr") else "/usr" + path
            owners[name] = package.split(":")[0]
        return owners


class AgentPackagesTest(unittest.TestCase):
    def test_are_few_and_libraries_only(self):
        packages = agent_packages()
        self.assertGreater(len(packages), 10)
        self.assertEqual(len(packages), len(set(packages)))
        for package in packages:
            self.assertRegex(package, r"^(lib|zlib)")
            self.assertFalse(package.endswith("-dev"), package)

    @unittest.skipUnless(IS_KNOWN and shutil.which("dpkg"), "the lists are those of Debian 12 and 13")
    def test_bring_no_compiler_and_nothing_of_the_page(self):
        brought = Packages().closure(agent_packages())
        self.assertIn("libstdc++6", brought)  # of the list; the test looks at something
        self.assertTrue(any(p.startswith("libglib2.0-0") for p in brought))
        tools = re.compile(r"(g\+\+|gcc|cpp|clang|binutils|nodejs|npm|chromium|cmake|ninja)\b")
        self.assertEqual([p for p in brought if p.endswith("-dev")
                          or (tools.match(p) and not p.endswith("-base"))], [])

    @unittest.skipUnless(IS_KNOWN and shutil.which("dpkg"), "the lists are those of Debian 12 and 13")
    @unittest.skipUnless(AGENT.exists(), "bin/rigcal-agent is not built")
    def test_bring_every_library_of_the_agent(self):
        lines = subprocess.run(["ldd", AGENT], capture_output=True, text=True, check=True).stdout
        self.assertNotIn("not found", lines)
        files = sorted({os.path.realpath(path)
                        for path in re.findall(r"(?:=> |^\s*)(/\S+) \(0x", lines, re.M)})
        # Of a build with sanitizers, these are of the compiler.
        files = [f for f in files if not re.search(r"lib(asan|tsan|ubsan)\.so", f)]
        self.assertGreater(len(files), 50)
        packages = Packages()
        brought = packages.closure(agent_packages(), alternatives=True)  # such as a faster BLAS
        owners = packages.owners(files)
        missing = {f: owners.get(f, "no package") for f in files if owners.get(f) not in brought}
        self.assertEqual(missing, {}, "deploy/install-deps.sh --agent does not bring these")

    def test_arguments_that_are_not_known_are_refused(self):
        answer = run_script("--agents", "--list")
        self.assertEqual(answer.returncode, 2)
        self.assertIn("--agents", answer.stderr)
        self.assertEqual(answer.stdout, "")

    def test_without_agent_the_list_is_that_of_a_build(self):
        packages = run_script("--list").stdout.split()
        self.assertIn("cmake", packages)
        self.assertNotIn("debhelper", packages)
        self.assertIn("debhelper", run_script("--packages", "--list").stdout.split())


if __name__ == "__main__":
    unittest.main()
