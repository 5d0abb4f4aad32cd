#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Makes a program's manual page and bash completion from what it prints with --help.

make_manual.py PROGRAM VERSION FOLDER: writes FOLDER/man/man1/NAME.1 and
FOLDER/bash-completion/completions/NAME.
"""
import os
import sys

import bash_completion
import help_text
import man_page


def _write(path, text):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)


def main(arguments):
    if len(arguments) != 3:
        sys.exit(__doc__)
    program, version, folder = arguments
    name = os.path.basename(program)
    command = help_text.read(program, [name])
    _write(os.path.join(folder, "man", "man1", name + ".1"), man_page.page(command, version))
    completions = os.path.join(folder, "bash-completion", "completions")
    _write(os.path.join(completions, name), bash_completion.script(command))


if __name__ == "__main__":
    sys.dont_write_bytecode = True
    main(sys.argv[1:])
