"""The RO-Crate of a publication: actions, their agents and files.

RO-Crate 1.1 with the Process Run Crate profile 0.5
(https://w3id.org/ro/wfrun/process/0.5): every recording is an action of the software on
its settings, the study one on the recordings. No other module imports rocrate.
"""

import json
import re
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

from experiments.export.checksums import SUMS, digest_of

if TYPE_CHECKING:
    from experiments.export.credits import Credits

METADATA = "ro-crate-metadata.json"
_PROFILE = "https://w3id.org/ro/wfrun/process/0.5"
_MEDIA = {
    ".mcap": "application/x-mcap",
    ".csv": "text/csv",
    ".json": "application/json",
    ".jsonl": "application/jsonl",
    ".toml": "application/toml",
    ".html": "text/html",
    ".png": "image/png",
    ".pdf": "application/pdf",
    ".md": "text/markdown",
    ".patch": "text/x-diff",
}
_COMMIT = re.compile("[0-9a-f]{40}")


@dataclass(frozen=True, slots=True)
class RecordingAction:
    """Recording of one trial.

    Attributes:
        name: session and trial, e.g. S012/T04.
        terrain: name of the terrain.
        operator: name of the operator.
        started_utc: start, as text.
        seconds: duration of the recording [s].
        software: version that recorded it.
        commit: commit of that version, or "unknown".
        settings: its settings files, relative to the crate.
        results: its resulting files, relative to the crate.
    """

    name: str
    terrain: str
    operator: str
    started_utc: str
    seconds: float
    software: str
    commit: str
    settings: Sequence[str]
    results: Sequence[str]

    @property
    def times(self) -> tuple[str, str]:
        """Begin and end, as ISO 8601 with an offset."""
        start = datetime.fromisoformat(self.started_utc)
        end = start + timedelta(seconds=round(self.seconds))
        return start.isoformat(), end.isoformat()


@dataclass(frozen=True, slots=True)
class StudyAction:
    """Computation of the results.

    Attributes:
        ended_utc: end, as text.
        software: version that computed them.
        commit: commit of that version.
        inputs: the recordings, relative to the crate.
        results: the results, relative to the crate.
    """

    ended_utc: str
    software: str
    commit: str
    inputs: Sequence[str]
    results: Sequence[str]


def is_publication(path: Path) -> bool:
    """Return whether `path` is a folder that `traction publish` wrote."""
    return (path / METADATA).is_file() or (path / SUMS).is_file()


def crate_text(
    folder: Path,
    about: "Credits",
    recordings: Sequence[RecordingAction],
    study: StudyAction,
) -> str:
    """Return `ro-crate-metadata.json` for all files in `folder`.

    Args:
        folder: folder of the publication.
        about: title, authors and licence.
        recordings: actions of the recordings.
        study: the action that made the results.

    Raises:
        TrialFileError: a file cannot be read.
    """
    builder = _CrateBuilder(folder)
    builder.add_root(about)
    for recording in recordings:
        builder.add_recording(recording)
    builder.add_study(study)
    return builder.text()


class _CrateBuilder:
    """Collects the entities of a crate; rocrate is untyped."""

    def __init__(self, folder: Path) -> None:
        from rocrate.rocrate import ROCrate

        self.crate: Any = ROCrate(version="1.1")
        below = (p.relative_to(folder) for p in folder.rglob("*") if p.is_file())
        self.files: Mapping[str, Any] = {
            name: self._file(folder / name, name) for name in sorted(map(str, below))
        }
        self.people: dict[str, Any] = {}
        self.tools: dict[str, Any] = {}

    def add_root(self, about: "Credits") -> None:
        """Describe the publication."""
        root = self.crate.root_dataset
        licence = self._entity(
            about.licence.url,
            "CreativeWork",
            name=about.licence.name,
            description=f"Licence of the data: {about.licence.id}.",
            url=about.licence.url,
        )
        name = "Process Run Crate"
        profile = self._entity(_PROFILE, "CreativeWork", name=name, version="0.5")
        people = [
            self._agent(
                author.crate_id,
                author.name,
                "Person" if author.is_person else "Organization",
            )
            for author in about.authors
        ]
        self.crate.name = about.title
        self.crate.description = about.description
        root["datePublished"] = about.date
        root["license"] = licence
        root["conformsTo"] = profile
        root["author"] = people if len(people) > 1 else people[0]
        root["keywords"] = list(about.keywords)

    def add_recording(self, recording: RecordingAction) -> None:
        """Describe the recording of a trial."""
        start, end = recording.times
        operator = recording.operator or "operator"
        self._action(
            f"#trial-{recording.name.replace('/', '-')}",
            self._tool(recording.software, recording.commit),
            recording.settings,
            recording.results,
            name=f"Recording of {recording.name} on {recording.terrain}",
            description="One push of the foot across the container.",
            startTime=start,
            endTime=end,
            agent=self._agent(f"#operator-{_slug(operator)}", operator),
        )

    def add_study(self, study: StudyAction) -> None:
        """Describe the computation of the results."""
        self._action(
            "#study",
            self._tool(study.software, study.commit),
            study.inputs,
            study.results,
            name="Fit, cross-validation and report",
            description="Models fitted and compared with one trial left out at a time.",
            endTime=datetime.fromisoformat(study.ended_utc).isoformat(),
            agent=self.crate.root_dataset["author"],
        )

    def text(self) -> str:
        """Return the JSON-LD."""
        return json.dumps(self.crate.metadata.generate(), indent=1) + "\n"

    def _file(self, path: Path, name: str) -> object:
        return self.crate.add_file(
            str(path),
            name,
            properties={
                "name": name,
                "encodingFormat": _MEDIA.get(path.suffix, "text/plain"),
                "sha256": digest_of(path),
                "contentSize": str(path.stat().st_size),
            },
        )

    def _entity(self, identifier: str, kind: str, **properties: object) -> object:
        from rocrate.model.contextentity import ContextEntity

        about = {"@type": kind, **properties}
        return self.crate.add(ContextEntity(self.crate, identifier, properties=about))

    def _agent(self, identifier: str, name: str, kind: str = "Person") -> object:
        if identifier not in self.people:
            self.people[identifier] = self._entity(identifier, kind, name=name)
        return self.people[identifier]

    def _tool(self, software: str, commit: str) -> object:
        """Return a version of Traction; a known commit is its identifier."""
        is_known = _COMMIT.fullmatch(commit) is not None
        by_name = uuid.uuid5(uuid.NAMESPACE_OID, software)
        identifier = f"swh:1:rev:{commit}" if is_known else f"urn:uuid:{by_name}"
        if identifier not in self.tools:
            version = software.removeprefix("traction ")
            self.tools[identifier] = self._entity(
                identifier,
                "SoftwareApplication",
                name="Traction",
                url=identifier,
                softwareVersion=f"{version}, commit {commit}",
            )
        return self.tools[identifier]

    def _action(
        self,
        identifier: str,
        tool: object,
        inputs: Sequence[str],
        results: Sequence[str],
        **properties: object,
    ) -> None:
        agent = properties.pop("agent")
        action = self.crate.add_action(
            tool,
            identifier=identifier,
            object=_single([self.files[name] for name in inputs]),
            result=_single([self.files[name] for name in results]),
            properties=properties,
        )
        action["agent"] = agent
        self.crate.root_dataset.append_to("mentions", action)


def _single(values: list[Any]) -> Any:  # noqa: ANN401
    """Return a list of one as its element, as the profile requires."""
    return values[0] if len(values) == 1 else values


def _slug(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9]+", "-", text).strip("-") or "unnamed"
