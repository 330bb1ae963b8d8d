"""ONNX graphs: the quantiles of a terrain with only Gemm, Max, Min and Mul.

Runtimes in simulators often lack look-ups and comparisons. With

    u_k = min(max((F_n - F_k) / (F_{k+1} - F_k), 0), 1),  s_l likewise for v_t

and u_0 = s_0 = 1, bilinear interpolation clamped to the table is the sum over k and l
of D_kl u_k s_l, with D the second differences of the table.
"""

from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from analysis.terrains.export.exported import ExportedTerrain, TerrainExport
from analysis.terrains.export.folder import ExportTarget, Files
from analysis.terrains.export.names import shown

OPSET, IR_VERSION = 13, 8
INPUT, OUTPUT = "x", "F_t"


def _files(export: TerrainExport) -> Files:
    return {f"{t.identifier}.onnx": _model(t, export) for t in export.terrains}


def _model(terrain: ExportedTerrain, export: TerrainExport) -> bytes:
    onnx: Any = import_module("onnx")  # optional, so that no type stubs are required
    checker, helper = onnx.checker, onnx.helper

    table = terrain.table
    shares = len(table.shares)
    constants: list[Any] = []
    nodes: list[Any] = []

    def constant(name: str, values: ArrayLike) -> str:
        single = np.ascontiguousarray(values, dtype=np.float32)
        constants.append(onnx.numpy_helper.from_array(single, name))
        return name

    def node(kind: str, output: str, *inputs: str, **attributes: int) -> str:
        nodes.append(helper.make_node(kind, list(inputs), [output], **attributes))
        return output

    def steps(name: str, axis: tuple[float, ...], column: int) -> str:
        """Add nodes for u_0 = 1 and u_k, the clamped position in each axis segment."""
        lengths = np.diff(axis)
        weights, offsets = np.zeros((len(axis), 2)), np.ones(len(axis))
        weights[1:, column] = 1.0 / lengths
        offsets[1:] = -np.array(axis[:-1]) / lengths
        position = node(
            "Gemm",
            f"{name}_way",
            INPUT,
            constant(f"{name}_weights", weights),
            constant(f"{name}_offsets", offsets),
            transB=1,
        )
        above = node("Max", f"{name}_above", position, "zero")
        return node("Min", f"{name}_steps", above, "one")

    constant("zero", np.zeros(1))
    constant("one", np.ones(1))
    u, s = steps("F_n", table.F_n, 0), steps("v_t", table.v_t, 1)
    forces = np.array(table.forces)
    gains = np.diff(forces, axis=1, prepend=0.0)
    gains = np.diff(gains, axis=2, prepend=0.0)
    count = shares * len(table.v_t)
    by_load = constant("gains", gains.transpose(0, 2, 1).reshape(count, -1))
    copies = constant("copies", np.tile(np.eye(len(table.v_t)), (shares, 1)))
    total = constant("total", np.kron(np.eye(shares), np.ones(len(table.v_t))))
    product = node(
        "Mul",
        "product",
        node("Gemm", "gained", u, by_load, transB=1),
        node("Gemm", "copied", s, copies, transB=1),
    )
    node("Gemm", OUTPUT, product, total, transB=1)
    graph = helper.make_graph(
        nodes,
        f"traction_{terrain.identifier}",
        [helper.make_tensor_value_info(INPUT, onnx.TensorProto.FLOAT, ["N", 2])],
        [helper.make_tensor_value_info(OUTPUT, onnx.TensorProto.FLOAT, ["N", shares])],
        constants,
        doc_string=export.origin,
    )
    model = helper.make_model(
        graph,
        producer_name="traction",
        producer_version=shown(export.version),
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
    )
    helper.set_model_props(model, _properties(terrain, export))
    checker.check_model(model, full_check=True)
    return model.SerializeToString()


def _properties(terrain: ExportedTerrain, export: TerrainExport) -> dict[str, str]:
    table = terrain.table
    return {
        "terrain": terrain.name,
        "model": export.model,
        "trials": export.trials_are,
        "simulated": str(export.is_simulated).lower(),
        "shares": " ".join(f"{share:g}" for share in table.shares),
        "F_n": f"{table.F_n[0]:g} {table.F_n[-1]:g} N",
        "v_t": f"{table.v_t[0]:g} {table.v_t[-1]:g} m/s",
        "database_sha256": export.digest,
    }


def _about(export: TerrainExport) -> tuple[str, str, str, str, str, str]:
    table = export.terrains[0].table
    shares = ", ".join(f"{share:g}" for share in table.shares)
    return (
        f"One graph a terrain, opset {OPSET}, IR {IR_VERSION}; operators Gemm, Max, "
        "Min, Mul.",
        f"Input `{INPUT}`, float32 (N, 2): F_n, v_t. Output `{OUTPUT}`, float32 (N, "
        f"{len(table.shares)}): F_t by share.",
        f"Shares: {shares}. `metadata_props` has terrain, model, range and database.",
        f"Clamped to F_n {table.F_n[0]:g}..{table.F_n[-1]:g} N, v_t "
        f"{table.v_t[0]:g}..{table.v_t[-1]:g} m/s; clamping is not reported.",
        "Not finite inputs give NaN. Within 1e-5 of the largest force of the table.",
        'onnxruntime.InferenceSession("S0.onnx").run(None, {"x": x})',
    )


TARGET = ExportTarget("Terrains as ONNX graphs", _files, _about, extra="onnx")
