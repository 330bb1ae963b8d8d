import pytest

from acquisition.linear_algebra import openblas_settings

THREADS = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
FLAGS = "fpu avx2 avx512f avx512dq avx512cd avx512bw avx512vl"


def write_cpuinfo(tmp_path, vendor="AuthenticAMD", family="26", flags=FLAGS):
    path = tmp_path / "cpuinfo"
    core = f"vendor_id\t: {vendor}\ncpu family\t: {family}\nflags\t\t: {flags}\n\n"
    path.write_text(f"processor\t: 0\n{core}processor\t: 1\n{core}")
    return path


def test_a_processor_unknown_to_openblas_gets_compatible_kernels(tmp_path):
    environment = openblas_settings(write_cpuinfo(tmp_path))
    assert environment == THREADS | {"OPENBLAS_CORETYPE": "SkylakeX"}


@pytest.mark.parametrize(
    "other",
    [
        {"family": "25"},
        {"vendor": "GenuineIntel"},
        {"flags": "fpu avx2 avx512f"},
        {"family": "unknown"},
    ],
)
def test_other_processors_are_left_to_openblas(tmp_path, other):
    assert openblas_settings(write_cpuinfo(tmp_path, **other)) == THREADS


def test_without_processor_information_there_is_one_thread(tmp_path):
    assert openblas_settings(tmp_path / "none") == THREADS
    (tmp_path / "empty").write_text("")
    assert openblas_settings(tmp_path / "empty") == THREADS
