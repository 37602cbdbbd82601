"""Edits of a saved map: rotate, crop, fill boxes. Zones and places follow; the result is a new map."""

import asyncio
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from fastapi import FastAPI, HTTPException, Request
from fastapi.responses import Response
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from thumper.common.errors import ThumperError
from thumper.common.texts import shortened
from thumper.dashboard.binary_packet import encode_packet, grid_png
from thumper.dashboard.library import library_map
from thumper.dashboard.map_image import grid_info
from thumper.dashboard.page_messages import Metres, Name
from thumper.dashboard.rate_limit import RateLimit
from thumper.maps import edit
from thumper.maps.annotations import Annotations, annotations_path, load_annotations
from thumper.maps.library import map_files, map_path
from thumper.maps.map_server_io import load_rotated_map
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from thumper.slam.edited_map import save_edited_map

MAX_EDITS = 100
MAX_BODY_BYTES = 32768
BODY_TIMEOUT_S = 10.0
RATE_HZ, BURST = 4.0, 20  # requests of all pages together
STATES = {"free": FREE, "wall": OCCUPIED, "unknown": UNKNOWN}


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class BoxEdit(_Strict):
    """Keep only a box, or set the state of its cells; corners in the map as edited so far."""

    edit: Literal["crop", "free", "wall", "unknown"]
    corners_m: Annotated[list[Metres], Field(min_length=4, max_length=4)]  # x0, y0, x1, y1


class Rotation(_Strict):
    """Rotate counter-clockwise about the origin of the map's frame."""

    edit: Literal["rotate"]
    angle_deg: Annotated[FiniteFloat, Field(ge=-360.0, le=360.0)]


class MapEdits(_Strict):
    """What the page sends: all edits from the saved map on, and the name of the result to save it."""

    edits: Annotated[list[BoxEdit | Rotation], Field(max_length=MAX_EDITS)]
    save_as: Name | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class EditedMap:
    """A map after some edits."""

    grid: OccupancyGrid
    annotations: Annotations
    rotation_rad: float = 0.0  # of the robot's pose in the map's session


def add_map_edits(app: FastAPI, folder: Path) -> None:
    """Add the route that shows and saves an edited map."""
    limit = RateLimit(RATE_HZ, BURST)
    one_at_a_time = asyncio.Semaphore()

    @app.post("/library/maps/{name}/edit")
    async def edit_map(name: str, request: Request) -> Response:
        path = library_map(folder, name)
        if not limit.allows():
            raise HTTPException(429, "too many edits; wait a second")
        try:
            wanted = MapEdits.model_validate_json(await _body(request))
        except ValidationError as error:
            problem = error.errors(include_url=False, include_input=False)[0]
            raise HTTPException(422, shortened(f"refused: {problem['msg']}")) from None
        async with one_at_a_time:
            try:
                content = await asyncio.to_thread(_answer, path, folder, wanted)
            except ThumperError as error:
                raise HTTPException(422, str(error)) from error
        return Response(content, media_type="application/octet-stream")


def edited(path: Path, edits: list[BoxEdit | Rotation]) -> EditedMap:
    """Load a map and return it after the edits.

    Raises
    ------
    ThumperError
        The map cannot be read, or a box lies outside it.
    """
    grid, _ = load_rotated_map(path)
    annotations = load_annotations(annotations_path(path))
    rotation_rad = 0.0
    for step in edits:
        if isinstance(step, Rotation):
            angle_rad = math.radians(step.angle_deg)
            grid = edit.trim(edit.rotate(grid, angle_rad))  # each rotation adds unknown corners
            annotations = annotations.rotated(angle_rad)
            rotation_rad += angle_rad
        else:
            x0_m, y0_m, x1_m, y1_m = step.corners_m
            box = edit.Box(x0_m=x0_m, y0_m=y0_m, x1_m=x1_m, y1_m=y1_m)
            crops = step.edit == "crop"  # which moves nothing: zones and places keep their positions
            grid = edit.crop(grid, box) if crops else edit.fill_box(grid, box, STATES[step.edit])
    return EditedMap(grid=grid, annotations=annotations, rotation_rad=rotation_rad)


def _answer(path: Path, folder: Path, wanted: MapEdits) -> bytes:
    result = edited(path, wanted.edits)
    if wanted.save_as is not None:
        out = map_path(folder, wanted.save_as)
        if map_files(out):
            raise ThumperError(f"there is a map {wanted.save_as!r} already: choose another name")
        save_edited_map(path, out, result.grid, result.annotations, rotation_rad=result.rotation_rad)
    values = {"map": grid_info(result.grid), "annotations": result.annotations.to_geojson()}
    return encode_packet(values, {"map": grid_png(result.grid.cells)})


async def _body(request: Request) -> bytes:
    body = b""
    try:
        async with asyncio.timeout(BODY_TIMEOUT_S):
            async for chunk in request.stream():
                body += chunk
                if len(body) > MAX_BODY_BYTES:
                    raise HTTPException(413, "too many edits at once; save the map, then edit the result")
    except TimeoutError:
        raise HTTPException(408, "too slow") from None
    return body
