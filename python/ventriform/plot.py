"""Pictures of results by matplotlib (extra `plot`)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ._errors import InputError
from ._results import Fit, extra

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: The rings of the polar map of the AHA from the inside: number of parts, where the first begins, degrees
#: counter-clockwise from the right, and the first part's number.
_RINGS = ((1, 45.0, 17), (4, 45.0, 13), (6, 60.0, 7), (6, 60.0, 1))


def polar(
    fit: Fit, *, ax: Axes | None = None, numbers: bool = True, cmap: str = "inferno", colorbar: bool = True
) -> Axes:
    """Draws the polar map of a fit with the 17 segments of the AHA.

    Parameters
    ----------
    fit : Fit
        A fit of a left ventricle.
    ax : matplotlib Axes, optional
        A polar one to draw into; by default a new figure's.
    numbers : bool
        Write number and mean uptake, per cent, into each segment.
    cmap : str
        Colours from 0 to 100 per cent.
    colorbar : bool
        Draw the scale beside the map.

    Returns
    -------
    matplotlib Axes
    """
    import numpy as np

    if not isinstance(fit, Fit):
        raise InputError("fit", f"A {type(fit).__name__} is no fit.", "Give what `segment` returned.")
    found = fit.polar_map
    if found is None:
        raise InputError("fit", "It has no polar map.", "Give a fit of a left ventricle.")
    pyplot = extra("matplotlib.pyplot", "plot")
    if ax is None:
        figure = pyplot.figure(figsize=(5, 5))
        ax = figure.add_subplot(projection="polar")
    assert ax is not None
    if getattr(ax, "name", None) != "polar":
        raise InputError("ax", "The axes are not polar.", "Make them with projection='polar'.")
    values = np.array(found.values_percent, dtype=np.float64)
    rows, columns = values.shape
    ends, rings = np.array(found.level_ends), np.array(found.rings)
    # Of every column, row r lies at a radius that puts the ends of its levels onto the rings.
    radii = np.empty((rows + 1, columns + 1))
    for column in range(columns):
        known = np.concatenate([[0.0], ends[column]])
        placed = np.concatenate([[0.0], rings])
        last = max(known[-1], 1e-9)
        steps = np.minimum(np.arange(rows + 1, dtype=np.float64), last)
        radii[:, column] = np.interp(steps, known, placed)
    radii[:, columns] = radii[:, 0]
    # The first column looks to the lateral wall (right), the next ones over anterior (up).
    angles = np.linspace(0.0, 2.0 * np.pi, columns + 1)
    shown = np.ma.masked_invalid(values)
    for column in range(columns):
        mesh = ax.pcolormesh(
            np.tile(angles[column : column + 2], (rows + 1, 1)),
            np.column_stack([radii[:, column], radii[:, column]]),
            shown[:, column : column + 1],
            cmap=cmap,
            vmin=0.0,
            vmax=100.0,
            shading="flat",
            rasterized=True,
        )
    edges: list[Any] = [0.0, *rings.tolist()]
    for (parts, first, number), inner, outer in zip(_RINGS, edges[:-1], edges[1:], strict=True):
        circle = np.linspace(0.0, 2.0 * np.pi, 181)
        ax.plot(circle, np.full_like(circle, outer), color="white", linewidth=0.8)
        for part in range(parts):
            begin = np.deg2rad(first + 360.0 / parts * part)
            if parts > 1:
                ax.plot([begin, begin], [inner, outer], color="white", linewidth=0.8)
            if numbers:
                angle = begin + np.pi / parts if parts > 1 else 0.0
                radius = (inner + outer) / 2.0 if parts > 1 else 0.0
                segment = found.segments[number + part - 1]
                mean = "" if segment.mean_percent is None else f"\n{segment.mean_percent:.0f} %"
                dark = (segment.mean_percent or 0.0) < 60.0
                ax.text(
                    angle,
                    radius,
                    f"{segment.number}{mean}",
                    ha="center",
                    va="center",
                    fontsize=7,
                    color="white" if dark else "black",
                )
    ax.set_ylim(0.0, float(rings[-1]))
    ax.set_yticks([])
    ax.grid(False)
    sides = ["lateral", "anterior", "septal", "inferior"] if found.orientation != "unknown" else [""] * 4
    ax.set_xticks(np.deg2rad([0.0, 90.0, 180.0, 270.0]), sides)
    for label, way in zip(ax.get_xticklabels(), ("left", "center", "right", "center"), strict=True):
        label.set_horizontalalignment(way)
    if colorbar:
        ax.figure.colorbar(mesh, ax=ax, shrink=0.7, pad=0.22, label="uptake, % of the reference")
    return ax
