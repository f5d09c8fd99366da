"""Writes projections.csv: points seen by cameras of every model, computed by OpenCV.

pip install opencv-python-headless==5.0.0.93 numpy; python make_projections.py > projections.csv
"""

import cv2
import numpy as np

# fx, fy, cx, cy, then k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tau_x tau_y, as OpenCV orders them.
CAMERAS = [
    ([625.0, 623.6, 317.5, 242.3], [0.0] * 14),
    ([625.0, 623.6, 317.5, 242.3], [0.1277, -0.2795, -0.00017, -0.00293, 0.148] + [0.0] * 9),
    ([2400.0, 2410.0, 1300.5, 1010.25], [-0.42, 0.19, 0.003, -0.002, -0.03] + [0.0] * 9),
    ([980.0, 975.0, 960.0, 540.0], [8.2, 4.6, -0.0002, 0.0007, 0.21, 8.6, 7.4, 1.2] + [0.0] * 6),
    ([5400.0, 5400.0, 1295.5, 1024.0], [-0.12, 0.2, 0.001, -0.0005, 0.0] + [0.0] * 7 + [0.12, -0.25]),
    ([2400.0, 2410.0, 1300.5, 1010.25], [0.9, -0.3, 0.001, -0.001, 0.02, 1.2, 0.1, 0.01] + [0.0] * 4 + [-0.3, 0.2]),
]

random = np.random.default_rng(20261122)
print("# OpenCV", cv2.__version__)
print("camera,fx,fy,cx,cy,k1,k2,p1,p2,k3,k4,k5,k6,tau_x,tau_y,x_m,y_m,z_m,column_px,row_px")
for number, (k, d) in enumerate(CAMERAS):
    fx, fy, cx, cy = k
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    directions = random.uniform(-0.5, 0.5, (40, 2)) * [1.0, 0.8]
    depths = random.uniform(0.2, 3.0, (40, 1))
    points = np.hstack([directions * depths, depths])
    seen, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, np.array(d))
    for point, (u, v) in zip(points, seen.reshape(-1, 2)):
        values = k + d[:8] + d[12:] + list(point) + [u, v]
        print(number, *(repr(float(value)) for value in values), sep=",")
