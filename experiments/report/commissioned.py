"""Trials recorded with an arm whose commissioning was incomplete."""

from collections.abc import Iterable, Mapping

from experiments.commissioning.evidence.record import COMPLETE, FIELD

_UNKNOWN = "uncommissioned: recorded without a commissioning"


def uncommissioned(
    trials: Iterable[tuple[str, Mapping[str, Mapping[str, str]]]],
) -> list[str]:
    """Return a sentence for each gap of the commissioning, in order.

    A simulated arm needs no commissioning.

    Args:
        trials: names and metadata of the trials.
    """
    gaps: dict[str, list[str]] = {}
    for name, metadata in trials:
        if metadata["trial"].get("simulated") == "true":
            continue
        gap = metadata.get("provenance", {}).get(FIELD, _UNKNOWN)
        if gap != COMPLETE:
            gaps.setdefault(gap, []).append(name)
    return [f"{_span(names)}: {gap}." for gap, names in gaps.items()]


def _span(names: list[str]) -> str:
    if len(names) == 1:
        return names[0]
    return f"{len(names)} trials, {names[0]} to {names[-1]}"
