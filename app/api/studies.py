"""Experiments of the papers, run on this machine, and their reports."""

from fastapi import APIRouter

router = APIRouter(prefix="/studies", tags=["studies"])
