#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Makes the documentation as a site that needs no network.

make_site.py SOURCE PROGRAMS PROTOC WORK SITE: SOURCE is the repository, PROGRAMS the folder with the
built programs, PROTOC the compiler of protos, WORK a folder for the pages before mkdocs has seen them.
SITE is replaced. A broken link is an error.
"""
import os
import pathlib
import shutil
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "manual"))

import api_pages  # noqa: E402
import command_pages  # noqa: E402
import help_text  # noqa: E402
import repository_pages  # noqa: E402

PROGRAMS = ("rigcal", "rigcal-agent", "rigcal-server", "rigcal-worker")


def _write(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def _api(source, protoc, work):
    protos = source / "proto"
    described = work / "api.pb"
    files = sorted(str(file.relative_to(protos)) for file in (protos / "rigcal" / "v1").glob("*.proto"))
    subprocess.run([protoc, f"--proto_path={protos}", "--include_source_info",
                    f"--descriptor_set_out={described}", *files], check=True)
    return api_pages.ApiPages(api_pages.descriptor_pb2.FileDescriptorSet.FromString(described.read_bytes()))


def make_pages(source, programs, protoc, work):
    """Everything that mkdocs reads, in WORK/pages."""
    pages = work / "pages"
    shutil.rmtree(pages, ignore_errors=True)
    pages.mkdir(parents=True)
    repository_pages.RepositoryPages(source, pages).write()
    for name in PROGRAMS:
        _write(pages / "commands" / f"{name}.md", command_pages.page(help_text.read(programs / name, [name])))
    api = _api(source, protoc, work)
    _write(pages / "reference" / "calls.md", api.calls())
    _write(pages / "reference" / "messages.md", api.messages())
    return pages


def main(arguments):
    if len(arguments) != 5:
        sys.exit(__doc__)
    source, programs, protoc, work, site = arguments
    try:
        pages = make_pages(pathlib.Path(source), pathlib.Path(programs), protoc, pathlib.Path(work))
    except ValueError as error:
        sys.exit(f"make_site: {error}")
    environment = os.environ | {"RIGCAL_SITE_PAGES": str(pages.resolve()),
                                "RIGCAL_SITE_FOLDER": str(pathlib.Path(site).resolve()),
                                # The page of each file has a date in its metadata; it is not shown.
                                "SOURCE_DATE_EPOCH": os.environ.get("SOURCE_DATE_EPOCH", "0")}
    run = subprocess.run([sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "--clean",
                          "--config-file", str(HERE / "mkdocs.yml")], env=environment, check=False)
    sys.exit(run.returncode)


if __name__ == "__main__":
    sys.dont_write_bytecode = True
    main(sys.argv[1:])
