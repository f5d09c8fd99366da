"""Writes fisheye.csv: points seen by fisheye cameras (`equidistant`), computed by OpenCV.

pip install opencv-python-headless==5.0.0.93 numpy; python make_fisheye.py > fisheye.csv
"""

import cv2
import numpy as np

# fx, fy, cx, cy; k1 k2 k3 k4; the largest angle off the axis, degrees.
CAMERAS = [
    ([285.7, 286.1, 423.9, 400.2], [-0.0071, 0.0427, -0.0402, 0.0074], 80),
    ([1727.79, 1727.67, 959.25, 539.72], [0.00023, -0.00238, 0.00007, -0.00006], 35),
    ([620.0, 618.5, 1300.5, 1010.25], [-0.05, 0.01, -0.004, 0.0005], 75),
    ([204.0, 204.0, 319.5, 239.5], [0.0, 0.0, 0.0, 0.0], 82),
]

random = np.random.default_rng(20261129)
print("# OpenCV", cv2.__version__)
print("camera,fx,fy,cx,cy,k1,k2,k3,k4,x_m,y_m,z_m,column_px,row_px")
for number, (k, d, largest_deg) in enumerate(CAMERAS):
    fx, fy, cx, cy = k
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    # The last points lie at the edge of the field of view.
    angles = np.radians(largest_deg) * np.append(random.uniform(0, 1, 36), [1.0] * 4)
    around = random.uniform(-np.pi, np.pi, 40)
    radii = random.uniform(0.2, 3.0, 40)
    points = np.stack(
        [np.sin(angles) * np.cos(around), np.sin(angles) * np.sin(around), np.cos(angles)], axis=1
    ) * radii[:, None]
    seen, _ = cv2.fisheye.projectPoints(points[:, None], np.zeros((1, 1, 3)), np.zeros((1, 1, 3)), matrix, np.array(d))
    for point, (u, v) in zip(points, seen.reshape(-1, 2)):
        print(number, *(repr(float(value)) for value in k + d + list(point) + [u, v]), sep=",")
