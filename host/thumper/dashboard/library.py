"""The library on the page: what the robot has, and downloads if the page runs on the robot's computer."""

import io
import zipfile
from dataclasses import asdict
from pathlib import Path

from fastapi import FastAPI, HTTPException
from fastapi.responses import FileResponse, JSONResponse, Response

from thumper.common.errors import ThumperError
from thumper.maps.library import RECORDING, checked_name, map_files, map_path
from thumper.ros import services
from thumper.ros.service import QueryClient


def add_library(app: FastAPI, robot: QueryClient, folder: Path) -> None:
    """Add the routes. A name is never a path: it is checked before it becomes a file of `folder`."""

    @app.get("/library")
    def content() -> JSONResponse:
        try:
            return JSONResponse(asdict(services.LIBRARY_LIST.call(robot)))
        except ThumperError as error:
            return JSONResponse({"error": str(error)}, status_code=502)

    @app.get("/library/maps/{name}.zip")
    def download_map(name: str) -> Response:
        files = map_files(library_map(folder, name))
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            for path in files:
                archive.write(path, path.name)
        plain = name.encode("ascii", "replace").decode()
        headers = {"Content-Disposition": f'attachment; filename="{plain}.zip"'}
        return Response(packed.getvalue(), media_type="application/zip", headers=headers)

    @app.get("/library/recordings/{name}")
    def download_recording(name: str) -> FileResponse:
        path = library_recording(folder, name)
        return FileResponse(path, filename=path.name, media_type="application/octet-stream")


def library_map(folder: Path, name: str) -> Path:
    """Return the .yaml of a map; raises HTTPException if there is none of that name."""
    path = map_path(folder, _checked(name))
    if not path.is_file():
        raise _missing(name)
    return path


def library_recording(folder: Path, name: str) -> Path:
    """Return the file of a finished recording; raises HTTPException if there is none of that name."""
    path = folder / _checked(name)
    if path.suffix != RECORDING or not path.is_file():
        raise _missing(name)
    return path


def _checked(name: str) -> str:
    try:
        return checked_name(name)
    except ThumperError as error:
        raise HTTPException(400, str(error)) from error


def _missing(name: str) -> HTTPException:
    return HTTPException(404, f"{name} is not on this computer: copy it from the robot's")
