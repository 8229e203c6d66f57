"""How the corners scatter while the sensor stands still, against what each method claims."""

from fastapi import APIRouter

router = APIRouter(prefix="/repeatability", tags=["repeatability"])
