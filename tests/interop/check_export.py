#!/usr/bin/env python3
"""Opens what `laser_profiler export` wrote with other people's readers and holds it to the bag it came from.

usage: check_export.py BAG TOPIC DIRECTORY     the directory has scan.ply, scan.pcd, scan.csv, scan.png and scan.tif
exit : 0 every reader sees the points of the bag, 1 otherwise
needs: pip install -r requirements.txt
"""

import json
import sys
from pathlib import Path

import numpy as np
import tifffile
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from PIL import Image
from plyfile import PlyData
from pypcd4 import PointCloud


def require(condition, complaint):
    if not condition:
        raise ValueError(complaint)


def points_of(bag, topic):
    """Measured points of all clouds, one row x, y, z, intensity each."""
    clouds = []
    for path in sorted(bag.glob("*.mcap")):
        with path.open("rb") as stream:
            reader = make_reader(stream, decoder_factories=[DecoderFactory()])
            for _, _, _, cloud in reader.iter_decoded_messages(topics=[topic]):
                clouds.append(np.frombuffer(bytes(cloud.data), "<f4").reshape(-1, 4))
    points = np.concatenate(clouds)
    return points[np.isfinite(points[:, 2])]


def check_clouds(directory, points):
    vertex = PlyData.read(directory / "scan.ply")["vertex"]
    ply = np.stack([vertex[name] for name in ("x", "y", "z", "intensity")], axis=1)
    require(np.array_equal(ply, points), "plyfile sees other points")
    require({"red", "green", "blue"} <= set(vertex.data.dtype.names), "plyfile sees no colours")
    order = np.argsort(points[:, 2])
    brightness = np.asarray(vertex["green"], int)[order]
    require(brightness[-100:].mean() > brightness[:100].mean() + 50, "colours do not follow the height")
    pcd = PointCloud.from_path(directory / "scan.pcd").numpy(("x", "y", "z", "intensity"))
    require(np.array_equal(pcd, points), "pypcd4 sees other points")
    csv = np.genfromtxt(directory / "scan.csv", delimiter=",", names=True)
    require(len(csv) == len(points), f"{len(csv)} lines for {len(points)} points")
    for name, column in (("x_m", 0), ("z_m", 2), ("intensity", 3)):
        require(np.array_equal(csv[name].astype("f4"), points[:, column]), f"column {name} differs")
    require((csv["sigma_z_m"] > 0).all(), "a point without uncertainty")


def check_grids(directory, points):
    with tifffile.TiffFile(directory / "scan.tif") as tif:
        z = tif.asarray()
        told = json.loads(tif.pages[0].tags["ImageDescription"].value)
        resolution, unit = tif.pages[0].tags["XResolution"].value, tif.pages[0].tags["ResolutionUnit"].value
    require(z.dtype == np.float32 and z.shape == (told["height"], told["width"]), f"{z.dtype} {z.shape}")
    require(unit == 3 and abs(resolution[0] / resolution[1] * 100 * told["cell_m"] - 1) < 1e-3, "wrong resolution")
    require(told == json.loads((directory / "scan.tif.json").read_text()), "sidecar and file differ")
    with Image.open(directory / "scan.png") as png:
        levels, text = np.asarray(png), png.text
    scale = json.loads((directory / "scan.png.json").read_text())
    require(float(text["metres_per_level"]) == scale["metres_per_level"], "sidecar and tEXt differ")
    require(np.array_equal(levels == 0, np.isnan(z)), "PNG and TIFF disagree on what is valid")
    metres = scale["offset_m"] + levels * scale["metres_per_level"]
    valid = levels > 0
    error = np.abs(metres - z)[valid].max()
    require(error < 0.51 * scale["metres_per_level"] + 1e-9, f"PNG is {error} m off")
    check_heights(points, z, told)


def check_heights(points, z, told):
    """The mean of the points in a cell, by numpy, is the height of the cell where the surface is smooth."""
    cell, (x0, y0) = told["cell_m"], told["origin_m"]
    column = ((points[:, 0] - x0) // cell).astype(int)
    row = ((points[:, 1] - y0) // cell).astype(int)
    at = row * told["width"] + column
    require(at.min() >= 0 and at.max() < z.size, "points outside the grid")
    count = np.bincount(at, minlength=z.size)
    mean = np.bincount(at, weights=points[:, 2], minlength=z.size) / np.maximum(count, 1)
    both = (count >= 3) & np.isfinite(z.ravel())
    require(both.sum() > 0.5 * (count >= 3).sum(), "most of the cells with points are invalid")
    median = np.median(np.abs(mean - z.ravel())[both])
    require(median < 20e-6, f"cells lie {median} m from the mean of their points")
    require(np.isfinite(z.ravel()[count == 0]).mean() < 0.2, "heights where there are no points")


def main():
    bag, topic, directory = Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3])
    points = points_of(bag, topic)
    check_clouds(directory, points)
    check_grids(directory, points)
    print(f"{len(points)} points, as plyfile, pypcd4, numpy, Pillow and tifffile see them")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except ValueError as error:
        print(error)
        sys.exit(1)
