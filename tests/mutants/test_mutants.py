"""The list of seeded faults fits the code; whether each is caught takes long and is asked by `make mutants`."""

from pathlib import PurePath

import pytest
from run import ROOT, Mutant, mutants


@pytest.mark.parametrize("mutant", mutants(), ids=lambda mutant: mutant.file)
def test_a_seeded_fault_can_be_put_into_the_code(mutant: Mutant) -> None:
    assert mutant.changed(ROOT) != (ROOT / mutant.file).read_text("utf-8")
    assert all((ROOT / test.partition("::")[0]).is_file() for test in mutant.tests)


def test_there_are_faults_in_every_package() -> None:
    """What measures speed alone does not count: no test is timed."""
    packages = {
        str(path.parent.relative_to(ROOT))
        for code in ("app", "lidarcore")
        for path in (ROOT / code).rglob("__init__.py")
    }
    with_faults = {str(PurePath(mutant.file).parent) for mutant in mutants()}
    code = {
        name for name in packages if any(not path.name.startswith("_") for path in (ROOT / name).glob("*.py"))
    }
    assert code - with_faults == {"app", "app/benchmarks", "lidarcore/evaluation/speed"}
