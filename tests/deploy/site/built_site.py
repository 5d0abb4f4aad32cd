# SPDX-License-Identifier: Apache-2.0
"""A built site as a browser sees it: pages, their anchors, links and resources."""
import html.parser
import posixpath
import re
import urllib.parse

# Attributes that make a browser load something.
_LOADED = {("script", "src"), ("link", "href"), ("img", "src"), ("source", "src"), ("iframe", "src"), ("object", "data"),
           ("video", "src"), ("audio", "src"), ("image", "href"), ("image", "xlink:href"), ("use", "href"),
           ("use", "xlink:href")}


class Page(html.parser.HTMLParser):
    """`links` and `loaded` are as they stand in the page; `paragraphs` are texts outside of code."""

    def __init__(self, text):
        super().__init__()
        self.anchors, self.links, self.loaded, self.inline = [], [], [], []
        self.paragraphs, self.title = [], ""
        self._inside = None
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        for name, value in attributes:
            if name == "id":
                self.anchors.append(value)
            elif tag == "a" and name == "href":
                self.links.append(value)
            elif (tag, name) in _LOADED:
                self.loaded.append(value)
            elif name == "style" or name.startswith("on"):
                self.inline.append(f"{tag} {name}")
        if tag == "style" or (tag == "script" and "src" not in dict(attributes)):
            self.inline.append(tag)
        if tag in ("p", "td", "li"):
            self.paragraphs.append("")
        self._inside = tag

    def handle_endtag(self, tag):
        self._inside = None

    def handle_data(self, data):
        if self._inside == "title":
            self.title = data
        if self.paragraphs and self._inside not in ("code", "pre"):
            self.paragraphs[-1] += data


class Site:
    """`folder`: a pathlib.Path."""

    def __init__(self, folder):
        self.files = {str(file.relative_to(folder)): file for file in folder.rglob("*") if file.is_file()}
        self.pages = {name: Page(file.read_text(encoding="utf-8")) for name, file in self.files.items()
                      if name.endswith(".html")}

    def target(self, page, link):
        """(file in the site, anchor) that a link of a page leads to; None: it leaves the site."""
        parts = urllib.parse.urlsplit(link)
        if parts.scheme or parts.netloc:
            return None
        path = posixpath.normpath(posixpath.join(posixpath.dirname(page), urllib.parse.unquote(parts.path)))
        return (path if parts.path else page), urllib.parse.unquote(parts.fragment)

    def broken_links(self):
        faults = []
        for name, page in self.pages.items():
            for link in page.links + page.loaded:
                target = self.target(name, link)
                if target is None:
                    continue
                path, anchor = target
                if path not in self.files:
                    faults.append(f"{name} leads to {link}: there is no {path}")
                elif anchor and anchor not in self.pages[path].anchors:
                    faults.append(f"{name} leads to {link}: {path} has no such anchor")
        return faults

    def repeated_anchors(self):
        return [f"{name}#{anchor}" for name, page in self.pages.items()
                for anchor in set(page.anchors) if page.anchors.count(anchor) > 1]

    def loaded_from_elsewhere(self):
        """What a browser would fetch from another place, or refuse under the server's policy."""
        faults = [f"{name} loads {link}" for name, page in self.pages.items() for link in page.loaded
                  if self.target(name, link) is None]
        faults += [f"{name} has {what} in the page itself" for name, page in self.pages.items() for what in page.inline]
        for name, file in self.files.items():
            if name.endswith((".css", ".svg")):
                text = file.read_text(encoding="utf-8")
                faults += [f"{name} loads {found}" for found in re.findall(
                    r"""(?:url\(\s*["']?|@import\s+["']?|<(?:image|use|script)[^>]*href=["'])((?:https?:)?//[^"')\s]+)""", text)]
        return faults

    def clicks(self, first="index.html"):
        """Page to the least number of clicks from the first one."""
        clicks, at = {first: 0}, [first]
        while at:
            page = at.pop(0)
            for link in self.pages[page].links:
                target = self.target(page, link)
                if target and target[0] in self.pages and target[0] not in clicks:
                    clicks[target[0]] = clicks[page] + 1
                    at.append(target[0])
        return clicks
