#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The site of this build in $RIGCAL_BUILD_DIR, and that a site with faults is found out."""
import filecmp
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

import built_site

BUILD = pathlib.Path(os.environ["RIGCAL_BUILD_DIR"])
SOURCE = pathlib.Path(__file__).resolve().parents[3]
sys.dont_write_bytecode = True
sys.path.insert(0, str(SOURCE / "deploy" / "site"))
sys.path.insert(0, str(SOURCE / "deploy" / "manual"))

import api_pages  # noqa: E402
import help_text  # noqa: E402
import make_site  # noqa: E402
import markdown_text  # noqa: E402
import repository_pages  # noqa: E402


def made(folder, time_zone="UTC"):
    """Makes the site anew. Returns what it printed."""
    run = subprocess.run(
        [sys.executable, SOURCE / "deploy/site/make_site.py", SOURCE, BUILD / "bin", os.environ["RIGCAL_PROTOC"],
         folder / "work", folder / "site"], capture_output=True, text=True,
        env=os.environ | {"TZ": time_zone, "PYTHONHASHSEED": str(len(time_zone))})
    if run.returncode != 0:
        raise AssertionError(run.stdout + run.stderr)
    return run.stdout + run.stderr


class SiteTest(unittest.TestCase):
    maxDiff = None

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.work = pathlib.Path(cls.folder.name) / "first"
        cls.printed = made(cls.work)
        cls.site = built_site.Site(cls.work / "site")

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_is_made_without_a_warning(self):
        self.assertEqual(self.printed, "")

    def test_every_link_and_anchor_leads_somewhere(self):
        self.assertEqual(self.site.broken_links(), [])
        self.assertEqual(self.site.repeated_anchors(), [])

    def test_loads_nothing_from_elsewhere(self):
        self.assertEqual(self.site.loaded_from_elsewhere(), [])

    def test_every_page_is_within_two_clicks(self):
        clicks = self.site.clicks()
        self.assertEqual({name for name in self.site.pages if clicks.get(name, 9) > 2}, set())

    def test_every_guide_is_in_the_list_of_pages(self):
        listed = {self.site.target("index.html", link)[0] for link in self.site.pages["index.html"].links
                  if self.site.target("index.html", link)}
        guides = {str(page.relative_to(SOURCE / "docs")) for page in (SOURCE / "docs").rglob("*.md")
                  if "node_modules" not in page.parts}
        self.assertIn("usage.md", guides)
        html = {guide.removesuffix(".md").replace("README", "index") + ".html" for guide in guides}
        self.assertEqual(html - listed, set(), "add them to nav in deploy/site/mkdocs.yml")

    def test_no_markdown_is_left(self):
        left = [(name, line) for name, page in self.site.pages.items() for text in page.paragraphs
                for line in text.strip().splitlines() if re.search(r"^([-*] |#+ |\||```)|\]\(|\*\*\w|`", line)]
        self.assertEqual(left, [])

    def test_two_builds_are_equal(self):
        second = self.work.parent / "second"
        made(second, "Asia/Tokyo")
        files = sorted(self.site.files)
        self.assertEqual(sorted(built_site.Site(second / "site").files), files)
        self.assertEqual(filecmp.cmpfiles(self.work / "site", second / "site", files, shallow=False)[1:], ([], []))

    def test_has_every_command_and_call(self):
        for name in make_site.PROGRAMS:
            anchors = self.site.pages[f"commands/{name}.html"].anchors
            for command in help_text.read(BUILD / "bin" / name, [name]).all():
                self.assertIn("-".join(command.path), anchors)
        self.assertIn("calibrationservicecreatecalibration", self.site.pages["reference/calls.html"].anchors)
        self.assertIn("lensstate", self.site.pages["reference/messages.html"].anchors)

    def test_the_search_knows_every_page(self):
        text = (self.work / "site/search/search_index.js").read_text(encoding="utf-8")
        index = json.loads(text.removeprefix("window.searchIndex = ").removesuffix(";\n"))
        known = {entry["location"].split("#")[0] for entry in index["docs"]}
        self.assertEqual(set(self.site.pages) - known, set())


class FaultsTest(unittest.TestCase):
    def site(self, **pages):
        with tempfile.TemporaryDirectory() as folder:
            for name, text in pages.items():
                (pathlib.Path(folder) / f"{name}.html").write_text(text, encoding="utf-8")
            return built_site.Site(pathlib.Path(folder))

    def test_finds_a_broken_link_and_anchor(self):
        site = self.site(index='<a href="a.html#x">a</a><a href="a.html#y">b</a><a href="no.html">c</a>'
                               '<img src="no.png"><a href="https://e.org/no">d</a>', a='<h1 id="x">A</h1>')
        self.assertEqual(len(site.broken_links()), 3)

    def test_finds_what_is_loaded_from_elsewhere(self):
        for text in ('<script src="https://e.org/a.js"></script>', '<img src="//e.org/a.png">', "<style>p {}</style>",
                     '<link rel="stylesheet" href="http://e.org/a.css">', '<p style="color: red">', "<script>1</script>"):
            self.assertEqual(len(self.site(index=text).loaded_from_elsewhere()), 1, text)

    def test_counts_clicks(self):
        site = self.site(index='<a href="a.html">', a='<a href="b.html">', b='<a href="c.html">', c="", d="")
        self.assertEqual(site.clicks(), {"index.html": 0, "a.html": 1, "b.html": 2, "c.html": 3})


class PagesTest(unittest.TestCase):
    def test_links_in_code_stay(self):
        text = "[a](x.md) `[b](y.md)`\n```\n[c](z.md)\n```\n![d](p.svg)\n"
        self.assertEqual(markdown_text.with_links(text, str.upper),
                         "[a](X.MD) `[b](y.md)`\n```\n[c](z.md)\n```\n![d](P.SVG)\n")

    def test_text_is_shown_as_it_is(self):
        self.assertEqual(markdown_text.escaped("a_b <c> `d_e` [f]"), "a&#95;b &#60;c&#62; `d_e` &#91;f&#93;")
        self.assertEqual(markdown_text.fenced("```\na\n```"), "````\n```\na\n```\n````\n")

    def test_items_of_lists_continue(self):
        text = "- a\n  b\n\n      code\n\n  c\n- d\n- e\n\nf\n1. g\n   h\n2. i\n\n    j\n"
        self.assertEqual(markdown_text.with_wide_lists(text),
                         "- a\n    b\n\n        code\n\n    c\n\n- d\n- e\n\nf\n\n1. g\n    h\n2. i\n\n     j\n")

    def test_a_link_to_nothing_is_refused(self):
        with tempfile.TemporaryDirectory() as folder:
            source = pathlib.Path(folder)
            (source / "docs").mkdir()
            for link in ("docs/no.md", "../outside.md"):
                (source / "README.md").write_text(f"[a]({link})\n", encoding="utf-8")
                (source / "ARCHITECTURE.md").write_text("a\n", encoding="utf-8")
                with self.assertRaisesRegex(ValueError, "README.md links to"):
                    repository_pages.RepositoryPages(source, source / "pages").write()

    def test_an_api_without_files_is_refused(self):
        with self.assertRaises(ValueError):
            api_pages.ApiPages(api_pages.descriptor_pb2.FileDescriptorSet())


if __name__ == "__main__":
    unittest.main()
