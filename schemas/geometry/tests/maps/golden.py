"""Draws small maps and works out what their pixels mean to the map servers, independently of the crate: `python3 golden.py`.

The arithmetic is that of `map_server` (ROS 1 Noetic, image_loader.cpp) and nav2_map_server (Humble, map_io.cpp), in fractions: colours are
averaged, opacity along with them in trinary maps; in scaled maps what is not opaque is unknown; raw maps hold the brightness.
Where the two differ (indexed images, 16 bits, negated raw maps, steps of scaled maps) it is nav2's.
"""

from decimal import Decimal
from fractions import Fraction
from pathlib import Path

from PIL import Image

HERE = Path(__file__).parent
GREYS = [0, 1, 50, 88, 89, 90, 100, 101, 128, 204, 205, 206, 254, 255]
COLOURS = [(0, 0, 0), (255, 255, 255), (0, 255, 0), (255, 0, 0), (0, 0, 255), (255, 255, 0), (0, 255, 255), (255, 0, 255),
           (0, 200, 0), (205, 205, 205), (204, 204, 204), (128, 64, 32), (100, 100, 101), (1, 2, 3)]
OPACITIES = [255, 254, 128, 1, 0]


def draw():
    """Each image with its pixels as (red, green, blue, opacity or None) and their brightest step."""
    grey = [(v, v, v, None) for v in GREYS]
    yield "grey.pgm", "L", GREYS, grey, 255
    yield "grey.png", "L", GREYS, grey, 255
    yield "grey.bmp", "L", GREYS, grey, 255
    bits = [v % 2 for v in range(14)]
    yield "bits.png", "1", [255 * b for b in bits], [(255 * b, 255 * b, 255 * b, None) for b in bits], 255
    wide = [v * 257 + (v % 7) for v in GREYS[:-1]] + [65535]
    yield "grey16.png", "I;16", wide, [(v, v, v, None) for v in wide], 65535
    colour = [(*c, None) for c in COLOURS]
    for name in ["colour.png", "colour.ppm", "colour.bmp"]:
        yield name, "RGB", COLOURS, colour, 255
    clear = [(*c, a) for c in COLOURS[:3] + [(205, 205, 205), (128, 64, 32)] for a in OPACITIES]
    yield "clear.png", "RGBA", clear, clear, 255
    clear_grey = [(v, a) for v in [0, 255, 205, 128] for a in OPACITIES]
    yield "clear-grey.png", "LA", clear_grey, [(v, v, v, a) for v, a in clear_grey], 255
    yield "indexed.png", "P", COLOURS, colour, 255
    shades = [0, 64, 128, 200, 254] + [255] * (len(COLOURS) - 5)
    yield "indexed-clear.png", "P+", (COLOURS, shades), [(*c, a) for c, a in zip(COLOURS, shades)], 255


def write(name, mode, values):
    if mode in ("P", "P+"):
        colours, shades = values if mode == "P+" else (values, None)
        image = Image.new("P", (len(colours), 1))
        image.putpalette([part for colour in colours for part in colour])
        image.putdata(range(len(colours)))
        options = {"transparency": bytes(shades)} if shades else {}
        image.save(HERE / name, optimize=False, **options)
        return
    image = Image.new(mode, (len(values), 1))
    image.putdata([tuple(v) if isinstance(v, tuple) else v for v in values])
    image.save(HERE / name)


def meaning(pixel, full, mode, negate, occupied, free):
    red, green, blue, opacity = pixel
    parts = [red, green, blue]
    if mode == "trinary" and opacity is not None:
        parts.append(opacity)
    shade = Fraction(sum(parts), len(parts) * full)
    if mode == "raw":
        percent = int(shade * 255 + Fraction(1, 2))
        return percent if percent <= 100 else -1
    dark = shade if negate else 1 - shade
    if mode == "scale" and opacity is not None and opacity < full:
        return -1
    if dark > occupied:
        return 100
    if dark < free:
        return 0
    if mode == "trinary":
        return -1
    percent = (dark - free) / (occupied - free) * 100
    return int(percent + Fraction(1, 2))


lines = []
for name, image_mode, values, pixels, full in draw():
    write(name, image_mode, values)
    for mode in ["trinary", "scale", "raw"]:
        for negate in [0, 1]:
            for occupied, free in [("0.65", "0.196"), ("0.65", "0.25"), ("0.2", "0.2")]:
                limits = [Fraction(Decimal(text)) for text in (occupied, free)]
                if mode == "scale" and occupied == free:
                    continue
                cells = [meaning(pixel, full, mode, negate, *limits) for pixel in pixels]
                lines.append(f"{name} {mode} {negate} {occupied} {free}: {' '.join(map(str, cells))}")
(HERE / "golden.txt").write_text("\n".join(lines) + "\n")
