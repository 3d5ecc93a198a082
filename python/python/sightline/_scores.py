"""Scores of placements: a mapping of columns, and the placements as its rows."""

from __future__ import annotations

import html
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, overload

import numpy as np
import numpy.typing as npt

from ._extra import load

Column = npt.NDArray[Any]

#: Rows that a notebook shows at most.
_MOST_SHOWN = 20

#: Keys of a table that have a list of texts for each placement.
_LISTS = ("guards", "broken_rules")

#: Unit, which way is better, and meaning of each column.
_MEANING: dict[str, tuple[str, str, str]] = {
    "m_sog": ("nats", "higher", "mean of -H over the voxels covered"),
    "m_sog_scaled": ("nats", "higher", "-(1/N^2) sum of H over the N voxels covered, the scale that the paper prints"),
    "m_sog_nonzero": ("nats", "higher", "m_sog over the covered voxels that are occupied in some frame"),
    "m_sog_scaled_nonzero": ("nats", "higher", "m_sog_scaled over the covered voxels that are occupied in some frame"),
    "information_gain": ("nats", "higher", "sum of H over the voxels covered"),
    "information_gain_share": ("0 to 1", "higher", "information_gain as a share of what all voxels hold"),
    "near_gain": ("0 to 1", "higher", "share gained of information and ground, things near the vehicle counting more; "
                  "the default of `optimize`"),
    "near_gain_2": ("0 to 1", "higher", "near_gain with each voxel counted for up to two LiDARs that cover it"),
    "near_gain_3": ("0 to 1", "higher", "near_gain with each voxel counted for up to three LiDARs that cover it"),
    "near_field": ("0 to 1", "higher", "share of the ground within 10 m of the own body with a hit close by"),
    "near_ring": ("0 to 1", "higher", "share of the ground within 3 m of the own body with a hit close by"),
    "s_mig": ("nats", "higher", "-sum of the entropy of `occupied or not` over the voxels covered"),
    "entropy_sum": ("nats", "higher", "information_gain by its other name"),
    "covered": ("voxels", "higher", "voxels covered, a mean over frames"),
    "covered_nonzero": ("voxels", "higher", "voxels covered that are occupied in some frame, a mean over frames"),
    "beams": ("beams", "neither", "beams cast a frame"),
    "hit_share": ("0 to 1", "neither", "share of the beams that hit a surface"),
    "covered_by_class": ("voxels", "higher", "[N, classes] voxels covered in which a class occurs in some frame"),
    "unique_share": ("0 to 1", "neither", "[N, L] share of the information that is lost with this LiDAR"),
    "price": ("currency of the vehicle", "lower", "price of all sensors, where any has a price"),
    "requirements_hold_in": ("0 to 1", "higher", "share of 200 copies mounted within the tolerance that meet all "
                             "requirements; NaN where not looked at"),
    "feasible": ("bool", "true", "the placement keeps all rules of the mounts, meets all requirements, and no guard "
                 "doubts its scores"),
}  # fmt: skip


def _meaning(column: str) -> tuple[str, str, str]:
    if column.startswith("detection."):
        unit, better, text = _MEANING[column.removeprefix("detection.")]
        return unit, better, f"{text}; target classes against all others"
    if column.startswith("seen."):
        return "0 to 1", "higher", f"share that the requirement `{column.removeprefix('seen.')}` counts"
    return _MEANING[column]


class Rows:
    """Placements of :class:`Scores`: ``rows[3]`` is a dict, ``rows[mask]``, ``rows[10:20]`` and ``rows[[4, 2]]`` are Scores."""

    __slots__ = ("_scores",)

    def __init__(self, scores: Scores) -> None:
        self._scores = scores

    def __len__(self) -> int:
        return len(self._scores.names)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return (self[k] for k in range(len(self)))

    @overload
    def __getitem__(self, which: int) -> dict[str, Any]: ...

    @overload
    def __getitem__(self, which: slice | Sequence[int] | npt.NDArray[Any]) -> Scores: ...

    def __getitem__(self, which: Any) -> Any:
        scores = self._scores
        if isinstance(which, (int, np.integer)) and not isinstance(which, (bool, np.bool_)):
            at = int(which)
            row: dict[str, Any] = {"name": scores.names[at]}
            row.update((name, values[at]) for name, values in scores.items())
            return row | {"guards": list(scores.guards[at]), "broken_rules": list(scores.broken_rules[at])}
        kept = np.arange(len(self))[which]
        columns = {name: values[kept] for name, values in scores.items()}
        names = [scores.names[k] for k in kept]
        required = [scores.required[k] for k in kept] if scores.required else []
        guards, broken = ([words[k] for k in kept] for words in (scores.guards, scores.broken_rules))
        return Scores(names, columns, guards, scores.classes, scores.least, required, broken)


