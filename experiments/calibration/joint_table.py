"""Table of fitted values per joint."""

from collections.abc import Sequence

from experiments.operator.console import Console
from wam.model.constants import Array


def show_joints(
    console: Console, quantity: str, rows: Sequence[tuple[str, Array]]
) -> None:
    """Print a row for each measure, a column for each joint.

    Args:
        console: output.
        quantity: name of the quantity, with its unit.
        rows: name of the measure, and its values of joints 1 to 7, shape (7,).
    """
    header = [quantity, *(f"joint {joint}" for joint in range(1, 8))]
    console.table(
        header, [[name, *(f"{value:.3f}" for value in row)] for name, row in rows]
    )
