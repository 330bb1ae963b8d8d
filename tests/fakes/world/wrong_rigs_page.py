"""Print the catalogue of wrong rigs in Markdown.

`python -m tests.fakes.world.wrong_rigs_page > docs/wrong-rigs.md`
"""

import sys

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
from fakes.world.wrong_rigs import Class, catalogue

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

## Sound rigs

No two sound arms are alike. A wrong rig, and `traction fake --seed N`, is one of many,
drawn by its seed from a random stream of its own; the figures are one standard
deviation and assumed: no WAM has published them.

"""


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
    lines = [HEAD + "\n".join(rows)]
    for kind in Class:
        lines.append(f"\n## {kind.value.capitalize()}\n")
        lines.append("| # | name | what is wrong | plausible cause | found at |")
        lines.append("|---|---|---|---|---|")
        lines += [
            f"| {rig.number} | `{rig.name}` | {rig.wrong} | {rig.cause} "
            f"| {', '.join(rig.steps) or 'missed'} |"
            for rig in catalogue().values()
            if rig.kind is kind
        ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.stdout.write(page())
