# SPDX-License-Identifier: Apache-2.0
"""The guides of the repository: where they are, their code and their prose."""
import pathlib
import re
import sys

SOURCE = pathlib.Path(__file__).resolve().parents[3]
sys.path.insert(0, str(SOURCE / "deploy" / "site"))

import markdown_text  # noqa: E402


def pages():
    """(name, text) of every page."""
    files = [SOURCE / "README.md", SOURCE / "ARCHITECTURE.md", *sorted((SOURCE / "docs").rglob("*.md"))]
    return [(str(file.relative_to(SOURCE)), file.read_text(encoding="utf-8")) for file in files
            if "node_modules" not in file.parts]


def code_lines(text):
    """Lines of fenced and indented blocks of code; lines that end with a backslash are joined."""
    lines, blank = [], True
    for is_code, part in markdown_text.parts(text):
        inside = part.splitlines()
        if is_code:
            lines += inside[1:-1]
            continue
        for line in inside:
            # Within an item of a list, the text that continues it is not indented this far.
            is_block = re.match(r" {4}\S| {6,}\S", line) and blank
            if is_block:
                lines.append(line.strip())
            blank = not line.strip() or bool(is_block)
    return re.sub(r"\s*\\\n\s*", " ", "\n".join(lines)).splitlines()


def sentences(text):
    """Of the prose and the cells of tables, with their marks; headings and code are left out."""
    prose = "".join("\n\n" if is_code else part for is_code, part in markdown_text.parts(text))
    for block in re.split(r"\n[ \t]*\n|\n(?=[-*] |\d+\. |\|)", prose):
        if block.startswith(("    ", "#", "|--", "![")):
            continue
        for cell in re.split(r"(?<!\\)\|", block) if block.startswith("|") else [block]:
            for sentence in re.split(r"(?<=[.!?:])\s+", " ".join(cell.split())):
                yield sentence.strip("-* ")
