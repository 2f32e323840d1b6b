"""Images fitted into a network's input with their proportions kept, and boxes taken back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

import numpy as np
import numpy.typing as npt

from workbench.errors import InputError

Image = npt.NDArray[np.uint8]
Floats = npt.NDArray[np.float64]
GREY: Final = 114


@final
@dataclass(frozen=True, slots=True)
class Letterbox:
    """The map u' = scale_x u + left, v' = scale_y v + top of an image into an input (px).

    Whole pixels make the scales of the two axes differ by up to half an input pixel over the image;
    each axis keeps its own, so that `to_image` is the inverse up to rounding of floats.
    """

    scale_x: float
    scale_y: float
    left_px: int
    top_px: int

    def to_input(self, boxes: Floats) -> Floats:
        """Boxes (N, 4) as left, top, right, bottom, from the image's pixels to the input's."""
        return boxes * self._scales() + self._offsets()

    def to_image(self, boxes: Floats) -> Floats:
        """Boxes (N, 4) from the input's pixels to the image's."""
        return (boxes - self._offsets()) / self._scales()

    def _scales(self) -> Floats:
        return np.array([self.scale_x, self.scale_y, self.scale_x, self.scale_y])

    def _offsets(self) -> Floats:
        return np.array([self.left_px, self.top_px, self.left_px, self.top_px], dtype=np.float64)


def letterboxed(image: Image, size: tuple[int, int]) -> tuple[npt.NDArray[np.float32], Letterbox]:
    """The image (H, W, 3, RGB) within an input (3, height, width) of values 0 to 1, and the map.

    size: (height, width) of the input. The image is scaled by min(height / H, width / W), rounded
    to whole pixels, sampled bilinearly at the pixels' centres, and framed in grey.
    """
    if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or 0 in image.shape:
        raise InputError(
            "expected an image (height, width, 3) of 8-bit RGB values, got shape "
            f"{image.shape} of {image.dtype}; convert it to RGB"
        )
    rows, columns = image.shape[:2]
    scale = min(size[0] / rows, size[1] / columns)
    high, wide = max(round(rows * scale), 1), max(round(columns * scale), 1)
    top, left = (size[0] - high) // 2, (size[1] - wide) // 2
    framed = np.full((*size, 3), GREY / 255.0, dtype=np.float32)
    framed[top : top + high, left : left + wide] = _resized(image, high, wide) / np.float32(255.0)
    chart = Letterbox(wide / columns, high / rows, left, top)
    return np.ascontiguousarray(framed.transpose(2, 0, 1)), chart


def _resized(image: Image, high: int, wide: int) -> npt.NDArray[np.float32]:
    if (high, wide) == image.shape[:2]:
        return image.astype(np.float32)
    first, second, part = _neighbours(image.shape[0], high)
    part = part[:, None, None]
    rows = image[first] * (1.0 - part) + image[second] * part
    first, second, part = _neighbours(image.shape[1], wide)
    part = part[None, :, None]
    found: npt.NDArray[np.float32] = rows[:, first] * (1.0 - part) + rows[:, second] * part
    return found


def _neighbours(
    count: int, wanted: int
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], npt.NDArray[np.float32]]:
    """For each wanted pixel the two pixels its centre lies between, and the second one's part."""
    centre = (np.arange(wanted) + 0.5) * (count / wanted) - 0.5
    centre = np.clip(centre, 0.0, count - 1.0)
    first = np.floor(centre).astype(np.intp)
    return first, np.minimum(first + 1, count - 1), (centre - first).astype(np.float32)
