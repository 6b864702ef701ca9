"""The figures of the paper."""

from __future__ import annotations

ALL_DRIVES = "the paper's eight drives"
DRIVES = ("0001", "0005", "0014", "0019", "0020", "0035", "0059", "0084")
_TABLE_III = (32.4, 34.9, 27.1, 46.3, 56.6, 36.4, 61.9, 51.7)
_TABLE_VI = {
    "objects": (14, 12, 35, 23, 7, 21, 57, 53),
    "frames": (108, 154, 341, 481, 86, 131, 373, 383),
    "mis-associations": (0, 0, 5, 3, 0, 0, 23, 0),
    "discontinuities": (33, 38, 26, 53, 39, 47, 94, 125),
    "N_go of objects": (5.0, 4.6, 7.9, 7.9, 5.4, 5.3, 9.7, 8.4),
}
_OF_DRIVE: dict[tuple[str, str, str], float] = {
    ("table3", drive, "N_go"): value for drive, value in zip(DRIVES, _TABLE_III, strict=True)
} | {
    ("table6", drive, quantity): value
    for quantity, values in _TABLE_VI.items()
    for drive, value in zip(DRIVES, values, strict=True)
}
_OF_ALL: dict[tuple[str, str, str], float] = {
    (table, method, f"AP {name}"): percent / 100
    for table, method, percents in (
        ("table4", "det_only", (92.2, 90.4, 54.4)),
        ("table4", "with_trk", (97.4, 96.8, 79.3)),
        ("table5", "det_only", (92.0, 89.6, 57.5)),
        ("table5", "with_trk", (93.8, 91.2, 73.0)),
    )
    for name, percent in zip(("car", "cyclist", "pedestrian"), percents, strict=True)
}
_OF_RANGE = {("fig8", 10.0, "beta"): 0.1, ("fig8", 70.0, "beta"): 0.02}


def figure(experiment: str, streams: str, variant: str, at: float | None, quantity: str) -> tuple[float, str] | None:
    """The paper's value of a figure, and the drives that it is taken over. None where the paper does not state it."""
    drive = streams[:4]
    if at is not None and streams.endswith("drives"):
        found = _OF_RANGE.get((experiment, at, quantity))
    elif (experiment, drive, quantity) in _OF_DRIVE:
        return _OF_DRIVE[experiment, drive, quantity], drive
    else:
        found = _OF_ALL.get((experiment, variant, quantity))
    return None if found is None else (found, ALL_DRIVES)
