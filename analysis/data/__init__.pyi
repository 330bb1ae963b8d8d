from .columns import parse_columns, parse_units
from .data_package import (
    DESCRIPTOR,
    DataPackage,
    PackagedTable,
    PackageField,
    PackageFile,
    TableOrigin,
    TableSchema,
)
from .events import Slip, find_slips
from .inertia import WINDOW
from .lag import ForceLag, force_lag
from .load import Frame, RecordedTrial, load_trial
from .parquet_tables import to_parquet
from .plausibility import LATEST_MS, Doubt, doubts_of, doubts_of_record, summed_up
from .prepare import (
    MINIMUM_KEPT,
    MINIMUM_TRAVEL_SHARE,
    PreparedTrial,
    PrepareOptions,
    Smoothed,
    moving_average,
    prepare_trial,
    smoothed,
)
from .quality import (
    JOINT7_WARNING,
    PULLED_WARNING,
    SENSOR_ERROR,
    CoverageGrid,
    coverage,
    quick_ratio,
    share_below,
    suggest,
)
from .samples import PooledSamples, SampleTable, TrainingSet
from .series import Array, Indices, TractionSeries
from .tables import load_tables
from .tare_bracket import TareBracket
from .terrain_kinds import (
    BIG,
    FLAT,
    LEVELS,
    SMALL,
    groups_of,
    kind_title,
    parse_stones,
    terrain_incline,
    terrain_kind,
)

__all__ = [
    "BIG",
    "DESCRIPTOR",
    "FLAT",
    "JOINT7_WARNING",
    "LATEST_MS",
    "LEVELS",
    "MINIMUM_KEPT",
    "MINIMUM_TRAVEL_SHARE",
    "PULLED_WARNING",
    "SENSOR_ERROR",
    "SMALL",
    "WINDOW",
    "Array",
    "CoverageGrid",
    "DataPackage",
    "Doubt",
    "ForceLag",
    "Frame",
    "Indices",
    "PackageField",
    "PackageFile",
    "PackagedTable",
    "PooledSamples",
    "PrepareOptions",
    "PreparedTrial",
    "RecordedTrial",
    "SampleTable",
    "Slip",
    "Smoothed",
    "TableOrigin",
    "TableSchema",
    "TareBracket",
    "TractionSeries",
    "TrainingSet",
    "coverage",
    "doubts_of",
    "doubts_of_record",
    "find_slips",
    "force_lag",
    "groups_of",
    "kind_title",
    "load_tables",
    "load_trial",
    "moving_average",
    "parse_columns",
    "parse_stones",
    "parse_units",
    "prepare_trial",
    "quick_ratio",
    "share_below",
    "smoothed",
    "suggest",
    "summed_up",
    "terrain_incline",
    "terrain_kind",
    "to_parquet",
]
