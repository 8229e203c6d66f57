"""The list of seeded faults fits the code; whether each is caught takes long and is asked by `make mutants`."""

import pytest
from run import ROOT, Mutant, mutants


@pytest.mark.parametrize("mutant", mutants(), ids=lambda mutant: mutant.file)
def test_a_seeded_fault_can_be_put_into_the_code(mutant: Mutant) -> None:
    assert mutant.changed(ROOT) != (ROOT / mutant.file).read_text("utf-8")
    assert all((ROOT / test.partition("::")[0]).is_file() for test in mutant.tests)


def test_there_are_faults_in_every_package() -> None:
    there = {str(path.parent.relative_to(ROOT)) for path in ROOT.glob("*/*/__init__.py")}
    with_faults = {"/".join(mutant.file.split("/")[:2]) for mutant in mutants()}
    assert {name for name in there if name.startswith(("app/", "lidarcore/"))} - with_faults == {
        "app/benchmarks"
    }
