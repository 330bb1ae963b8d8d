"""The tables of attacks; each name is one of `python -m tests.attacks`."""

from collections.abc import Callable, Sequence

from tests.attacks.attack import Attack
from tests.borders.table import border_attacks
from tests.corpus.damaged import damage_attacks
from tests.crash.disks import disk_attacks
from tests.disturbances.measure import disturbance_attacks
from tests.faults.matrix import fault_attacks
from tests.faults.pairs import pair_attacks
from tests.faults.process_faults import process_attacks
from tests.wrong_rigs import rig_attacks, sound_attacks

TABLES: dict[str, Callable[[], Sequence[Attack]]] = {
    "faults": fault_attacks,
    "pairs": pair_attacks,
    "processes": process_attacks,
    "wrong-rigs": rig_attacks,
    "sound-arms": sound_attacks,
    "disturbances": disturbance_attacks,
    "borders": border_attacks,
    "damaged-inputs": damage_attacks,
    "disks": disk_attacks,
}
