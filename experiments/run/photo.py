"""The photo of the bed in the flow of a session: after the trial, or at its verdict."""

from collections.abc import Callable

from acquisition.clock import SystemClock
from acquisition.errors import TractionError
from experiments.operator.console import WARNING
from experiments.run.context import RunContext, RunServices
from experiments.session.photos import PhotoError, add_photo, has_photo
from experiments.session.sidecar import TrialName

_Photo = tuple[bytes, int]  # content, UTC [ns]


def take_photo(services: RunServices, name: TrialName) -> None:
    """Let the camera's command take a photo of the bed, if rig.toml has one."""
    camera = services.camera
    if camera.command:
        take = lambda: (camera.take(), SystemClock().utc_ns())  # noqa: E731
        _add(services, name, "command", take)


def collect_photo(context: RunContext, name: TrialName) -> None:
    """Take the newest photo that was dropped since the trial began, if any."""
    camera, since_ns = context.camera, context.state.trial_began_utc_ns
    if camera.folder is not None and not has_photo(context.metadata.folder, name):
        _add(context, name, "folder", lambda: camera.dropped(since_ns))


def _add(
    services: RunServices,
    name: TrialName,
    source: str,
    get: Callable[[], _Photo | None],
) -> None:
    """Put a photo beside a trial; what goes wrong is said and costs nothing."""

    def add() -> str:
        photo = get()
        folder = services.metadata.folder
        return "" if photo is None else add_photo(folder, name, *photo, source)

    try:
        file = services.console_loop.run_aside(add)
    except (PhotoError, OSError, TractionError) as error:
        services.say(f"{WARNING} No photo of the bed: {error}.")
        return
    if file:
        services.say(f"Photo of the bed: {file}")
