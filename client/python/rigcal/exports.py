# SPDX-License-Identifier: Apache-2.0
"""Writes exported calibrations."""

import io
import zipfile
from pathlib import Path, PurePosixPath

from rigcal.errors import RigcalError


def write_export(
    name: str, content_type: str, content: bytes, path: Path, force: bool
) -> list[Path]:
    """Writes the files of an export into a folder, which is made where missing.

    Args:
        name: Of the one file, where the export is no archive.
        content_type: As the server gave it.
        content: The file, or a ZIP archive of several.
        path: The folder; or, of an export of one file, that file, told by its ending.
        force: Replace files that exist.

    Returns:
        The files written.

    Raises:
        RigcalError: A file exists, or the folder cannot be written.
    """
    if content_type == "application/zip":
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            files = {info.filename: archive.read(info) for info in archive.infolist()}
        folder = path
    elif path.suffix == PurePosixPath(name).suffix:
        files, folder = {path.name: content}, path.parent
    else:
        files, folder = {name: content}, path
    paths = {}
    for file in files:
        relative = PurePosixPath(file)
        if relative.is_absolute() or ".." in relative.parts:
            raise RigcalError(f"the export holds {file}, which is not written")
        paths[file] = folder / relative
        if paths[file].exists() and not force:
            raise RigcalError(f"{paths[file]} exists; force=True replaces it")
    try:
        for file, path in paths.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(files[file])
    except OSError as error:
        raise RigcalError(f"cannot write the export to {folder}: {error.strerror}") from None
    return list(paths.values())
