"""The text of a file that is the same for every database, with where it comes from."""

from importlib import resources

from analysis.exports.source import TerrainExport


def template(name: str, export: TerrainExport) -> bytes:
    """Return a Python module of this package as it is exported."""
    text = (resources.files("analysis.exports.templates") / name).read_text()
    return f"# {export.origin}.\n{text}".encode()
