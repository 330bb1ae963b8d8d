"""The words of docs/friction.md around what two commands measure."""

MEASURED = (
    "| friction | compensated | trials | F_n at rest [N] | by statics ± [N] "
    "| hand sliding [N] | slips back | way back [mm] | of it joint 6 |\n"
    "|---|---|---|---|---|---|---|---|---|"
)
SESSIONS, SLIDING = "## Sessions", "## Sliding at a constant speed"
CALIBRATIONS = "## Calibrations"
_HEAD = """# Friction of the drives

What dry friction does to this experiment, and how much of it can be compensated. All
of it is simulated: the friction of `fakes/plant/friction.py` at a share of what was
identified on another arm (OWD), break-away and Stribeck speed ASSUMED. Simulated arms
have 0.4 of it (ASSUMED, between that arm and what others put into their models) unless
`--friction` says otherwise; `--cables HZ` sets the resonance of the joints on their
cables, 8 to 25 Hz (ASSUMED: none is published). The parts below are written
by their commands.

With 1.2 times the true friction assumed by the compensation, torques 4 ms late and
cables of 8, 15 and 20 Hz, at joints 2, 4 and 6, without a hand, in a loose and in a
stiff one, nothing oscillates
(`pytest -m slow tests/fakes/world/test_compensated_float.py`).

F_t and F_n are measured at the wrist, below every drive, and v_t at the joints: models
of the ground are not biased by joint friction. It limits the loads and speeds that a
trial reaches: F_n at rest, the push, and whether a slip goes back.
"""
_SESSIONS = """
`python -m studies.friction --write docs/friction.md`: at each share one calibration,
then ten trials on S0 without and with each compensation (seed 3).

![F_n at rest, hand and way back]({image})

{table}

F_n at rest: mean of the 0.4 s before the hand pushes, mean and standard deviation over
the put-downs; {load:.2f} N were set. By statics: half the width of the interval that
friction leaves at the far end, upper end (95 %) of what the calibration found. Hand:
true horizontal force while the foot is faster than 0.02 m/s. Slips back: smoothed v_t
below -0.01 m/s within 0.6 s; medians of the way back and of joint 6's part of the
lowest v_t (below 0: against it).

The goal is a mean within 10 % of the load and a deviation of 0.3 N at most:

{goals}

At 0.02 the calibration is refused: such a friction is hardly above the residual
of gravity and inertia, and needs no compensation.

What the compensation cannot reach: it subtracts at most {most:g} of the *lower bound*
of sliding friction, at the worst place of a motor's turn, because more would drive an
arm whose cables have worn in. Of the break-away of a joint it leaves a third to a half.
The foot comes to rest on its way down, so what is left tends to hold it up: the
shortfall has one sign and does not average out over put-downs. Without compensation the
whole friction holds part of what the hand had pressed: no weight, but more than with
it. A mean within 10 % of the load needs a heavier virtual mass (`traction check` prints
it) or an arm with less friction.
"""
_MOST = 0.8


def page_text(
    old: str, rows: list[str], image: str, load: float, goals: str = ""
) -> str:
    """Return the page with the sessions anew; its calibrations stay as they were.

    Args:
        old: the page before; empty = there is none.
        rows: of the table of sessions.
        image: file name of the figure.
        load: that which was set [N].
        goals: lines on what was wanted, and what was met.
    """
    table = "\n".join([MEASURED, *rows])
    fields = {"image": image, "table": table, "load": load, "goals": goals}
    body = _SESSIONS.format(**fields, most=_MOST)
    return _put(old, SESSIONS, body)


def with_calibrations(old: str, body: str) -> str:
    """Return the page with the proof of the calibrations anew."""
    return _put(old, CALIBRATIONS, body)


def with_sliding(old: str, body: str) -> str:
    """Return the page with the loads of a sliding foot anew."""
    return _put(old, SLIDING, body)


def _put(old: str, heading: str, body: str) -> str:
    parts = {name: _part(old, name) for name in (SESSIONS, SLIDING, CALIBRATIONS)}
    parts[heading] = body.strip()
    shown = [f"{name}\n\n{text}" for name, text in parts.items() if text]
    return "\n\n".join([_HEAD.strip(), *shown]) + "\n"


def _part(page: str, heading: str) -> str:
    """Return what stands below `heading` up to the next one."""
    _, found, rest = page.partition(f"{heading}\n")
    return rest.split("\n## ")[0].strip() if found else ""
