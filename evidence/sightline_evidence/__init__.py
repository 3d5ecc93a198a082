"""Does a score predict what a learned model gets from a placement? ``pip install sightline-evidence``.

| module | holds |
|---|---|
| ``groups``, ``grid`` | classes and voxels that everything else counts in |
| ``metrics`` | what a placement is worth to a learner |
| ``truth`` | targets that no placement moves |
| ``learners`` | boosted trees for each placement; a shared bird's-eye U-Net |
| ``correlate`` | how well a score predicts a metric, with intervals |
| ``layouts``, ``worlds``, ``scores`` | placements and scenes of the studies, and what is said of them |
| ``plan`` | what is to be done, fixed and hashed before it is done |
| ``trial``, ``run``, ``summary`` | one placement through a learner; all of them, resumably; the result |
| ``present``, ``displays`` | tables and figure of a run; of the kept records, for ``docs/evidence.md`` |

``python -m sightline_evidence quick --out DIR`` runs it; ``docs/evidence.md`` says what came out.
"""
