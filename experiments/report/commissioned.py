"""Which trials were recorded with an arm that is not commissioned completely."""

from collections.abc import Iterable, Mapping

from experiments.commissioning.evidence.gate import COMPLETE, FIELD

_UNKNOWN = "uncommissioned: recorded without a commissioning"


def uncommissioned(
    trials: Iterable[tuple[str, Mapping[str, Mapping[str, str]]]],
) -> list[str]:
    """Return a sentence for each thing that commissioning left open, in their order.

    A simulated arm needs none.

    Args:
        trials: name and metadata of each.
    """
    open_points: dict[str, list[str]] = {}
    for name, metadata in trials:
        if metadata["trial"].get("simulated") == "true":
            continue
        said = metadata.get("provenance", {}).get(FIELD, _UNKNOWN)
        if said != COMPLETE:
            open_points.setdefault(said, []).append(name)
    return [f"{_span(names)}: {said}." for said, names in open_points.items()]


def _span(names: list[str]) -> str:
    if len(names) == 1:
        return names[0]
    return f"{len(names)} trials, {names[0]} to {names[-1]}"
