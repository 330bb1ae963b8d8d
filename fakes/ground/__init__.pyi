from .contact import NO_CONTACT
from .terrain import Container, Terrain, make_terrain

__all__ = [
    "NO_CONTACT",
    "Container",
    "Terrain",
    "make_terrain",
]
