"""From a mesh of a place to an optimized placement and a plot: python quickstart.py MESH.obj PLOT.png"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import sightline



def show(event):
    if event["event"] == "generation":
        print(f"{event['evaluations']} placements, best {event['best_so_far']:.0f} nats")


mesh, plot = sys.argv[1:]
scene = sightline.Scene.from_dict({
    "sightline": 1,
    "name": "quickstart",
    "roi": {"min": [-40, -40, -0.5], "max": [40, 40, 5.5], "voxel": [0.4, 0.4, 0.4]},
    "lidar": {"channels": 16, "fov": [-24.8, 2], "azimuth_steps": 250, "range": 100},
    "mount": {"min": [-0.6, -0.6, 2.2], "max": [0.6, 0.6, 2.8], "roll": [-0.3, 0.3], "lidars": 4},
    "static": [{"class": "building", "mesh": {"file": mesh}}],
    "ego": {"route": {"points": [[-30, 0], [30, 0]], "spacing": 4}},
    "frames": 12,
})  # fmt: skip
result = sightline.optimize(scene, evaluations=120, callback=show)
print(result.best.poses.round(2))

gain = result.scores["information_gain_share"] * 100
plt.barh(["optimized", *(placement.name for placement in result.baselines)], gain)
plt.xlabel("information gained, % of the scene")
plt.savefig(plot, bbox_inches="tight")
assert gain[0] >= np.nanmax(gain[1:]), "a baseline is better"
