"""Results of a study on disk, by the hash of what they were made from.

An interrupted study resumes where it stopped, and a study repeated with one choice
changed repeats only what that choice touches. A file that is damaged, foreign or of
another version counts as not there.
"""

import hashlib
import json
from pathlib import Path
from typing import Any

from analysis.data.samples import SampleTable
from analysis.gp import kernels, noise
from analysis.gp.arcsine import Arcsine
from analysis.gp.regression import GaussianProcess
from analysis.gp.search import Start
from analysis.study.atomic_files import write_atomic
from analysis.study.crossval import FoldResult, FoldTask, ModelFold
from analysis.study.metrics import Score
from analysis.study.models import FitOptions, GpModel, TustinModel
from analysis.study.noise_selection import NoiseChoice, TailedNoise
from analysis.study.serialise import decode, encode
from analysis.study.terrain_fit import PooledTustinFit, TerrainTask
from analysis.tustin import model as tustin
from analysis.tustin.identifiability import Interval, Profiles

VERSION = 3  # of the numbers: higher whenever the same task gives another result

TYPES = {
    kind.__name__: kind
    for kind in (
        Arcsine,
        FitOptions,
        FoldResult,
        FoldTask,
        GaussianProcess,
        GpModel,
        Interval,
        ModelFold,
        NoiseChoice,
        Profiles,
        SampleTable,
        Score,
        Start,
        TailedNoise,
        PooledTustinFit,
        TerrainTask,
        TustinModel,
        kernels.Product,
        kernels.SquaredExponential,
        kernels.Sum,
        noise.ConstantNoise,
        noise.LogLinearNoise,
        tustin.TustinBounds,
        tustin.TustinFit,
        tustin.TustinForm,
        tustin.TustinParameters,
    )
}


class ResultStore:
    """Keeps one file per task below a folder.

    Args:
        folder: made when the first result is kept; may be deleted at any time.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def get(self, task: Any) -> Any | None:  # noqa: ANN401
        """Return the result of a task done before, None if there is none."""
        try:
            content = json.loads(self._path(task).read_bytes())
            is_whole = content["digest"] == _digest(content["result"])
            return decode(content["result"], TYPES) if is_whole else None
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            return None

    def put(self, task: Any, result: Any) -> None:  # noqa: ANN401
        """Keep a result.

        Raises:
            SettingsError: the folder cannot be written.
        """
        plain = encode(result)
        content = {"digest": _digest(plain), "result": plain}
        write_atomic(self._path(task), json.dumps(content).encode())

    def _path(self, task: Any) -> Path:  # noqa: ANN401
        return self._folder / f"{task_key(task)}.json"


def task_key(task: Any) -> str:  # noqa: ANN401
    """Return the hash of a task: its data, its options, the version of the numbers."""
    return _digest({"version": VERSION, "task": encode(task)})


def _digest(plain: Any) -> str:  # noqa: ANN401
    text = json.dumps(plain, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()
