"""The noise of the sensor: measured while it stands still, saved as a profile, chosen."""

from fastapi import APIRouter

router = APIRouter(tags=["calibration"])
