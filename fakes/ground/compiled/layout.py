"""How a ground lies in memory for its compiled steps: one record of plain numbers."""

import numpy as np

from fakes.ground.profile import POINTS

MOST_STONES = 8
CHANCES = 64  # numbers that are drawn ahead

# Kinds of ground.
NONE, GIVEN, PLATE, BED = 0, 1, 2, 3

# What a step waits for before it can go on; each is a draw from the trial's generator.
DONE, LANDED, BROKEN, COLLAPSED, SHUFFLED, OUT_OF_CHANCES = 0, 1, 2, 3, 4, 5

# Where a step goes on. A step that waits keeps everything else in the record.
BEGIN, ON_THE_GROUND, ALONG_THE_STONES, AFTER_THE_STONES, TOTAL = 0, 1, 2, 3, 4

_FOOTING = [
    ("k_lateral", float),
    ("aside", float),
    ("turn_x", float),
    ("turn_y", float),
    ("turn_z", float),
]
_PLATE = [
    ("mu_s", float),
    ("mu_k", float),
    ("v_S", float),
    ("b", float),
    ("s0", float),
    ("s1", float),
    ("level", float),
    ("bristle", float),
    ("pressed", float),
]
_BED = [
    ("sink", float),
    ("sink_limit", float),
    ("aloft", float),
    ("stood_at", float),  # not a number: nowhere yet
    ("away", float),
]
_JAM = [
    ("count", np.int64),
    ("c_t", float),
    ("b_g", float),
    ("weights", float),
    ("J", float),
    ("T", float),
    ("age", float),
    ("elastic", float),
    ("is_loaded", np.int64),
    ("weight", float, (MOST_STONES,)),
    ("k", float, (MOST_STONES,)),
    ("capacity", float, (MOST_STONES,)),
    ("engage_at", float, (MOST_STONES,)),
    ("anchor", float, (MOST_STONES,)),  # not a number: detached
    ("chances", float, (CHANCES,)),
    ("chance", np.int64),  # the next one
]
_WAITING = [
    ("phase", np.int64),
    ("stone", np.int64),
    ("depth", float),
    ("sunk_before", float),
    ("F_n", float),
    ("slope_here", float),
    ("sunk", float),
    ("capacity_now", float),
    ("creep", float),
    ("skin", float),
    ("elastic_sum", float),
    ("rolling", float),
    ("pushed", np.int64),
    ("detached", np.int64),
]


_PROFILES = [
    (name, float, (POINTS,)) for name in ("cop_x", "cop_y", "profile", "slope")
]

# The contact is what the last step did to the foot; that of a ground of kind `GIVEN` is
# what the next step takes. The profile of a plate is its texture.
GROUND = np.dtype(
    [
        ("kind", np.int64),
        ("has_boards", np.int64),
        ("k_n", float),
        ("c_n", float),
        ("contact", float, (6,)),
        *_FOOTING,
        *_PLATE,
        *_BED,
        *_JAM,
        *_WAITING,
        *_PROFILES,
    ],
    align=True,
)
