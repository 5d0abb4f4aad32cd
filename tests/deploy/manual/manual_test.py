#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Manual pages and completions: made from a help that is known, and those of the build in $RIGCAL_BUILD_DIR."""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

BUILD = pathlib.Path(os.environ["RIGCAL_BUILD_DIR"])
SCRIPTS = pathlib.Path(__file__).resolve().parents[3] / "deploy" / "manual"
sys.path.insert(0, str(SCRIPTS))

import bash_completion  # noqa: E402
import help_text  # noqa: E402
import man_page  # noqa: E402

PROGRAMS = ("rigcal", "rigcal-agent", "rigcal-server", "rigcal-worker")

HELP = """\
Solves a thing
.not a request

  thing solve --kind one

Usage: thing [OPTIONS] [SUBCOMMAND]

Options:
  -h,--help                 Print this help message and exit
  --reference-camera CAMERA Exactly as wide as the
                            column
  -o,--output-format table|json
                            Of the answer
  --log TEXT:{info,error}   Lowest level
  --prior FILE|ID           Of an earlier one
  --only Excludes: --all    These alone

What if (nothing is kept):
  --without CAMERA          Leave it out

Exit codes:
  0  ok
  1  back\\slash
"""


class HelpTextTest(unittest.TestCase):
    def setUp(self):
        self.command = help_text.parse(["thing"], HELP)

    def option(self, name):
        return next(o for o in self.command.options() if name in o.names())

    def test_reads_description_and_usage(self):
        self.assertEqual(self.command.description.split("\n")[0], "Solves a thing")
        self.assertEqual(self.command.usage, "thing [OPTIONS] [SUBCOMMAND]")

    def test_reads_options_however_wide_they_are(self):
        self.assertEqual(self.option("--reference-camera").text, "Exactly as wide as the column")
        self.assertEqual(self.option("-o").text, "Of the answer")
        self.assertEqual(self.option("--without").text, "Leave it out")

    def test_knows_which_values_are_listed(self):
        self.assertEqual(self.option("--output-format").choices(), ["table", "json"])
        self.assertEqual(self.option("--log").choices(), ["info", "error"])
        self.assertEqual(self.option("--prior").choices(), [])
        self.assertEqual(self.option("--reference-camera").choices(), [])

    def test_knows_which_options_take_a_value(self):
        self.assertEqual(self.option("--prior").value(), "FILE|ID")
        self.assertEqual(self.option("--only").value(), "")

    def test_what_is_no_list_of_options_stays_as_it_is(self):
        codes = next(s for s in self.command.sections if s.title == "Exit codes")
        self.assertEqual((codes.entries, codes.lines), ([], ["  0  ok", "  1  back\\slash"]))

    def test_refuses_what_is_no_help(self):
        for text in ("", "thing: unknown option --help\n", "Usage: thing\n\nOptions:\n  --version  Print\n"):
            with self.assertRaises(ValueError):
                help_text.parse(["thing"], text)


class ManPageTest(unittest.TestCase):
    def setUp(self):
        self.page = man_page.page(help_text.parse(["thing"], HELP), "1.2")

    def test_has_what_a_page_has(self):
        self.assertIn('.TH "THING" 1 "" "thing 1.2"', self.page)
        self.assertIn(".SH NAME\nthing \\- Solves a thing\n", self.page)
        self.assertIn('.SH "WHAT IF (NOTHING IS KEPT)"', self.page)

    def test_text_is_no_request_and_no_escape(self):
        self.assertIn("\\&.not a request", self.page)
        self.assertIn("back\\eslash", self.page)


class OfThisBuildTest(unittest.TestCase):
    def page(self, program):
        return (BUILD / "share/man/man1" / f"{program}.1").read_text()

    def complete(self, *words):
        """What bash offers for the last word."""
        script = BUILD / "share/bash-completion/completions" / words[0]
        function = "_" + words[0].replace("-", "_")
        shell = f'source "{script}"; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); {function}; echo "${{COMPREPLY[*]}}"'
        run = subprocess.run(["bash", "--norc", "-uc", shell, "bash", *words], capture_output=True, text=True)
        self.assertEqual((run.returncode, run.stderr), (0, ""))
        return run.stdout.split()

    def commands(self, program):
        """Of a program, as its own help lists them."""
        text = subprocess.run([BUILD / "bin" / program, "--help"], capture_output=True, text=True, check=True).stdout
        listed = text.partition("\nSubcommands:\n")[2].partition("\n\n")[0]
        return re.findall(r"^  ([^\s,]+)", listed, re.MULTILINE)

    def test_every_command_is_in_the_page_and_completed(self):
        for program in PROGRAMS:
            commands = self.commands(program)
            self.assertEqual(bool(commands), program != "rigcal-worker")
            for command in commands:
                self.assertIn(f".SS \"{program} {command} ".replace("-", "\\-"), self.page(program))
            if commands:
                self.assertEqual([w for w in self.complete(program, "") if not w.startswith("-")], commands)

    def test_completes_commands_options_and_values(self):
        self.assertEqual(self.complete("rigcal", "session", "st"), ["start", "stop"])
        self.assertEqual(self.complete("rigcal", "calibrate", "wave", "--intr"), ["--intrinsics"])
        self.assertEqual(self.complete("rigcal", "calibrate", "--intrinsics", ""), ["fixed", "refined", "auto"])
        self.assertEqual(self.complete("rigcal", "-o", "json", "session", "cr"), ["create"])
        self.assertEqual(self.complete("rigcal-agent", "--spool", "d"), ["disk"])
        # Another word for `camera`.
        self.assertEqual(self.complete("rigcal", "cameras", "us"), ["use"])

    def test_files_are_left_to_bash(self):
        self.assertEqual(self.complete("rigcal", "local", "--data", ""), [])
        self.assertEqual(self.complete("rigcal-server", "restore", ""), [])
        self.assertIn("complete -o default", (BUILD / "share/bash-completion/completions/rigcal").read_text())

    @unittest.skipUnless(shutil.which("man"), "man is not installed")
    def test_pages_are_set_without_a_warning(self):
        for program in PROGRAMS:
            with tempfile.TemporaryDirectory() as home:
                shown = subprocess.run(
                    ["man", "--warnings", "-l", BUILD / "share/man/man1" / f"{program}.1"], capture_output=True,
                    text=True, env=os.environ | {"MANWIDTH": "100", "HOME": home, "LC_ALL": "C.UTF-8"})
            self.assertIn("SYNOPSIS", shown.stdout)
            # A word that is longer than a line is shown as it is.
            others = [line for line in shown.stderr.splitlines() if "break line" not in line]
            self.assertEqual(others, [])


class CompletionTest(unittest.TestCase):
    def test_of_a_program_without_commands(self):
        text = bash_completion.script(help_text.parse(["thing"], HELP))
        self.assertIn('words="table json"', text)
        checked = subprocess.run(["bash", "-n"], input=text, capture_output=True, text=True)
        self.assertEqual((checked.returncode, checked.stderr), (0, ""))


if __name__ == "__main__":
    unittest.main()
