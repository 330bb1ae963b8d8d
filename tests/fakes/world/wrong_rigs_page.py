"""Print the catalogue of wrong rigs in Markdown.

`python -m tests.fakes.world.wrong_rigs_page > docs/wrong-rigs.md`
"""

import sys
from pathlib import Path

from experiments.commissioning.steps import ORDER, ProofStep
from fakes.world.departure import (
    AXES,
    CABLE,
    CENTRE,
    GAINS,
    MASS,
    STOPS,
    TILT,
    ZEROS,
)
from fakes.world.wrong_rigs import Class, catalogue, wrong_rig
from tests.wrong_rigs import read_kept

_DEGREE = 0.017453292519943295  # rad
HEAD = """\
# Wrong rigs

The program believes what it is told about a rig: properties of the pucks, wiring,
signs, ratios, zeros, mounting, masses, sensor, container. A simulated rig can be one
that is not as it is told: `--wrong NAME` of every command with `--fake`, and of
`traction fake`; `--wrong help` lists the names. What is wrong is applied at the truth:
arm, cables, sensor, pucks, module, bus, container. Only what is mistyped is applied to
the settings, which refuse it where rig.toml would be refused.

Made by `python -m tests.fakes.world.wrong_rigs_page > docs/wrong-rigs.md`; tests in
`tests/fakes/world/test_wrong_rigs.py` hold that every rig differs as it is named. Some
are refused at every start already, by what the pucks say or by who is on the bus.
`python -m tests.wrong_rigs [NAME ...]` commissions them and says which step found them.

"found at" is what was designed. "commissioned" is what `traction commission` made of
them, kept by `python -m tests.wrong_rigs --seeds 1,2,3 --friction 0.4,0.7,1.0 --keep
tests/fakes/world/wrong_rigs.csv`, which goes on where it was left: the step at which it
stopped, how many of the arms (an empty cell: not run yet), and the largest energy of
the arm, way and speed of the sole until then, where it was active.

## Sound rigs

No two sound arms are alike. A wrong rig, and `traction fake --seed N`, is one of many,
drawn by its seed from a random stream of its own; the figures are one standard
deviation and assumed: no WAM has published them.

"""


TABLE = Path(__file__).with_name("wrong_rigs.csv")


def _commissioned(name: str) -> str:
    """Return what became of the arms with this wrong, in words; "" = not run."""
    endings = [ending for run, ending in read_kept(TABLE).items() if run[0] == name]
    words = [ending.words for ending in endings]
    parts = [f"{word} ({words.count(word)})" for word in sorted(set(words))]
    energy = max((ending.energy for ending in endings), default=0.0)
    if energy:
        travel = max(ending.travel for ending in endings)
        speed = max(ending.speed for ending in endings)
        moved = f"{1e3 * energy:.0f} mJ, {1e3 * travel:.0f} mm, {speed:.2f} m/s"
        parts.append(moved)
    return ", ".join(parts)


def summary() -> str:
    """Return how many arms were commissioned, found, and found before any torque."""
    runs = read_kept(TABLE)
    names = {name for name, _, _ in runs if name}
    wrong = [(run[0], ending) for run, ending in runs.items() if run[0]]
    sound = [ending for run, ending in runs.items() if not run[0]]
    found = [(name, ending) for name, ending in wrong if ending.step]
    listed = sum(ending.step in wrong_rig(name).steps for name, ending in found)
    active = ORDER.index(ProofStep.REST_POSE)
    before = sum(ORDER.index(ProofStep(e.step)) < active for _, e in found)
    most = [max((e.energy, e.travel, e.speed)[k] for _, e in wrong) for k in range(3)]
    return (
        f"{len(wrong)} wrong arms of {len(names)} of the {len(catalogue())} rigs were "
        f"commissioned: {len(found)} found, {listed} of them at a step that was "
        f"designed for it, {before} before any torque. Until then {1e3 * most[0]:.0f} "
        f"mJ, {1e3 * most[1]:.0f} mm and {most[2]:.2f} m/s of the sole at most."
        + (f" {len(sound)} sound arms were commissioned, " if sound else "")
        + (f"{sum(bool(e.step) for e in sound)} of them stopped." if sound else "")
    )


def page() -> str:
    """Return the page."""
    rows = [
        "| what differs | by |",
        "|---|---|",
        f"| zeros of the joints | {ZEROS / _DEGREE:.1f} degrees |",
        f"| mechanical stops | {STOPS / _DEGREE:.1f} degrees |",
        f"| tilt of the base about x and y | {TILT / _DEGREE:.1f} degrees |",
        f"| axes of the wrist sensor | {AXES / _DEGREE:.1f} degrees |",
        f"| its six gains | {100 * GAINS:.1f} % |",
        f"| mass of the foot | {100 * MASS:.1f} % |",
        f"| centre of the foot, per axis | {1e3 * CENTRE:.0f} mm |",
        f"| pull of the sensor's cable, per axis | {CABLE:.2f} N |",
    ]
    lines = [HEAD + "\n".join(rows), "", "## What became of them", "", summary()]
    for kind in Class:
        lines.append(f"\n## {kind.value.capitalize()}\n")
        head = (
            "| # | name | what is wrong | plausible cause | found at | commissioned |"
        )
        lines += [head, "|---|---|---|---|---|---|"]
        lines += [
            f"| {rig.number} | `{rig.name}` | {rig.wrong} | {rig.cause} "
            f"| {', '.join(rig.steps) or 'missed'} | {_commissioned(rig.name)} |"
            for rig in catalogue().values()
            if rig.kind is kind
        ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.stdout.write(page())
