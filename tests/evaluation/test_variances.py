"""The fit of noise is a maximum of the likelihood: by scipy's chi-square density, and by its optimiser."""

import numpy as np
import pytest
from chance import holds
from scipy.optimize import minimize
from scipy.stats import chi2

from lidarcore import open_recording
from lidarcore.errors import EvaluationError
from lidarcore.evaluation.calibration.variances import variance_model
from lidarcore.evaluation.calibration.wall_beams import beams_on_walls

BANDS = 4
ENOUGH = 1e-3  # of log-likelihood: a twentieth of a standard error
RESOLUTION = 1e-6  # of the mean variance: what is below is none


def log_likelihood(beta, sample, band):
    """Of sigma_band² ... and slope²: dof s / v is chi-square distributed."""
    variances, dof, lever2, _ = sample
    v = beta[band] + lever2 * beta[-1] + RESOLUTION * np.average(variances, weights=dof)
    return float((chi2.logpdf(dof * variances / v, dof) - np.log(v)).sum())


def bands_of(bands, by):
    return np.clip(np.searchsorted(bands.edges, by, side="right") - 1, 0, len(bands.sigmas) - 1)


def fitted(bands):
    return np.square([*(sigma.value for sigma in bands.sigmas), bands.slope.value])


def scatter(recording):
    """Variance, degrees of freedom, lever² and range of each bin, one by one."""
    beams = beams_on_walls(list(open_recording(recording)))
    beams = beams[beams.near()]
    bins = [np.flatnonzero(beams.bin == number) for number in np.unique(beams.bin)]
    bins = [at for at in bins if len(at) >= 10]
    rows = [
        (
            beams.error[at].var(ddof=1),
            len(at) - 1.0,
            (beams.lever[at] ** 2).mean(),
            beams.ranges[at].mean(),
        )
        for at in bins
    ]
    return np.array(rows).T


def misfit(rng):
    """Bins of which some scatter far more than the model has it, as real ones do."""
    bins = int(rng.integers(20, 200))
    lever2 = rng.uniform(0, rng.uniform(0.5, 4), bins) ** 2
    dof = rng.integers(10, 300, bins).astype(float)
    truth = 10 ** rng.uniform(-3, -2, 2)
    v = truth[0] ** 2 + lever2 * truth[1] ** 2
    variances = v * 10 ** (rng.uniform(0, 2) * rng.normal(size=bins)) * rng.chisquare(dof) / dof
    return variances, dof, lever2, rng.uniform(0.5, 5, bins)


def assert_maximum(sample, count, rng):
    bands = variance_model(*sample, count)
    beta, band = fitted(bands), bands_of(bands, sample[3])
    best = log_likelihood(beta, sample, band)
    scale = np.append(np.full(count, np.average(sample[0], weights=sample[1])), 1e-5)
    directions = [*np.eye(count + 1), *-np.eye(count + 1), *rng.normal(size=(60, count + 1))]
    for size in (0.1, 0.01, 1e-3):
        for direction in directions:
            for step in (size * beta * direction, size * scale * direction):
                neighbour = np.maximum(beta + step, 0.0)
                assert log_likelihood(neighbour, sample, band) <= best + ENOUGH, (beta, neighbour)
    return bands


@pytest.mark.real_data
@pytest.mark.parametrize("name", ["golf_room", "nut_room"])
@pytest.mark.parametrize("count", [1, BANDS])
def test_no_neighbour_of_what_is_found_in_a_real_room_is_likelier(data, name, count):
    """Scoring without a look at the likelihood runs in circles there: the noise is not of the model."""
    sample = scatter(data / "rplidar_csv_rooms" / f"{name}.csv.gz")
    bands = assert_maximum(sample, count, np.random.default_rng(0))
    print([1e3 * sigma.value for sigma in bands.sigmas], 1e3 * bands.slope.value)


@pytest.mark.long
def test_a_general_optimiser_finds_nothing_better_however_badly_the_model_fits():
    rng = np.random.default_rng(1)
    for _ in range(20):
        sample = misfit(rng)
        count = int(rng.choice([1, BANDS]))
        bands = variance_model(*sample, count)
        band, beta = bands_of(bands, sample[3]), fitted(bands)
        unit = np.average(sample[0], weights=sample[1])
        for start in rng.uniform(0, 2, (4, count + 1)) ** 3:
            other = minimize(
                lambda x, band=band, sample=sample, unit=unit: -log_likelihood(unit * x, sample, band),
                start,
                bounds=[(0, None)] * (count + 1),
                method="L-BFGS-B",
            ).x
            assert (
                log_likelihood(unit * other, sample, band) <= log_likelihood(beta, sample, band) + ENOUGH
            ), (unit * other, beta)


def test_ranges_that_never_change_have_no_noise():
    sample = np.zeros(30), np.full(30, 20.0), np.linspace(0, 4, 30), np.linspace(1, 2, 30)
    with pytest.raises(EvaluationError, match="no noise"):
        variance_model(*sample, 1)


def test_bins_that_do_not_scatter_beside_others_are_no_trouble():
    """A quantised near range: all of its bins show the same number in every scan."""
    rng = np.random.default_rng(2)
    ranges = np.linspace(0.2, 4, 80)
    dof, lever2 = np.full(80, 50.0), rng.uniform(0, 1, 80)
    variances = np.where(ranges < 1.2, 0.0, (1e-4 + lever2 * 1e-6) * rng.chisquare(50, 80) / 50)
    bands = variance_model(variances, dof, lever2, ranges, BANDS)
    assert bands.sigmas[0].value < 1e-4
    assert holds(bands.sigmas[-1], 0.01)
