# SPDX-License-Identifier: Apache-2.0
"""What mkdocs does differently for this site: anchors as on code hosts, and a search without a server."""
import os
import re
import shutil

from mkdocs.contrib import search
from mkdocs.plugins import event_priority


def anchor(heading, separator):
    """The anchor of a heading as links in the repository name it: "Who may call what" gives
    "who-may-call-what"; each space becomes one separator, punctuation goes."""
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", separator)


def on_config(config):
    config["mdx_configs"]["toc"]["slugify"] = anchor
    return config


@event_priority(-100)  # after the plugin that writes the index
def on_post_build(config):
    """Browsers let a page from a disk run scripts, but not fetch the index."""
    site = config["site_dir"]
    folder = os.path.join(site, "search")
    index = os.path.join(folder, "search_index.json")
    with open(index, encoding="utf-8") as file:
        text = file.read()
    with open(os.path.join(folder, "search_index.js"), "w", encoding="utf-8") as file:
        file.write(f"window.searchIndex = {text};\n")
    os.remove(index)
    # Debian's mkdocs has it as a link to libjs-lunr.
    lunr = os.path.join(os.path.dirname(search.__file__), "templates", "search", "lunr.js")
    shutil.copyfile(lunr, os.path.join(folder, "lunr.js"))
    # The map names addresses, of which this site has none, and its compressed copy the time of the build.
    for name in ("sitemap.xml", "sitemap.xml.gz"):
        path = os.path.join(site, name)
        if os.path.exists(path):
            os.remove(path)