class Scores(Mapping[str, Column]):
    """Scores of N placements: a mapping of columns, each an array ``[N]``, in the order of the placements.

    ``scores["near_gain"]`` is an array ``[N]``; ``NaN`` where a placement has no such score. Two columns have
    more axes: ``covered_by_class`` ``[N, classes]`` and ``unique_share`` ``[N, L]``, ``NaN`` beyond a placement's own
    LiDARs. ``len(scores)`` counts columns, ``len(scores.rows)`` placements. ``print(scores.describe())`` says unit and
    meaning of every column; names and values are those of ``sightline score --format json``.
    """

    # Texts for `help`.
    __slots__ = {
        "broken_rules": "For each placement, rules of the mounts that it breaks, in words; mostly none.",
        "classes": "Names of the classes of ``covered_by_class``.",
        "guards": "For each placement, reasons why its scores should not be believed; mostly none.",
        "least": "Least share by requirement of the vehicle, as its file has it; the shares found are columns ``seen.NAME``.",
        "required": "For each of up to 64 placements its requirements, as ``sightline score --format json`` has them; else empty.",
        "names": "Name of each placement; its number for those from an array.",
        "_columns": "Arrays by name.",
    }

    def __init__(
        self,
        names: list[str],
        columns: dict[str, Column],
        guards: list[list[str]],
        classes: list[str],
        least: dict[str, float] | None = None,
        required: list[list[dict[str, Any]]] | None = None,
        broken_rules: list[list[str]] | None = None,
    ) -> None:
        self.names = names
        self._columns = columns
        self.guards = guards
        self.classes = classes
        self.least = least or {}
        self.required = required or []
        self.broken_rules = broken_rules or [[] for _ in names]

    def __getitem__(self, column: str) -> Column:
        try:
            return self._columns[column]
        except (KeyError, TypeError):
            if not isinstance(column, str):
                raise TypeError(f"{column!r} is no name of a column; for placements take scores.rows[…]") from None
            raise KeyError(f"`{column}` is no score; there are {', '.join(self)}") from None

    def __len__(self) -> int:
        return len(self._columns)

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __contains__(self, column: object) -> bool:
        return column in self._columns

    def __array__(self, *_: Any, **__: Any) -> Column:
        raise TypeError(
            'scores are columns of several types; take one, scores["near_gain"], or scores.to_pandas().to_numpy()'
        )

    def __repr__(self) -> str:
        return f"Scores({len(self.rows)} placements: {', '.join(self)})"

    def __eq__(self, other: object) -> bool:
        """Whether names, guards, broken rules and every bit of every column are the same."""
        if not isinstance(other, Scores) or list(self) != list(other):
            return False
        same = all(_same(self[name], other[name]) for name in self)
        return same and (self.names, self.guards, self.classes, self.least, self.broken_rules) == (
            other.names,
            other.guards,
            other.classes,
            other.least,
            other.broken_rules,
        )

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        words = (self.guards, self.classes, self.least, self.required, self.broken_rules)
        return Scores, (self.names, self._columns, *words)

    @property
    def rows(self) -> Rows:
        """The placements: an item is a dict, a slice, mask or list of numbers gives Scores."""
        return Rows(self)

    @property
    def feasible(self) -> npt.NDArray[np.bool_]:
        """``[N]``, true where a placement keeps all rules of the mounts and meets all requirements, and no guard doubts it.

        ``broken_rules``, ``requirements`` and ``guards`` say why one is not. More than 64 placements are looked at for the
        guard ``self_hit`` only at ``self_hits=True``: without it a placement may be feasible here and not when scored alone.
        """
        return self["feasible"]

    @property
    def requirements(self) -> dict[str, dict[str, Any]]:
        """A dict by requirement of the vehicle; empty where it has none.

        ``required`` is a share, ``found`` and ``met`` are ``[N]``. For up to 64 placements there are also ``holds_in`` and
        ``intact`` ``[N]``, ``NaN`` where not known. Lists have ``None`` where there is none: ``missing``, words;
        ``worst_without``, a number of a LiDAR; ``worst_frame``, ``frame`` and ``share`` where bodies move; ``places`` of a
        target, ``judged`` and ``left_out``. ``between`` of a target has ``places`` closer together and the share ``found`` there.
        """
        found = {name: self[f"seen.{name}"] for name in self.least}
        asked: dict[str, dict[str, Any]] = {
            name: {"required": least, "found": found[name], "met": found[name] >= least}
            for name, least in self.least.items()
        }
        for name, row in asked.items() if self.required else ():
            told = [next((rule for rule in rules if rule["name"] == name), {}) for rules in self.required]
            for key in ("holds_in", "intact"):
                row[key] = np.array([rule.get(key, np.nan) for rule in told], dtype=np.float64)
            for key in ("missing", "worst_without", "worst_frame", "places", "between"):
                row[key] = [rule.get(key) for rule in told]
        return asked

    def sort(self, column: str, *, descending: bool = True) -> Scores:
        """The placements ordered by a column ``[N]``, the highest first; equal ones stay in order, ``NaN`` comes last.

        Raises ``KeyError`` for no column, ``ValueError`` for one of more axes.
        """
        values = self[column]
        if values.ndim != 1:
            raise ValueError(f"column: `{column}` has {values.ndim} axes; give one with a number a placement")
        values = values.astype(np.float64)
        return self.rows[np.argsort(-values if descending else values, kind="stable")]

    def describe(self, column: str | None = None) -> str:
        """Unit, better direction and meaning of a column, or of all, a line each. Raises ``KeyError`` for no column."""
        if column is None:
            width = max(map(len, self))
            return "\n".join(f"{name:{width}}  {self.describe(name)}" for name in self)
        self[column]
        unit, better, text = _meaning(column)
        return f"[{unit}; better: {better}] {text}"

    def to_dict(self) -> dict[str, Any]:
        """Names, guards, broken rules and all columns by name; ``covered_by_class`` a column a class."""
        table: dict[str, Any] = {"name": list(self.names)}
        for name, values in self.items():
            if values.ndim == 1:
                table[name] = values
            else:
                parts = self.classes if name == "covered_by_class" else range(values.shape[1])
                table.update({f"{name}.{part}": values[:, k] for k, part in enumerate(parts)})
        table["guards"] = [list(guards) for guards in self.guards]
        table["broken_rules"] = [list(rules) for rules in self.broken_rules]
        return table

    def to_pandas(self) -> Any:
        """A ``pandas.DataFrame`` with a row a placement, named by it. Raises ``ImportError`` without pandas."""
        pandas = load("pandas", "pandas")
        return pandas.DataFrame(self.to_dict()).set_index("name")

    def to_polars(self) -> Any:
        """A ``polars.DataFrame`` with a row a placement. Raises ``ImportError`` without polars."""
        polars = load("polars", "polars")
        texts: dict[str, Any] = {"name": polars.String} | dict.fromkeys(_LISTS, polars.List(polars.String))
        return polars.DataFrame(self.to_dict(), schema_overrides=texts)

    def to_arrow(self) -> Any:
        """A ``pyarrow.Table`` with a row a placement. Raises ``ImportError`` without pyarrow."""
        pyarrow = load("pyarrow", "arrow")
        table = self.to_dict()
        table["name"] = pyarrow.array(table["name"], pyarrow.string())
        table |= {key: pyarrow.array(table[key], pyarrow.list_(pyarrow.string())) for key in _LISTS}
        return pyarrow.table(table)

    def _repr_html_(self) -> str:
        """Table of the first placements, for notebooks."""
        table = self.to_dict()
        for key in _LISTS:
            del table[key]
        count = min(len(self.rows), _MOST_SHOWN)
        head = "".join(f"<th>{html.escape(name)}</th>" for name in table)
        body = "".join(f"<tr>{''.join(_cell(values[k]) for values in table.values())}</tr>" for k in range(count))
        more = f"<p>{len(self.rows)} placements, the first {count} shown</p>" if count < len(self.rows) else ""
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{more}"

    @staticmethod
    def concatenate(parts: Iterable[Scores]) -> Scores:
        """The scores of several batches of one scene, in order. Raises ``ValueError`` for those of different scenes."""
        parts = list(parts)
        if not parts:
            raise ValueError("parts: are none; give at least one batch of scores")
        first = parts[0]
        for part in parts:
            if list(part) != list(first) or part.classes != first.classes or part.least != first.least:
                raise ValueError("parts: have different columns; they must come from one scene")
        width = {
            name: max(part[name].shape[1] for part in parts)
            for name in first
            if first[name].ndim > 1
        }
        columns = {
            name: np.concatenate(
                [_widened(part[name], width[name]) if name in width else part[name] for part in parts]
            )
            for name in first
        }
        return Scores(
            [name for part in parts for name in part.names],
            columns,
            [guards for part in parts for guards in part.guards],
            first.classes,
            first.least,
            [rules for part in parts for rules in part.required] if all(part.required for part in parts) else [],
            [rules for part in parts for rules in part.broken_rules],
        )


def missed_by_first(scores: Scores) -> list[str]:
    """A sentence on each requirement that the first placement misses."""
    asked = scores.requirements.items()
    return [
        # Tenths are rounded down: a share that is too small never reads as enough.
        f"NOT MET: {name}: {np.floor(1000 * rule['found'][0] + 1e-9) / 10:.1f} % of {100 * rule['required']:g} %"
        for name, rule in asked
        if not rule["met"][0]
    ]


def _cell(value: Any) -> str:
    shown = f"{value:.4g}" if isinstance(value, (float, np.floating)) else str(value)
    return f"<td>{html.escape(textwrap.shorten(shown, 60))}</td>"


def _same(a: Column, b: Column) -> bool:
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


def _widened(values: Column, width: int) -> Column:
    missing = width - values.shape[1]
    return np.pad(values, ((0, 0), (0, missing)), constant_values=np.nan) if missing else values
