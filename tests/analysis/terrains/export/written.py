"""Exported files on the disk."""

from analysis.terrains.export.folder import target_files
from tests.analysis.terrains.export.databases import export


def write(folder, target, **options):
    """Write the files of a target for the two terrains into `folder`, and return it."""
    for path, content in target_files(target, export(**options)).items():
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)
    return folder
