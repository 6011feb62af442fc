"""One row for each item of a batch: what it was, and what came out.

Excluded: the numbers of one result (`pushfit.fit.identify.result_row`).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from pushfit.batch.items import Item, ItemFailure, Plan
from pushfit.batch.store import Finished
from pushfit.fit.identify.result_row import Cell

FAILED = "failed"
# What a row says besides the values of the result, in this order.
ABOUT = (
    "item",
    "status",
    "kind",
    "sha256",
    "schedule",
    "schedule_sha256",
    "config",
    "seed",
    "duplicate_of",
)

Row = Mapping[str, Cell]


@dataclass(frozen=True, slots=True, kw_only=True)
class Answers:
    """What a batch says.

    Args:
        rows: One for each item, also a failed one, sorted by name.
        failures: Sorted by name of the item, in the words of who reads them.
    """

    rows: tuple[Row, ...]
    failures: tuple[ItemFailure, ...]


def collect(
    plan: Plan,
    failed: Mapping[str, ItemFailure],
    find: Callable[[str], Finished | None],
    *,
    worded: Callable[[str], str],
) -> Answers:
    """All that is known of the items, in an order that computing does not change.

    Args:
        failed: What failed, by key of the item.
        worded: Puts messages into the words of who reads them.
    """
    first: dict[str, str] = {}
    failures = list(plan.failures)
    rows = [_row(failure.item, None) for failure in plan.failures]
    for item in plan.items:
        original = first.setdefault(item.key, item.name)
        if item.key in failed:
            failures.append(replace(failed[item.key], item=item.name))
        finished = find(item.key)
        about = _about(item, finished)
        about["duplicate_of"] = None if original == item.name else original
        rows.append(_row(item.name, finished) | about)
    return Answers(
        rows=tuple(sorted(rows, key=lambda row: str(row["item"]))),
        failures=tuple(
            replace(failure, message=worded(failure.message))
            for failure in sorted(failures, key=lambda failure: failure.item)
        ),
    )


def _row(name: str, finished: Finished | None) -> dict[str, Cell]:
    """Row of an item, so far without where it came from."""
    row: dict[str, Cell] = dict.fromkeys(ABOUT)
    row |= {"item": name, "status": FAILED}
    if finished is not None:
        row |= {"kind": finished.kind, **finished.values}
    return row


def _about(item: Item, finished: Finished | None) -> dict[str, Cell]:
    about: dict[str, Cell] = {
        "sha256": item.sha256,
        "config": item.config_from,
        "seed": item.seed,
    }
    if finished is not None and finished.kind == "recording":
        about["schedule"] = item.schedule
        about["schedule_sha256"] = item.schedule_sha256
    return about
