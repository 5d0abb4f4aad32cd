#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Every command line in the guides is one that the programs of the build in $RIGCAL_BUILD_DIR know."""
import os
import pathlib
import re
import shlex
import sys
import unittest

import guides

sys.path.insert(0, str(guides.SOURCE / "deploy" / "manual"))

import help_text  # noqa: E402

PROGRAMS = ("rigcal", "rigcal-agent", "rigcal-server", "rigcal-worker")
_BEFORE = r"(?:[\w-]*\$ )?(?:\w+=\S+ )*(?:sudo |time )?(?:build/\w+/bin/)?"
_COMMAND = re.compile(_BEFORE + r"(rigcal(?:-agent|-server|-worker)?|(?:deploy|tests)/[\w./-]+\.sh)(?= |$)(.*)")


def command_lines(text):
    """[program, word, ...] of each command in the blocks of code of a page."""
    for line in guides.code_lines(text):
        for piece in re.split(r" (?:&&|\|\|?|;) |\$\(", line.strip()):
            found = _COMMAND.match(piece)
            if found:
                rest = re.sub(r"\s#.*|\s&$|\s\d?>.*", "", " " + found.group(2))
                try:
                    words = shlex.split(rest)
                except ValueError:  # a quote that ends in another line
                    words = rest.split()
                # [--keep DIR]: may be left out.
                yield [found.group(1), *[word.strip("[]") for word in words]]


def _option(commands, word):
    """The Entry of an option of one of the commands; None: it is unknown to all."""
    name = word.partition("=")[0]
    return next((entry for command in commands for entry in command.options() if name in entry.names()), None)


def fault(program, words):
    """What is wrong with a command line; "": nothing. `program`: the help_text.Command of the program."""
    path, words = [program], list(words)
    while words:
        word = words.pop(0)
        below = next((command for command in path[-1].commands if word in (command.path[-1], *command.aliases)), None)
        if below:
            path.append(below)
        elif re.match(r"--?[a-z]", word):
            option = _option(path, word)
            if option is None:
                return f"{' '.join(path[-1].path)} has no option {word}"
            if option.value() and "=" not in word and words and not option.value().startswith("["):
                words.pop(0)
        elif path[-1].commands and not path[-1].entries(lambda title: title == "Positionals"):
            if word != "..." and not word.isupper():
                return f"{' '.join(path[-1].path)} has no command {word}"
    return ""


def script_fault(script, words):
    """The same for a script of the repository: its file, and its options in its text."""
    file = guides.SOURCE / script
    if not os.access(file, os.X_OK):
        return f"{script} is no program"
    text = file.read_text(encoding="utf-8")
    # A script may hand its arguments on to others.
    others = [guides.SOURCE / other for other in re.findall(r"(?:deploy|tests)/[\w-]+\.sh", text)]
    text += "".join(other.read_text(encoding="utf-8") for other in others if other.is_file())
    unknown = [word for word in words if word.startswith("--") and word.partition("=")[0] not in text]
    return f"{script} has no option {unknown[0]}" if unknown else ""


class CommandsTest(unittest.TestCase):
    maxDiff = None

    @classmethod
    def setUpClass(cls):
        folder = pathlib.Path(os.environ["RIGCAL_BUILD_DIR"]) / "bin"
        cls.programs = {name: help_text.read(folder / name, [name]) for name in PROGRAMS}

    def fault(self, words):
        if "/" in words[0]:
            return script_fault(words[0], words[1:])
        return fault(self.programs[words[0]], words[1:])

    def test_the_guides_name_commands_and_options_that_exist(self):
        faults, count = [], 0
        for name, text in guides.pages():
            for words in command_lines(text):
                count += 1
                problem = self.fault(words)
                if problem:
                    faults.append(f"{name}: {shlex.join(words)}: {problem}")
        self.assertEqual(faults, [])
        self.assertGreater(count, 100, "the commands were not found")

    def test_what_does_not_exist_is_found(self):
        page = "```\npc$ rigcal sesion list | rigcal session list --filtr a\nrigcal calibrate wave \\\n  --wai\n" \
               "deploy/no.sh\ndeploy/demo.sh --liev\nrigcal-agent --sorce x  # --ok\n```\n"
        lines = list(command_lines(page))
        self.assertEqual(len(lines), 6)
        for words in lines:
            self.assertNotEqual(self.fault(words), "", words)

    def test_what_exists_is_not(self):
        page = "Text\n\n    $ rigcal -o json session list --filter state=STATE_FINISHED > x --no\n\n" \
               "```\nA=1 rigcal calibrate wave [--wait] && sudo deploy/demo.sh --live &\n```\n"
        lines = list(command_lines(page))
        self.assertEqual(len(lines), 3)
        for words in lines:
            self.assertEqual(self.fault(words), "")


if __name__ == "__main__":
    unittest.main()
