"""Tests of the commissioning."""
