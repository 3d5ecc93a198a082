"""From a mesh of a place to an optimized placement and a plot: python quickstart.py MESH.obj PLOT.png"""

import sys

import matplotlib.pyplot as plt

import sightline


def show(event):
    if event["event"] == "generation":
        print(f"{event['evaluations']} placements, best {event['best_so_far']:.2%}")


mesh, plot = sys.argv[1:] if len(sys.argv) == 3 else sys.exit("usage: python quickstart.py MESH.obj PLOT.png")
scene = sightline.Scene.from_dict({
    "sightline": 1, "name": "quickstart", "frames": 12,
    "roi": {"min": [-40, -40, -0.5], "max": [40, 40, 5.5], "voxel": [0.4, 0.4, 0.4]},
    "lidar": {"channels": 16, "fov": [-24.8, 2], "azimuth_steps": 250, "range": 100},
    "mount": {"min": [-0.6, -0.6, 2.2], "max": [0.6, 0.6, 2.8], "roll": [-0.3, 0.3], "lidars": 4},
    "static": [{"class": "building", "mesh": {"file": mesh}}],
    "ego": {"route": {"points": [[-30, 0], [30, 0]], "spacing": 4}},
})  # fmt: skip
result = sightline.optimize(scene, evaluations=120, callback=show)
print(result.best.poses.round(2))
share = result.scores["near_gain"] * 100
plt.barh(["optimized", *(placement.name for placement in result.baselines)], share)
plt.xlabel("near_gain, % of what there is")
plt.savefig(plot, bbox_inches="tight")
assert share[0] >= share[1:].max(), "a baseline is better"
