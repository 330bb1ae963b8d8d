from typing import Any

class ROCrate:
    root_dataset: Any
    metadata: Any
    name: str
    description: str
    def __init__(self, source: str | None = ..., *, version: str = ...) -> None: ...
    def add(self, *entities: object) -> Any: ...
    def add_file(
        self, source: str, dest_path: str, *, properties: dict[str, Any]
    ) -> Any: ...
    def add_action(
        self,
        instrument: object,
        *,
        identifier: str,
        object: object,
        result: object,
        properties: dict[str, Any],
    ) -> Any: ...
