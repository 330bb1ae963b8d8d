from typing import Any

class ContextEntity:
    def __init__(
        self, crate: object, identifier: str, properties: dict[str, Any]
    ) -> None: ...
