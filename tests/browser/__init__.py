"""Tests of the page; a package, so that its browser and its server end with it."""
