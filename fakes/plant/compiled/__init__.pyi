from .body import CompiledBody
from .gauges import CompiledGauges

__all__ = ["CompiledBody", "CompiledGauges"]
