"""Places of containers, stated in rig.toml or taught by hand."""

from pydantic import Field

from acquisition.settings import File, SettingsSection
from acquisition.toml_files import TomlFile
from experiments.settings.matrix import Angles, FarEnd, Heading, Incline, Travel


class StatedPlace(SettingsSection):
    """Place of a container, shared by several cells of the matrix.

    Attributes:
        far_end: point of the ground where trials start, in the base frame [m].
        heading_deg: direction from the base to the container [degrees].
        incline_deg: incline of the container, positive if its far end is high
            [degrees].
        travel: length of a trial [m].
        start: joint angles with the foot at the far end [rad]; computed if omitted.
        calibration: file of `traction calibrate terrain`.
        taught: file of `traction teach`, in place of the numbers above.
    """

    far_end: FarEnd | None = Field(default=None, examples=[[0.70, 0.0, 0.12]])
    heading_deg: Heading | None = Field(default=None, examples=[0.0])
    incline_deg: Incline | None = Field(default=None, examples=[10.0])
    travel: Travel | None = Field(default=None, examples=[0.45])
    start: Angles | None = Field(
        default=None, examples=[[0, 0.77, 0, 1.19, 0, 1.19, 0]]
    )
    calibration: File | None = Field(default=None, examples=["terrain_bay2.toml"])
    taught: File | None = Field(default=None, examples=["place_bay2.toml"])

    @property
    def has_numbers(self) -> bool:
        """Whether any number of the location is stated."""
        stated = self.far_end, self.heading_deg, self.incline_deg, self.travel
        return any(value is not None for value in stated)


class TaughtPlace(TomlFile):
    """A file of `traction teach`.

    Attributes:
        place: name of the place.
        far_end: point of the ground where trials start, in the base frame [m].
        heading_deg: direction from the base to the container [degrees].
        incline_deg: incline of the line between the two ends [degrees].
        travel: length of a trial [m].
        start: joint angles with the foot at the far end [rad].
        foot: foot with which it was touched.
        arm: serial numbers of the arm's pucks, joints 1 to 7.
        measured_utc: time of the measurement.
        simulated: whether the devices were simulated.
        spread_mm: largest distance between repeated touches of one end [mm].
    """

    place: str
    far_end: FarEnd
    heading_deg: Heading
    incline_deg: Incline
    travel: Travel
    start: Angles
    foot: str
    arm: tuple[int, ...]
    measured_utc: str
    simulated: bool
    spread_mm: float = Field(ge=0)

    def as_place(self, name: str) -> StatedPlace:
        """Return the taught place; `name` is its file."""
        return StatedPlace(
            far_end=self.far_end,
            heading_deg=self.heading_deg,
            incline_deg=self.incline_deg,
            travel=self.travel,
            start=self.start,
        ).model_copy(update={"taught": name})
