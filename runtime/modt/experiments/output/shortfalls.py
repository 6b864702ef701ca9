"""Where the figures fall short of the paper's, in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from modt.experiments import paper
from modt.experiments.catalogue.every import EXPERIMENTS
from modt.experiments.drives import KITTI
from modt.experiments.output.tables import number
from modt.experiments.study import DEFAULT, Row

_BETTER_HIGH = ("AP ", "N_go of objects")
_BETTER_LOW = ("beta", "mis-associations", "discontinuities")


def shortfalls(rows: Sequence[Row]) -> Iterator[str]:
    """A section: figures behind the paper's, figures that tracking makes worse, and what cannot be compared."""
    yield "## Where this falls short"
    yield ""
    behind = [row for row in rows if row.paper is not None and _behind(row)]
    if behind:
        yield (
            "Behind the paper: "
            + "; ".join(
                f"{_named(row)} {number(row.value or 0)}, not {number(row.paper or 0)} ({row.paper_over})"
                for row in behind
            )
            + "."
        )
    else:
        yield "No figure that the paper states is better than ours on the drives at hand."
    worse = list(_made_worse(rows))
    if worse:
        yield "Fused views are worse than single ones: " + "; ".join(worse) + "."
    yield from _not_compared(rows)


def _behind(row: Row) -> bool:
    value, stated = row.value or 0.0, row.paper or 0.0
    low, high = row.quantity.startswith(_BETTER_LOW), row.quantity.startswith(_BETTER_HIGH)
    return (low and value > 1.05 * stated) or (high and value < stated)


def _made_worse(rows: Sequence[Row]) -> Iterator[str]:
    """Average precisions in which tracking costs something."""
    without = {(r.experiment, r.streams, r.profile, r.quantity): r for r in rows if r.variant == "det_only"}
    for row in rows:
        before = without.get((row.experiment, row.streams, row.profile, row.quantity))
        if row.experiment not in ("table4", "table5") or row.variant != "with_trk" or before is None:
            continue
        if row.value is not None and before.value is not None and row.value < before.value:
            yield f"{_named(row)} {number(row.value)}, not {number(before.value)}"


def _not_compared(rows: Sequence[Row]) -> Iterator[str]:
    with_scans = {row.streams[:4] for row in rows if row.kind == KITTI and row.experiment == "table5"}
    lacking = [drive for drive in paper.DRIVES if drive not in with_scans]
    if lacking and len(lacking) < len(paper.DRIVES):
        yield (
            f"Of the paper's drives, sweeps of {', '.join(lacking)} were not at hand: its averages over eight drives "
            "stand beside figures of fewer."
        )
    few = sorted({(r.n, r.streams, r.quantity) for r in rows if r.kind == KITTI and _few(r)})
    if few:
        named = "; ".join(f"{quantity[3:]}: {n} on {streams}" for n, streams, quantity in few)
        yield f"Too few objects to tell ({named}): their intervals say little, or there is none."
    yield (
        "Simulated drives are cleaner than real ones: what they rank may not hold on a road. The detector that the "
        "paper stops at 40 epochs is another network; compare with the profile that stands for it."
    )


def _few(row: Row) -> bool:
    return row.experiment == "table5" and row.quantity.startswith("AP ") and row.n is not None and row.n < 5


def _named(row: Row) -> str:
    where = "" if row.at is None else f" at {row.at:g}"
    title = EXPERIMENTS[row.experiment].title.partition(":")[0]
    names = "" if row.profile == DEFAULT else f"profile {row.profile}, "
    return f"{title}, {row.streams}, {names}{row.variant}, {row.quantity}{where}:"
