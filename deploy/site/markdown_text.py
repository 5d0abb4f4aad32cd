# SPDX-License-Identifier: Apache-2.0
"""Pieces of Markdown: what is code in a page and what is not, and plain text as Markdown."""
import re

_CODE_OR_LINK = re.compile(r"(`+)(?!`).+?(?<!`)\1(?!`)|\]\(([^()\s]+)\)", re.DOTALL)


def parts(text):
    """Yields (is_code, text of whole lines): fenced blocks with their fences, and what is between."""
    kept, fence = [], ""
    for line in text.splitlines(keepends=True):
        mark = re.match(r" {0,3}(`{3,}|~{3,})", line)
        if mark and not fence:
            if kept:
                yield False, "".join(kept)
            kept, fence = [line], mark.group(1)
        elif mark and mark.group(1).startswith(fence) and not line.strip().strip(fence[0]):
            yield True, "".join(kept) + line
            kept, fence = [], ""
        else:
            kept.append(line)
    if kept:
        yield bool(fence), "".join(kept)


def with_links(text, change):
    """The page with change(target) for the target of every link and picture that is not in code."""
    def replaced(found):
        return f"]({change(found.group(2))})" if found.group(2) else found.group(0)
    return "".join(part if is_code else _CODE_OR_LINK.sub(replaced, part) for is_code, part in parts(text))


def with_wide_lists(text):
    """The page with lists as Python-Markdown, which mkdocs uses, wants them: four spaces before what continues
    an item (its tab_length; code hosts ask for as many as its mark has), and a blank line before an item
    behind a paragraph."""
    return "".join(part if is_code else _wide_lists(part) for is_code, part in parts(text))


def _wide_lists(text):
    out, width, after_blank = [], 0, True
    paragraphs = False  # the item has several
    for line in text.splitlines(keepends=True):
        mark = re.match(r"([-*+] |1\. )\S" if not width else r"([-*+] |\d+[.)] )\S", line)
        if mark:
            if not after_blank and (paragraphs or not width):
                out.append("\n")
            width, paragraphs = len(mark.group(1)), False
        elif width and line.strip() and after_blank:
            paragraphs = line.startswith(" " * width)
            width = width if paragraphs else 0
        if width and not mark and line.startswith(" " * width) and line.strip():
            line = " " * (4 - width) + line
        after_blank = not line.strip()
        out.append(line)
    return "".join(out)


def escaped(text):
    """Plain text as Markdown that shows it as it is; what is in `backticks` stays code."""
    pieces = re.split(r"(`[^`\n]+`)", text)
    return "".join(p if i % 2 else re.sub(r"([\\*_\[\]<>#|`])", _entity, p) for i, p in enumerate(pieces))


def _entity(found):
    return f"&#{ord(found.group(1))};"


def cell(text):
    """Markdown in one cell of a table."""
    return " ".join(text.replace("|", "&#124;").split())


def fenced(text, language=""):
    """A block of code that may itself contain fences."""
    longest = max((len(found) for found in re.findall(r"`+", text)), default=0)
    fence = "`" * max(3, longest + 1)
    return f"{fence}{language}\n{text.rstrip()}\n{fence}\n"
