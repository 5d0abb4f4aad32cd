# SPDX-License-Identifier: Apache-2.0
"""From light to the picture that a program receives: lens, colour sensor and file format."""
import cv2
import numpy as np

from camera import HEIGHT, WIDTH

FULL_GREY = 306  # a pixel is full at 1.2 times the largest number of the converter


def disc_kernel(radius):
    """The image of a point out of focus: a disc with a soft rim (11 samples a pixel and axis)."""
    n = int(np.ceil(radius)) + 1
    fine = (np.arange((2 * n + 1) * 11) + 0.5) / 11 - (n + 0.5)
    inside = (fine[:, None] ** 2 + fine[None, :] ** 2 <= radius * radius).astype(float)
    kernel = inside.reshape(2 * n + 1, 11, 2 * n + 1, 11).sum((1, 3))
    return kernel / kernel.sum()


def through_lens(image, blur, disc, glare, vignetting):
    if disc > 0:
        image = cv2.filter2D(image, -1, disc_kernel(disc), borderType=cv2.BORDER_REPLICATE)
    image = cv2.GaussianBlur(image, (0, 0), blur, borderType=cv2.BORDER_REPLICATE)
    if glare > 0:  # a little light is scattered in the lens
        small = cv2.resize(image, (WIDTH // 8, HEIGHT // 8), interpolation=cv2.INTER_AREA)
        wide = 0.6 * cv2.GaussianBlur(small, (0, 0), 1.2) + 0.4 * cv2.GaussianBlur(small, (0, 0), 9)
        image = (1 - glare) * image + glare * cv2.resize(wide, (WIDTH, HEIGHT))
    x = (np.arange(WIDTH, dtype=np.float32) - WIDTH / 2) / (WIDTH / 2)
    y = (np.arange(HEIGHT, dtype=np.float32) - HEIGHT / 2) / (WIDTH / 2)
    fall = (1 - vignetting * (x[None, :] ** 2 + y[:, None] ** 2) / 1.64).astype(np.float32)
    return image, fall[..., None]


def bayer_mosaic(rng, image):
    """One colour per pixel, and OpenCV's code to interpolate it."""
    # OpenCV names a pattern by the second row's second and third pixel.
    shift, code = [((0, 0), cv2.COLOR_BayerBG2BGR), ((0, 1), cv2.COLOR_BayerGB2BGR),
                   ((1, 0), cv2.COLOR_BayerGR2BGR), ((1, 1), cv2.COLOR_BayerRG2BGR)][
                       int(rng.integers(4))]
    raw = np.empty((HEIGHT, WIDTH), np.float32)
    for dy in (0, 1):
        for dx in (0, 1):
            # Red where row + shift and column + shift are even, blue where both are odd.
            row, column = (dy + shift[0]) % 2, (dx + shift[1]) % 2
            channel = 0 if row == 0 and column == 0 else 2 if row == 1 and column == 1 else 1
            raw[dy::2, dx::2] = image[dy::2, dx::2, channel]
    return raw, code


def expose(rng, radiance, grey_per_unit, blur=0.6, disc=0.0, black=6.0, read_noise=2.0,
           electrons_per_grey=40.0, mosaic=True, glare=0.02, vignetting=0.15, jpeg=0, gamma=False,
           noise=True):
    """Turns radiance (float32, RGB) into a BGR picture of 8 bits. black and read_noise are in grey
    levels, blur (sigma) and disc (radius) in pixels; jpeg is a quality, 0: not compressed."""
    image, fall = through_lens(radiance, blur, disc, glare, vignetting)
    image = image * (fall * np.float32(grey_per_unit))
    raw, code = bayer_mosaic(rng, image) if mosaic else (image, None)
    if noise:
        electrons = np.clip(raw, 0, FULL_GREY) * electrons_per_grey
        sigma = np.sqrt(electrons + (read_noise * electrons_per_grey) ** 2) / electrons_per_grey
        raw = raw + sigma * rng.standard_normal(raw.shape, np.float32)
    if gamma:  # as cameras for people to look at have
        raw = 255 * np.clip(raw / 255, 0, 1) ** np.float32(1 / 2.2)
    else:
        raw = raw + black
    raw = np.clip(np.rint(raw), 0, 255).astype(np.uint8)
    bgr = cv2.cvtColor(raw, code) if mosaic else np.ascontiguousarray(raw[..., ::-1])
    if jpeg:
        bgr = cv2.imdecode(cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, jpeg])[1], 1)
    return bgr
