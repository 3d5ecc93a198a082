"""nuScenes average precision and true-positive errors; the devkit computes, this hands it boxes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .._types import F64

#: Metres between centres within which a prediction is a match, nuScenes' four.
DISTANCES = (0.5, 1.0, 2.0, 4.0)

#: The devkit's names of our three objects.
NAMES = {"vehicle": "car", "pedestrian": "pedestrian", "cyclist": "bicycle"}


@dataclass(frozen=True)
class Objects:
    """Boxes of one frame: ``centre`` ``[B, 3]``, ``size`` ``[B, 3]`` (length, width, height) in metres, ``yaw`` ``[B]``."""

    centre: F64
    size: F64
    yaw: F64
    #: Names of ``NAMES``.
    kind: list[str]
    #: ``[B]``, confidence of predictions; not read of truth.
    score: F64


@dataclass(frozen=True)
class Detection:
    """AP by kind and by distance; mean AP; errors of place (m), scale (1 − IoU) and heading (rad) by kind at 2 m.

    Errors of velocity and attribute mean nothing to a learner of single frames; NDS is left out for the same reason.
    """

    ap: dict[str, dict[str, float]]
    mean_ap: float
    errors: dict[str, dict[str, float]]


def detection(truth: list[Objects], predicted: list[Objects]) -> Detection:
    """Detection over all frames together: truth and predictions of the same frames, in order."""
    if len(truth) != len(predicted):
        raise ValueError(
            f"truth has {len(truth)} frames, predicted {len(predicted)}; give the same frames of both"
        )
    algo, distance = _devkit()
    given = _boxes(truth), _boxes(predicted)
    ap: dict[str, dict[str, float]] = {}
    errors: dict[str, dict[str, float]] = {}
    for kind, name in NAMES.items():
        data = {d: algo.accumulate(*given, name, distance, d) for d in DISTANCES}
        ap[kind] = {str(d): float(algo.calc_ap(data[d], 0.1, 0.1)) for d in DISTANCES}
        errors[kind] = {
            error: float(algo.calc_tp(data[2.0], 0.1, error))
            for error in ("trans_err", "scale_err", "orient_err")
        }
    return Detection(ap, float(np.mean([list(of.values()) for of in ap.values()])), errors)


def _boxes(frames: list[Objects]) -> Any:
    from nuscenes.eval.common.data_classes import EvalBoxes
    from nuscenes.eval.detection.data_classes import DetectionBox

    boxes = EvalBoxes()
    for number, frame in enumerate(frames):
        half = frame.yaw / 2
        boxes.add_boxes(
            str(number),
            [
                DetectionBox(
                    sample_token=str(number),
                    translation=tuple(frame.centre[b]),
                    size=tuple(frame.size[b, [1, 0, 2]]),
                    rotation=(np.cos(half[b]), 0.0, 0.0, np.sin(half[b])),
                    detection_name=NAMES[frame.kind[b]],
                    detection_score=float(frame.score[b]),
                )
                for b in range(len(frame.kind))
            ],
        )
    return boxes


def _devkit() -> tuple[Any, Any]:
    try:
        from nuscenes.eval.common.utils import center_distance
        from nuscenes.eval.detection import algo
    except ImportError as error:
        raise ImportError(
            "average precision is computed by nuscenes-devkit, which is not there (Python 3.10 to 3.12): "
            "pip install 'sightline-evidence[nuscenes]'"
        ) from error
    return algo, center_distance
