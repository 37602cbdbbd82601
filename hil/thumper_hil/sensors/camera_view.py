"""Render what a pinhole camera sees of the world: floor, walls and tags, as grey values, and coloured boxes.

Walls end at `WALL_M`. Their grey depends on the distance only, so nothing but a tag has corners. A tag is
drawn through the homography of its four corners, at several times the resolution of the image, so that its
edges are true to a fraction of a pixel.
"""

import math
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper_hil.world.paint import PaintedBox
from thumper_hil.world.segment_raycast import cast_rays
from thumper_hil.world.tag_shape import TagShape
from thumper_hil.world.world import World

GreyImage = NDArray[np.float32]

WALL_M = 2.5
FLOOR_GREY, CEILING_GREY, WALL_GREY, FADING_M = 95.0, 215.0, 185.0, 12.0
BLACK, WHITE = 25.0, 225.0
SUPERSAMPLING = 3
TAG_CELLS, PAPER_CELLS = 8, 10  # of a 36h11 tag, and with its white border
NEAR_M = 0.02
BEHIND_WALL_M = 0.03
RAYS_PER_PIXEL = 1.0


@cache
def tag_texture(number: int, cell_px: int) -> GreyImage:
    """Return the paper with tag `number` of the family 36h11, upright as in AprilRobotics/apriltag-imgs.

    OpenCV's tags of this family stand on their heads.
    """
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    tag = cv2.aruco.generateImageMarker(family, number, TAG_CELLS * cell_px)
    paper = np.pad(np.rot90(tag, 2), (PAPER_CELLS - TAG_CELLS) // 2 * cell_px, constant_values=255)
    return np.asarray(BLACK + (WHITE - BLACK) / 255.0 * paper, np.float32)


def _ranges_m(origins_m: FloatArray, angles_rad: FloatArray, sides_m: FloatArray) -> GreyImage:
    """Return the distance along each ray to the sides of a box, +inf for none, shape (n,)."""
    ranges_m, hit = np.empty(angles_rad.size), np.empty(angles_rad.size, np.int32)
    cast_rays(origins_m, angles_rad, sides_m, np.zeros((0, 3)), ranges_m, hit)
    return ranges_m.astype(np.float32)


class CameraView:
    """A camera with the matrix `matrix`, shape (3, 3), mounted at `base_from_optical`, shape (4, 4)."""

    def __init__(self, size_px: tuple[int, int], matrix: FloatArray, base_from_optical: FloatArray) -> None:
        self._size_px, self._matrix, self._base_from_optical = size_px, matrix, base_from_optical
        columns, rows = np.meshgrid(np.arange(size_px[0]), np.arange(size_px[1]))
        pixels = np.stack([columns, rows, np.ones_like(columns)], axis=-1).reshape(-1, 3)
        rays = pixels @ np.linalg.inv(matrix).T @ base_from_optical[:3, :3].T
        azimuth_rad = np.arctan2(rays[:, 1], rays[:, 0]).reshape(rows.shape)
        slope = (rays[:, 2] / np.hypot(rays[:, 0], rays[:, 1])).reshape(rows.shape)
        low_rad, high_rad = float(azimuth_rad.min()), float(azimuth_rad.max())
        self._angles_rad = np.linspace(low_rad, high_rad, round(RAYS_PER_PIXEL * size_px[0]))
        step_rad = (high_rad - low_rad) / (self._angles_rad.size - 1)
        self._ray_of_pixel = np.rint((azimuth_rad - low_rad) / step_rad).astype(np.int32)
        self._slope = slope.astype(np.float32)

    def render(self, world: World, map_from_base: Pose2) -> GreyImage:
        """Return the image with values 0...255, shape (height, width).

        In a world with coloured boxes its shape is (height, width, 3): blue, green, red as in OpenCV.
        """
        base_from_map = np.eye(4)
        inverse = map_from_base.inverse()
        cos, sin = math.cos(inverse.theta_rad), math.sin(inverse.theta_rad)
        base_from_map[:2, :2] = ((cos, -sin), (sin, cos))
        base_from_map[:2, 3] = inverse.x_m, inverse.y_m
        optical_from_map = np.linalg.inv(self._base_from_optical) @ base_from_map
        mount = self._base_from_optical[:3, 3]
        x_m, y_m = map_from_base.apply(mount[None, :2])[0]
        angles_rad = map_from_base.theta_rad + self._angles_rad
        ranges_m = world.cast_behind_painted(float(x_m), float(y_m), angles_rad).astype(np.float32)
        walls_m = ranges_m[self._ray_of_pixel]
        with np.errstate(invalid="ignore"):
            height_m = float(mount[2]) + self._slope * walls_m
        image = np.asarray(np.clip(WALL_GREY - FADING_M * walls_m, 60.0, 255.0), np.float32)
        image[height_m <= 0.0] = FLOOR_GREY
        image[height_m >= WALL_M] = CEILING_GREY
        for tag in world.tags:
            self._draw(image, tag, optical_from_map, walls_m)
        if not world.painted:
            return image
        image = np.repeat(image[..., None], 3, axis=2)
        origins_m = np.tile((x_m, y_m), (angles_rad.size, 1))
        for box in world.painted:
            self._paint(image, box, walls_m, _ranges_m(origins_m, angles_rad, box.sides_m))
        return image

    def _paint(self, image: GreyImage, box: PaintedBox, nearest_m: GreyImage, ranges_m: GreyImage) -> None:
        """Colour the pixels whose rays reach a box before anything else; then it is what is nearest."""
        ranges_m = ranges_m[self._ray_of_pixel]
        with np.errstate(invalid="ignore"):
            height_m = float(self._base_from_optical[2, 3]) + self._slope * ranges_m
            seen = (ranges_m < nearest_m) & (height_m > 0.0) & (height_m < box.paint.height_m)
        image[seen] = box.paint.colour[::-1]
        nearest_m[seen] = ranges_m[seen]

    def _draw(
        self, image: GreyImage, tag: TagShape, optical_from_map: FloatArray, walls_m: GreyImage
    ) -> None:
        """Draw a tag over the pixels whose rays reach it before a wall."""
        paper_m = tag.size_m * PAPER_CELLS / TAG_CELLS
        corners_m = np.column_stack([tag.corners_m(paper_m), np.ones(4)]) @ optical_from_map.T
        facing = float(np.dot(tag.normal(), (np.linalg.inv(optical_from_map)[:3, 3] - tag.centre_m())))
        if facing <= 0.0 or corners_m[:, 2].min() < NEAR_M:
            return
        seen = corners_m[:, :3] @ self._matrix.T
        corners_px = seen[:, :2] / seen[:, 2:]
        width_px, height_px = self._size_px
        left, top = (max(0, math.floor(float(low)) - 1) for low in corners_px.min(axis=0))
        right = min(width_px, math.ceil(float(corners_px[:, 0].max())) + 2)
        bottom = min(height_px, math.ceil(float(corners_px[:, 1].max())) + 2)
        if right <= left or bottom <= top:
            return
        part = np.s_[top:bottom, left:right]
        cell_px = float(np.hypot(*(corners_px[1] - corners_px[0]))) / PAPER_CELLS
        cell_texels = min(64, max(2, round(SUPERSAMPLING * cell_px)))
        texture = tag_texture(tag.number, cell_texels)
        side = float(texture.shape[0])
        # Corner of a texture: half a texel outside the centre of the first one; likewise for the fine image.
        texels = np.array([[0, 0], [side, 0], [side, side], [0, side]], np.float32) - 0.5
        fine_px = SUPERSAMPLING * (corners_px - (left, top) + 0.5) - 0.5
        homography = cv2.getPerspectiveTransform(texels, fine_px.astype(np.float32))
        fine = (SUPERSAMPLING * (right - left), SUPERSAMPLING * (bottom - top))
        drawn = cv2.warpPerspective(texture, homography, fine)
        mask = cv2.warpPerspective(np.ones_like(texture), homography, fine)
        coarse = (right - left, bottom - top)
        drawn, mask = (cv2.resize(each, coarse, interpolation=cv2.INTER_AREA) for each in (drawn, mask))
        centre_m = float(np.hypot(corners_m[:, 0].mean(), corners_m[:, 2].mean()))
        covered = mask.copy()
        mask[walls_m[part] < centre_m - BEHIND_WALL_M - 0.5 * paper_m] = 0.0
        share = np.divide(mask, covered, out=np.zeros_like(mask), where=covered > 0.0)  # 0 behind a wall
        image[part] = (1.0 - mask) * image[part] + share * drawn
