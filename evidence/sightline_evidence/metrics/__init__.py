"""Worth of a placement to a learner, by the letter of public rules and on targets that no placement moves.

| module | holds |
|---|---|
| ``segmentation`` | confusion, mIoU as SemanticKITTI and as nuScenes-lidarseg take it |
| ``targets`` | voxel and bird's-eye confusion on fixed targets, by distance and region |
| ``objects`` | objects with enough points, blind ground near the body |
| ``detection`` | nuScenes AP and true-positive errors, by the devkit |
| ``calibration`` | expected calibration error, bins named |
"""
