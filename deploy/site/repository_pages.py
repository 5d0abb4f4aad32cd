# SPDX-License-Identifier: Apache-2.0
"""Lays the pages of the repository out for the site. Their links stay those that work in the repository.

docs/x.md becomes x.md; README.md and ARCHITECTURE.md stay; docs/README.md, their index, is guides.md. A link to another file of the repository
leads to a page that shows it, files/PATH; one to the protos leads to the reference of the API.
"""
import os
import pathlib
import shutil

import markdown_text

_PICTURES = (".svg", ".png", ".webp", ".jpg", ".gif")
_NOT_OURS = ("node_modules", "dist")
# Folders that have a page of their own.
_REFERENCES = {"proto/rigcal/v1": "reference/messages.md"}


class RepositoryPages:
    """`source`: the repository; `pages`: the folder that is filled."""

    def __init__(self, source, pages):
        self._source = pathlib.Path(source).resolve()
        self._pages = pathlib.Path(pages)
        self._done = set()

    def write(self):
        """ValueError: a link leads to nothing; the text says where."""
        for name in ["README.md", "ARCHITECTURE.md"]:
            self._add(name)
        for page in sorted((self._source / "docs").rglob("*.md")):
            path = page.relative_to(self._source)
            if not set(_NOT_OURS) & set(path.parts):
                self._add(str(path))

    def _place(self, path):
        """Where a file or folder of the repository is in the site's source."""
        if path in _REFERENCES:
            return _REFERENCES[path]
        if path == "docs/README.md":  # the first page is README.md
            return "guides.md"
        if path.endswith(".md"):
            return path.removeprefix("docs/")
        if path.endswith(_PICTURES):
            return path.removeprefix("docs/")
        return f"files/{path}.md"

    def _add(self, path):
        """Writes what is at `path` in the repository, and what that links to. Returns its place."""
        place = self._place(path)
        if path in self._done or path in _REFERENCES:
            return place
        self._done.add(path)
        source, target = self._source / path, self._pages / place
        target.parent.mkdir(parents=True, exist_ok=True)
        if path.endswith(".md"):
            target.write_text(self._page(path, place), encoding="utf-8")
        elif path.endswith(_PICTURES):
            shutil.copyfile(source, target)
        else:
            target.write_text(self._shown(source, path), encoding="utf-8")
        return place

    def _page(self, path, place):
        def change(target):
            if "://" in target or target.startswith(("#", "mailto:")):
                return target
            name, mark, anchor = target.partition("#")
            linked = os.path.normpath(os.path.join(os.path.dirname(path), name))
            if linked.startswith("..") or not (self._source / linked).exists():
                raise ValueError(f"{path} links to {target}, which does not exist; correct the link")
            return os.path.relpath(self._add(linked), os.path.dirname(place) or ".") + mark + anchor
        text = (self._source / path).read_text(encoding="utf-8")
        return markdown_text.with_wide_lists(markdown_text.with_links(text, change))

    def _shown(self, source, path):
        """A page with the text of a file, or of the files of a folder."""
        if source.is_file():
            return f"# {path}\n\n" + markdown_text.fenced(source.read_text(encoding="utf-8"))
        text = f"# {path}\n\n"
        for file in sorted(source.rglob("*")):
            if file.is_file():
                text += f"## {file.relative_to(source)}\n\n"
                text += markdown_text.fenced(file.read_text(encoding="utf-8")) + "\n"
        return text
