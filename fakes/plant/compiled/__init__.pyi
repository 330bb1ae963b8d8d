from .body import CompiledBody

__all__ = ["CompiledBody"]
