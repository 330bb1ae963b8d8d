"""ONNX graphs give the same forces with few operators, and NaN stays NaN."""

import sys

import numpy as np
import onnx
import pytest
from onnx.reference import ReferenceEvaluator
from onnxruntime import InferenceSession

from acquisition.errors import MissingLibraryError
from analysis.terrains.export.folder import target_files
from tests.analysis.terrains.export.databases import database, export, points
from tests.analysis.terrains.export.written import write

ROW = np.array([[3.5, 0.05]], dtype=np.float32)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write(tmp_path_factory.mktemp("onnx"), "onnx")


def runner(path, engine):
    """Return a function from rows to forces by one of two independent runtimes."""
    if engine == "reference":
        session = ReferenceEvaluator(str(path))
    else:
        session = InferenceSession(str(path))
    return lambda rows: session.run(None, {"x": rows})[0]


@pytest.mark.parametrize("engine", ["reference", "onnxruntime"])
@pytest.mark.parametrize("name", ["S0", "TF"])
def test_forces_agree_to_single_precision(folder, name, engine):
    F_n, v_t = points()
    usual = (np.abs(F_n) < 1e30) & (v_t < 1e30)
    rows = np.column_stack([F_n, v_t])[usual].astype(np.float32)
    known = database().terrain(name)
    expected = known.predict(*rows.astype(np.float64).T).forces
    forces = runner(folder / f"{name}.onnx", engine)(rows)
    assert np.abs(forces.T - expected).max() <= 1e-5 * np.abs(expected).max()


@pytest.mark.parametrize("engine", ["reference", "onnxruntime"])
@pytest.mark.parametrize("place", [0, 1])
def test_nan_stays_nan(folder, engine, place):
    row = ROW.copy()
    row[0, place] = np.nan
    run = runner(folder / "S0.onnx", engine)
    assert np.isnan(run(row)).all()
    assert np.isfinite(run(ROW)).all()


def test_the_model_uses_few_operators_and_states_its_origin(folder):
    model = onnx.load(folder / "S0.onnx")
    assert {n.op_type for n in model.graph.node} == {"Gemm", "Max", "Min", "Mul"}
    gemm = [n for n in model.graph.node if n.op_type == "Gemm"]
    assert all({a.name: a.i for a in n.attribute}.get("transB") == 1 for n in gemm)
    assert (model.ir_version, model.opset_import[0].version) == (8, 13)
    about = {p.key: p.value for p in model.metadata_props}
    assert about["terrain"] == "S0"
    assert about["simulated"] == "true"
    assert about["database_sha256"] == export().digest


def test_without_onnx_the_extra_is_reported(monkeypatch):
    monkeypatch.setitem(sys.modules, "onnx", None)
    with pytest.raises(MissingLibraryError, match=r"traction\[onnx\]"):
        target_files("onnx", export())
