from collections.abc import Callable
from types import ModuleType

def attach_stub(
    package_name: str, filename: str
) -> tuple[Callable[[str], ModuleType], Callable[[], list[str]], list[str]]: ...
